"""Data generation and network training (paper, Algorithm 2)."""

from __future__ import annotations

import copy
import math
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import islice

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import mse_loss

from kmn_perception.network.encoding import ParameterEncoding
from kmn_perception.network.morph import predictions
from kmn_perception.network.morph_network import Inputs, MorphNetwork
from kmn_perception.sharing.processes import in_order
from kmn_perception.training.dataset import Dataset
from kmn_perception.training.samples import TrainingSamples
from kmn_perception.training.settings import Algorithm2Settings
from kmn_perception.training.training import Training


class Algorithm2(Training):
    """Train a network on rendered data, augment the data with its predictions, retrain."""

    settings_type = Algorithm2Settings

    def prepare(self) -> None:
        """Keep the network as it begins, and set up its optimiser."""
        settings = self.settings
        assert isinstance(settings, Algorithm2Settings)
        self.encoding = ParameterEncoding(self.model, self.model.symmetry)
        self.baseline = self.first_baseline or copy.deepcopy(self.network)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=settings.learning_rate)
        self.augmented = math.ceil(self.samples * settings.augmentation)  # N_aug

    @property
    def networks(self) -> dict[str, MorphNetwork]:
        """The network, and what it was before its data were augmented."""
        return {"network": self.network, "baseline": self.baseline}

    def begin_round(self) -> None:
        """Open the data set; network, data and optimiser go on from round to round."""
        capacity = self.samples + self.settings.rounds * self.augmented
        folder = self.run.folder / f"data{self.workers.rank}"
        types, parameters = self.network.input_types(0), len(self.model.parameters)
        self.data = Dataset(folder, types, parameters, capacity, self.state.filled)

    def generate(self) -> None:
        """Add samples to the data set, morphed by the network's own predictions."""
        steps = self.state.round
        target = self.samples + steps * self.augmented
        first = target - (self.augmented if steps else self.samples)
        make = partial(PredictedSample, self.cpu_network(), self.source, steps)
        missing = range(self.state.filled - first, target - first)
        made = in_order(make, missing, self.jobs)
        with self.bar("data", target - first, missing.start) as bar, closing(made):
            for images, left in made:
                row = self.state.filled
                self.data.put(slice(row, row + 1), images, left)
                self.state.filled = row + 1
                bar.update()
                self.save_now_and_then()

    def fitted(self) -> nn.Module:
        """Return the one network."""
        return self.network

    def loss(self, outputs: Tensor, values: Tensor) -> Tensor:
        """Return the mean squared error."""
        return mse_loss(outputs, self.encoding.encode(values))

    def end_round(self) -> None:
        """Keep the first network as the baseline, if there is none yet."""
        if self.state.round == 0 and self.first_baseline is None:
            self.baseline = copy.deepcopy(self.network)


@dataclass(frozen=True)
class PredictedSample:
    """Makes a sample of D: an observation, morphed by the network's predictions.

    Attributes
    ----------
    steps
        N_pred; with 0 the sample is as it was rendered.
    """

    network: MorphNetwork
    source: TrainingSamples
    steps: int

    def __call__(self, index: int) -> tuple[Inputs, NDArray[np.float64]]:
        """Return the network's inputs (1, ...), and what is to be predicted (1, n + m)."""
        network = self.network
        observation, truth = self.source.draw(index)
        values = network.start([observation])
        for prediction in islice(predictions(network, [observation]), self.steps):
            values = prediction.values
        images = network.render_anew(self.steps, [observation], values)
        return images, network.remainder(values, truth[None])
