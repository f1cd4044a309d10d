"""Data generation and network training (paper, Algorithm 2)."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn.functional import mse_loss
from tqdm import tqdm

from kmn_perception.evaluation.errors import errors_by_step
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.morph import predict, render_anew, start
from kmn_perception.network import MorphNetwork
from kmn_perception.training.dataset import Dataset
from kmn_perception.training.run import Run
from kmn_perception.training.samples import sample
from kmn_perception.training.settings import TrainingSettings
from kmn_perception.training.workers import Workers

VALIDATION_SAMPLES = 500
VALIDATION_STEPS = 5


@dataclass
class State:
    """How far a run has come; what a checkpoint holds beside the networks and the optimiser."""

    round: int = 0  # 0 is the first training, then one for each augmentation
    filled: int = 0  # samples in the data set
    step: int = 0  # batches trained in this round
    seconds: float = 0.0
    errors: list[list[float]] = field(default_factory=list)  # [round][prediction step]
    losses: list[list[float]] = field(default_factory=list)  # [seconds, round, loss]


class Algorithm2:
    """Train a network on rendered data, augment the data with its predictions, retrain.

    Parameters
    ----------
    run
        Keeps checkpoints and curves.
    workers
        The processes that train together; each generates and keeps its own share of the data.
    """

    def __init__(
        self, model: KinematicModel, settings: TrainingSettings, run: Run, workers: Workers
    ) -> None:
        torch.manual_seed(settings.seed)
        self.model, self.settings, self.run, self.workers = model, settings, run, workers
        self.network = MorphNetwork(model, settings.channels).to(workers.device)
        self.baseline = copy.deepcopy(self.network)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=settings.learning_rate)
        self.state = State()
        self.initial = math.ceil(settings.samples / workers.count)
        self.augmented = math.ceil(self.initial * settings.augmentation)
        capacity = self.initial + settings.rounds * self.augmented
        self.data = Dataset(run.folder / f"data{workers.rank}", model, capacity)

    def train(self) -> None:
        """Run Algorithm 2 to its end, from wherever the last checkpoint left it."""
        self._restore()
        while self.state.round <= self.settings.rounds:
            self._generate(predictions=self.state.round)
            self._fit()
            self._validate()
            if self.state.round == 0:
                self.baseline = copy.deepcopy(self.network)
            if self._settled():
                break
            self.state.round, self.state.step = self.state.round + 1, 0
            self._save()

    def _generate(self, predictions: int) -> None:
        """Add samples to the data set, morphed by the network's own predictions."""
        target = self.initial + predictions * self.augmented
        network = copy.deepcopy(self.network).cpu().eval()
        first = target - (self.augmented if predictions else self.initial)
        with self._bar("data", target - first, self.state.filled - first, "samples") as bar:
            for index in range(self.state.filled, target):
                depth, values = self._morphed_sample(network, index - first, predictions)
                self.data.put(index, depth, values)
                self.state.filled = index + 1
                bar.update()
                self._save_now_and_then()

    def _morphed_sample(
        self, network: MorphNetwork, index: int, steps: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return the depth image after ``steps`` predictions, and what is left to predict."""
        number = index * self.workers.count + self.workers.rank
        observation, truth = sample(self.model, self.settings.seed, number, self.settings.sensor)
        cloud = observation.points
        theta = start(self.model, [cloud])
        depth = render_anew(self.model, [cloud], theta)
        if steps:
            (depth, values, _), _ = predict(self.model, network, [cloud], theta, steps)
            theta, _ = self.model.split(values)
        true_theta, gamma = self.model.split(truth)
        left = self.model.transformation.remainder(theta[0], true_theta)
        return depth[0], np.concatenate((left, gamma))

    def _fit(self) -> None:
        """Minimise the mean squared error over the data set with Adam."""
        settings, state = self.settings, self.state
        epochs = settings.retrain_epochs if state.round else settings.epochs
        batch = max(1, settings.batch // self.workers.count)
        steps_per_epoch = math.ceil(state.filled / batch)
        total = epochs * steps_per_epoch
        parallel = self.workers.parallel(self.network).train()
        started = time.monotonic() - state.seconds
        with self._bar("fit", total * batch, state.step * batch, "samples") as bar:
            for indices in self._batches(batch, steps_per_epoch, total):
                self._set_learning_rate(state.step / total)
                depth, values = self.data.batch(indices)
                target = self.network.encoding.encode(values.to(self.workers.device))
                loss = mse_loss(parallel(depth.to(self.workers.device)), target)
                self.optimiser.zero_grad(set_to_none=True)
                loss.backward()
                self.optimiser.step()
                state.step += 1
                state.seconds = time.monotonic() - started
                bar.update(batch)
                if state.step % 100 == 0:
                    self._log_loss(loss.item())
                    bar.set_postfix(loss=f"{loss.item():.5f}")
                self._save_now_and_then()
        self.network.eval()

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
        network = copy.deepcopy(self.network).cpu().eval()
        pairs = [
            sample(self.model, self.settings.seed, self.settings.samples + i, self.settings.sensor)
            for i in range(VALIDATION_SAMPLES)
        ]
        clouds = [observation.points for observation, _ in pairs]
        truth = np.stack([values for _, values in pairs])
        errors = errors_by_step(self.model, network, clouds, truth, VALIDATION_STEPS)
        self.state.errors.append(errors.sum(axis=2).mean(axis=1).tolist())
        by_step = " ".join(f"{error:.4f}" for error in self.state.errors[-1])
        self.workers.say(f"round {self.state.round}: error after 0, 1, ... predictions: {by_step}")
        self.run.curve("error", self.state.errors[-1][-1], self.state.round)

    def _settled(self) -> bool:
        """Tell whether the last retraining changed (almost) nothing."""
        last = [by_step[-1] for by_step in self.state.errors[-2:]]
        return self.state.round > 1 and last[1] > last[0] * (1.0 - self.settings.patience)

    def _log_loss(self, loss: float) -> None:
        self.state.losses.append([round(self.state.seconds, 1), self.state.round, loss])
        self.run.curve(f"loss/round{self.state.round}", loss, self.state.step)

    def _bar(self, what: str, total: int, done: int, unit: str) -> tqdm[Any]:
        return tqdm(
            total=total,
            initial=done,
            unit=f" {unit}",
            desc=f"round {self.state.round}/{self.settings.rounds} {what}",
            mininterval=1.0,
            disable=self.workers.rank > 0,
        )

    def _save_now_and_then(self) -> None:
        if self.run.checkpoint_is_due():
            self._save()
        if self.run.interrupted:
            raise KeyboardInterrupt

    def _save(self) -> None:
        if self.workers.rank == 0:
            self.run.save(
                {
                    "network": self.network.state_dict(),
                    "baseline": self.baseline.state_dict(),
                    "optimiser": self.optimiser.state_dict(),
                    "state": vars(self.state),
                }
            )

    def _restore(self) -> None:
        checkpoint = self.run.load(self.workers.device)
        if checkpoint is not None:
            self.network.load_state_dict(checkpoint["network"])
            self.baseline.load_state_dict(checkpoint["baseline"])
            self.optimiser.load_state_dict(checkpoint["optimiser"])
            self.state = State(**checkpoint["state"])
            self.workers.say(f"resuming in round {self.state.round}")
