"""Training of our network, stage by stage, each on the errors of those before it."""

from __future__ import annotations

import shutil
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn.functional import smooth_l1_loss

from kmn_perception.network.cascade import Cascade
from kmn_perception.network.morph import predictions
from kmn_perception.network.morph_network import Inputs, MorphNetwork
from kmn_perception.network.stage import Stage
from kmn_perception.sharing.processes import in_order
from kmn_perception.training.dataset import Dataset
from kmn_perception.training.samples import TrainingSamples
from kmn_perception.training.settings import StagewiseSettings
from kmn_perception.training.training import Training

CHUNK = 64  # samples that are generated together


class StagewiseTraining(Training):
    """Algorithm 2 with a network of its own for each prediction.

    Every round draws fresh samples, morphs them by the stages that are trained, and fits the next
    stage to what they leave. Each sample is used again with the errors of other samples in place
    of its own, so that a stage learns from many errors and not from many scenes alone.
    """

    network: Cascade

    def prepare(self) -> None:
        """Load what all trainings in stages share; stages that are there are trained on."""
        self.stagewise = StagewiseSettings.load()
        self.given = len(self.network.stages)

    @property
    def networks(self) -> dict[str, MorphNetwork]:
        """The cascade, with the stages that it has."""
        return {"network": self.network}

    def begin_round(self) -> None:
        """Grow the stages up to this round's, with an empty data set and a fresh optimiser."""
        step = self.state.round
        while len(self.network.stages) <= step:
            self.network.grow()
        self.network.to(self.workers.device)
        stage = self.network.stage(step)
        self.optimiser = torch.optim.AdamW(stage.parameters(), lr=self.settings.learning_rate)
        self.copies = 1 + (self.stagewise.shuffled if step else 0)
        folder = self.run.folder / f"data{self.workers.rank}" / f"round{step}"
        types, parameters = self.network.input_types(step), len(self.model.parameters)
        capacity = self.samples * self.copies
        self.data = Dataset(folder, types, parameters, capacity, self.state.filled)

    def generate(self) -> None:
        """Fill the data set with samples that are morphed by the stages before."""
        step = self.state.round
        target = self.samples * self.copies
        self._discard_other_rounds()
        make = partial(
            MorphedChunk, self.cpu_network(), self.source, step,
            self.samples, self.copies, self.stagewise.spread,
        )  # fmt: skip
        missing = range(self.state.filled // self.copies, self.samples, CHUNK)
        made = in_order(make, missing, self.jobs)
        with self.bar("data", target, self.state.filled) as bar, closing(made):
            for chunk in made:
                for inputs, left in chunk:
                    rows = slice(self.state.filled, self.state.filled + len(left))
                    self.data.put(rows, inputs, left)
                    self.state.filled = rows.stop
                bar.update(sum(len(left) for _, left in chunk))
                self.save_now_and_then()
        if self.state.step == 0 and step >= self.given:
            (*images, _), values = self.data.batch(slice(self.stagewise.standardised * self.copies))
            stage = self.network.stage(step)
            codes = stage.encoding.encode(values)
            stage.standardise(images, codes, self.stagewise.min_deviation)

    def fitted(self) -> Stage:
        """Return the stage of this round."""
        return self.network.stage(self.state.round)

    def loss(self, outputs: Tensor, values: Tensor) -> Tensor:
        """Return the absolute error, rounded off near 0, in units of what is to be predicted.

        The mean absolute error is what the paper measures; the median of what a view leaves unknown
        minimises it. As for the paper's network, the parameters are weighted by the root of their
        size.
        """
        stage = self.fitted()
        target = stage.encoding.encode(values)
        weight = stage.scale.sqrt() / stage.scale.sqrt().mean()
        errors = smooth_l1_loss(
            outputs / stage.scale, target / stage.scale, beta=self.stagewise.rounding,
            reduction="none",
        )  # fmt: skip
        return (errors * weight).mean()

    def end_round(self) -> None:
        """Let the next round begin with an empty data set."""
        self.state.filled = 0

    def _discard_other_rounds(self) -> None:
        for folder in (self.run.folder / f"data{self.workers.rank}").iterdir():
            if folder.name != f"round{self.state.round}":
                shutil.rmtree(folder)


@dataclass(frozen=True)
class MorphedChunk:
    """Makes some samples of a round, morphed by the stages before, with all their copies.

    Attributes
    ----------
    step
        Number of the stages before: the round.
    samples
        Of each round.
    copies
        How often each of them is used: with its own errors, and with those of others.
    spread
        The errors of others are multiplied by a random factor of up to this.
    """

    network: MorphNetwork
    source: TrainingSamples
    step: int
    samples: int
    copies: int
    spread: float

    def __call__(self, first: int) -> list[tuple[Inputs, NDArray[np.float64]]]:
        """Return inputs (B, ...) and what is left to predict (B, n + m), for each of the copies."""
        network, step, model = self.network, self.step, self.source.model
        count = min(CHUNK, self.samples - first)
        pairs = [self.source.draw(step * self.samples + first + i) for i in range(count)]
        observations = [observation for observation, _ in pairs]
        values = network.start(observations)
        for prediction in islice(predictions(network, observations), step):
            values = prediction.values
        truth = np.stack([truth for _, truth in pairs])
        if step:  # the first stage alone decides how a symmetric object is turned
            truth = model.nearest_equivalent(truth, values)
        seed = (self.source.seed, self.source.rank, step, first)
        return [
            (
                network.render_anew(step, observations, estimates),
                network.remainder(estimates, truth),
            )
            for estimates in self._with_shuffled_errors(values, truth, np.random.default_rng(seed))
        ]

    def _with_shuffled_errors(
        self,
        values: NDArray[np.float64],
        truth: NDArray[np.float64],
        generator: np.random.Generator,
    ) -> list[NDArray[np.float64]]:
        """Return the estimates, and copies with errors that other samples have, grown or shrunk."""
        errors = values - truth
        estimates = [values]
        for _ in range(self.copies - 1):
            factor = generator.uniform(0.0, self.spread, size=(len(errors), 1))
            shuffled = truth + factor * generator.permutation(errors)
            # As the network's own estimates, within the bounds where bodies have a size.
            estimates.append(self.network.concatenate(shuffled, np.zeros_like(shuffled)))
        return estimates
