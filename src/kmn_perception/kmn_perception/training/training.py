"""Train in rounds: generate data, fit, measure (the frame of Algorithm 2)."""

from __future__ import annotations

import copy
import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from tqdm import tqdm

from kmn_perception.network.errors import errors_by_step
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.training.dataset import Dataset
from kmn_perception.training.run import Run
from kmn_perception.training.samples import TrainingSamples, sample
from kmn_perception.training.settings import TrainingSettings, ValidationSettings
from kmn_perception.training.workers import Workers

VALIDATION = (2,)  # spawn key of the samples that measure a training


@dataclass
class TrainingState:
    """How far a run has come; what a checkpoint holds beside the networks and the optimiser."""

    round: int = 0  # 0 is the first training, then one for each augmentation
    begun: int = 0  # samples that were in the data set when the round began
    filled: int = 0  # samples in the data set, of the first worker
    step: int = 0  # batches trained in this round
    seconds: float = 0.0
    errors: list[list[float]] = field(default_factory=list)  # [round][prediction step]
    losses: list[list[float]] = field(default_factory=list)  # [seconds, round, loss]


class Training(ABC):
    """Rounds of data generation and fitting, each on data morphed by the rounds before.

    Parameters
    ----------
    network
        Untrained, or one that is trained on.
    run
        Keeps checkpoints and curves.
    workers
        The processes that train together; each generates and keeps its own share of the data.
    jobs
        How many generate the data of each of them.
    baseline
        What a network that is trained on was before its data were augmented, if that is known.
    """

    settings_type: ClassVar[type[TrainingSettings]] = TrainingSettings
    optimiser: torch.optim.Optimizer
    data: Dataset

    def __init__(
        self,
        network: MorphNetwork,
        settings: TrainingSettings,
        validation: ValidationSettings,
        run: Run,
        workers: Workers,
        jobs: int = 1,
        baseline: MorphNetwork | None = None,
    ) -> None:
        self.network, self.model = network.to(workers.device), network.model
        self.first_baseline = baseline and baseline.to(workers.device)
        self.settings, self.validation, self.run, self.workers = settings, validation, run, workers
        self.jobs, self.state = jobs, TrainingState()
        self.samples = math.ceil(settings.samples / workers.count)  # N_data of this worker
        self.source = TrainingSamples(
            self.model, settings.seed, settings.sensor, workers.rank, workers.count
        )
        self.prepare()

    @abstractmethod
    def prepare(self) -> None:
        """Set up what this procedure needs, before the first round."""

    def train(self) -> None:
        """Train to the end, from wherever the last checkpoint left it."""
        checkpoint = self.workers.from_first(lambda: self.run.load(self.workers.device))
        if checkpoint is not None:
            self.state = TrainingState(**checkpoint["state"])
            self.state.filled = self._filled()
            self.workers.say(f"resuming in round {self.state.round}")
        while self.state.round <= self.settings.rounds:
            if checkpoint is None:
                self.state.begun = self.state.filled
            self.begin_round()
            if checkpoint is not None:
                self._restore(checkpoint)
                checkpoint = None
            self._save_first()
            self.workers.wait()  # none makes data of a round that the checkpoint does not know
            self.generate()
            self._save()
            self._fit()
            self._validate()
            self.end_round()
            if self._settled():
                break
            self.state.round, self.state.step = self.state.round + 1, 0

    @property
    @abstractmethod
    def networks(self) -> dict[str, MorphNetwork]:
        """All networks that a checkpoint holds."""

    @abstractmethod
    def begin_round(self) -> None:
        """Make what the round of ``state`` needs: data set, fitted network, optimiser."""

    @abstractmethod
    def generate(self) -> None:
        """Fill the data set, from where ``state.filled`` says that it ended."""

    @abstractmethod
    def fitted(self) -> nn.Module:
        """Return the network that this round fits."""

    @abstractmethod
    def loss(self, outputs: Tensor, values: Tensor) -> Tensor:
        """Return the loss of outputs (B, k) where (theta, gamma) (B, n + m) was to be predicted."""

    @abstractmethod
    def end_round(self) -> None:
        """Keep what is left of a round."""

    def _fit(self) -> None:
        settings, state = self.settings, self.state
        epochs = settings.retrain_epochs if state.round else settings.epochs
        batch = max(1, settings.batch // self.workers.count)
        steps_per_epoch = math.ceil(state.filled / batch)
        total = epochs * steps_per_epoch
        parallel = self.workers.parallel(self.fitted()).train()
        data = self.data.moved_to(self.workers.device, state.filled)
        started = time.monotonic() - state.seconds
        with self.bar("fit", total * batch, state.step * batch) as bar:
            for rows in self._batches(batch, steps_per_epoch, total):
                self._set_learning_rate(state.step / total)
                inputs, values = data.batch(rows)
                loss = self.loss(parallel(*inputs), values)
                self.optimiser.zero_grad(set_to_none=True)
                loss.backward()
                self.optimiser.step()
                state.step += 1
                state.seconds = time.monotonic() - started
                bar.update(batch)
                if state.step % 100 == 0:
                    self._log_loss(loss.item())
                    bar.set_postfix(loss=f"{loss.item():.5f}")
                self.save_now_and_then()
        self.fitted().eval()

    def _batches(self, size: int, steps_per_epoch: int, total: int) -> Iterator[NDArray[np.int64]]:
        """Yield the rows of each batch; every epoch is a permutation that its number gives."""
        seed = (self.settings.seed, self.workers.rank, self.state.round)
        for epoch in range(self.state.step // steps_per_epoch, total // steps_per_epoch):
            order = np.random.default_rng((*seed, epoch)).permutation(self.state.filled)
            for step in range(self.state.step - epoch * steps_per_epoch, steps_per_epoch):
                yield np.sort(order[step * size : (step + 1) * size])

    def _set_learning_rate(self, progress: float) -> None:
        for group in self.optimiser.param_groups:
            group["lr"] = self.settings.learning_rate * (1.0 + math.cos(math.pi * progress)) / 2.0

    def _validate(self) -> None:
        """Measure the error by prediction step on samples that are never trained on."""
        pairs = [
            sample(self.model, self.settings.seed, i, self.settings.sensor, spawn_key=VALIDATION)
            for i in range(self.validation.samples)
        ]
        observations = [observation for observation, _ in pairs]
        truth = np.stack([values for _, values in pairs])
        errors = errors_by_step(self.cpu_network(), observations, truth, self.validation.steps)
        self.state.errors.append(errors.sum(axis=2).mean(axis=1).tolist())
        by_step = " ".join(f"{error:.5f}" for error in self.state.errors[-1])
        self.workers.say(f"round {self.state.round}: error after 0, 1, ... predictions: {by_step}")
        self.run.curve("error", self.state.errors[-1][-1], self.state.round)

    def cpu_network(self) -> MorphNetwork:
        """Return the network in the layout that suits single predictions."""
        network = copy.deepcopy(self.network).cpu().eval()
        return network.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]

    def _settled(self) -> bool:
        """Tell whether the last round changed (almost) nothing."""
        last = [by_step[-1] for by_step in self.state.errors[-2:]]
        return self.state.round > 1 and last[1] > last[0] * (1.0 - self.settings.patience)

    def _log_loss(self, loss: float) -> None:
        self.state.losses.append([round(self.state.seconds, 1), self.state.round, loss])
        self.run.curve(f"loss/round{self.state.round}", loss, self.state.step)

    def bar(self, what: str, total: int, done: int) -> tqdm[Any]:
        """Return a progress bar of samples."""
        return tqdm(
            total=total,
            initial=done,
            unit=" samples",
            desc=f"round {self.state.round}/{self.settings.rounds} {what}",
            mininterval=1.0,
            disable=self.workers.rank > 0,
        )

    def save_now_and_then(self) -> None:
        """Write a checkpoint when it is due, and stop when the run is interrupted."""
        if self.run.checkpoint_is_due():
            self._save()
        if self.run.interrupted:
            raise KeyboardInterrupt

    def _save(self) -> None:
        if self.workers.rank > 0:
            self.run.save_share(self.workers.rank, (self.state.round, self.state.filled))
        self._save_first()

    def _filled(self) -> int:
        """Return how far this worker's own data came: the checkpoint tells of the first's."""
        if self.workers.rank == 0:
            return self.state.filled
        of_round, filled = self.run.load_share(self.workers.rank)
        return filled if of_round == self.state.round else self.state.begun

    def _save_first(self) -> None:
        if self.workers.rank == 0:
            networks = {name: network.state_dict() for name, network in self.networks.items()}
            self.run.save(
                {
                    **networks,
                    "optimiser": self.optimiser.state_dict(),
                    "state": vars(self.state),
                }
            )

    def _restore(self, checkpoint: dict[str, Any]) -> None:
        for name, network in self.networks.items():
            network.load_state_dict(checkpoint[name])
        self.optimiser.load_state_dict(checkpoint["optimiser"])
