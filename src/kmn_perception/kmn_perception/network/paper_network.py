"""The paper's network f: depth image -> (theta, gamma) (paper, Eq. 4 and Sec. III-C)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from kmn_perception.configuration.section import Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.point_rendering import point_cloud_to_depth
from kmn_perception.network.encoding import ParameterEncoding
from kmn_perception.network.morph_network import Inputs, InputType, MorphNetwork

CONVOLUTIONS = 5


class PaperNetwork(MorphNetwork):
    """Five convolutions 3x3, each with ReLU and max-pooling, then one linear layer.

    The depth image enters as two channels, see `split`; all else is as in the paper.

    Parameters
    ----------
    model
        Gives the size of the depth image and the parameters to predict.
    channels
        Output channels of the convolutions.
    """

    name = "paper"
    procedure = "algorithm2"

    def __init__(self, model: KinematicModel, channels: Sequence[int]) -> None:
        super().__init__(model)
        self.channels = tuple(channels)
        self.encoding = ParameterEncoding(model, model.symmetry)
        layers: list[nn.Module] = []
        for inputs, outputs in zip((2, *channels), channels, strict=False):
            # Pooling before the ReLU gives the same values and is cheaper.
            layers += [nn.Conv2d(inputs, outputs, 3, padding=1), nn.MaxPool2d(2), nn.ReLU()]
        self.convolutions = nn.Sequential(*layers)
        shrunk = 2 ** len(channels)
        image = model.depth_image
        features = channels[-1] * (image.width // shrunk) * (image.height // shrunk)
        self.linear = nn.Linear(features, self.encoding.size)
        self._initialise()
        # Twice as fast to train on a CPU.
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    @classmethod
    def untrained(cls, model: KinematicModel, design: Section) -> PaperNetwork:
        """Return a network with the ``channels`` of the design."""
        design.allow(("channels",))
        return cls(model, _channels(design))

    @classmethod
    def described(cls, model: KinematicModel, design: Section) -> PaperNetwork:
        """Return the network of a description, which saw depth images as the model sees them."""
        design.allow(("channels", "input"))
        if design.section("input").values != vars(model.depth_image):
            raise design.error(
                f"'input' is {design.values['input']}, that of model '{model.name}' is "
                f"{vars(model.depth_image)}"
            )
        return cls(model, _channels(design))

    def _initialise(self) -> None:
        """Kaiming weights and slightly positive biases: with few channels, dead ReLUs are fatal."""
        for layer in self.convolutions:
            if isinstance(layer, nn.Conv2d):
                nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
                assert layer.bias is not None
                nn.init.constant_(layer.bias, 0.05)
        nn.init.normal_(self.linear.weight, std=0.01)
        nn.init.zeros_(self.linear.bias)

    def forward(self, depth: Tensor) -> Tensor:
        """Map depth images (B, height, width) in [0, 1] to encoded parameters (B, k)."""
        features = self.convolutions(self.split(depth))
        encoded: Tensor = self.linear(features.flatten(1))
        return encoded

    def split(self, depth: Tensor) -> Tensor:
        """Split depth images into where there is something, and how far it is, with contrast.

        In the depth image itself a handle on a door is a hundredth beside the step from 1/2 to the
        background, and takes very long to learn. The network could undo the split: it holds the
        same information.

        Returns
        -------
        channels
            (B, 2, height, width) coverage 0 or 1, and depth about 1/2 times the contrast.
        """
        covered = (depth > 0.0).to(depth.dtype)
        contrast = self.model.depth_image.contrast
        return torch.stack((covered, contrast * (depth - 0.5) * covered), dim=1)

    def start(self, observations: Sequence[Observation]) -> NDArray[np.float64]:
        """Return the prototype's 0, or, if the model says so, move it to the points' centres."""
        values = np.tile(self.model.prototype, (len(observations), 1))
        if self.model.start == "centroid":
            centres = [o.points.mean(axis=0, dtype=np.float64) for o in observations]
            for column, (kind, axis) in enumerate(self.model.transformation.kinds):
                if kind == "translation" and axis in "xy":
                    values[:, column] = np.stack(centres)[:, "xy".index(axis)]
        return values

    def render_anew(
        self, step: int, observations: Sequence[Observation], values: NDArray[np.float64]
    ) -> Inputs:
        """Return the depth images (B, height, width) of the points morphed by T_theta^-1 (Eq. 5).

        The paper morphs the cloud step by step; morphing the observed cloud by the whole of T is
        the same, and needs no copy of it.
        """
        theta, _ = self.model.split(values)
        inverse = self.model.transformation.inverse(theta)
        return (
            np.stack(
                [
                    point_cloud_to_depth(self.model, observation.points, matrix)
                    for observation, matrix in zip(observations, inverse, strict=True)
                ]
            ),
        )

    @torch.inference_mode()
    def predict(self, step: int, inputs: Inputs) -> NDArray[np.float64]:
        """Map depth images (B, height, width) to morphing parameters (B, n + m)."""
        decoded: NDArray[np.float64] = self.encoding.decode(
            self(torch.from_numpy(inputs[0])).double()
        ).numpy()
        return decoded

    def concatenate(
        self, values: NDArray[np.float64], predicted: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return T T_bar's theta, and the gamma of the last prediction."""
        theta, _ = self.model.split(values)
        theta_bar, gamma = self.model.split(predicted)
        theta = self.model.transformation.concatenate(theta, theta_bar)
        return np.concatenate((theta, gamma), axis=-1)

    def remainder(
        self, values: NDArray[np.float64], truth: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return theta's remainder, and all of gamma, as in Algorithm 2."""
        theta, _ = self.model.split(values)
        true_theta, gamma = self.model.split(truth)
        left = self.model.transformation.remainder(theta, true_theta)
        return np.concatenate((left, gamma), axis=-1)

    def input_types(self, step: int) -> tuple[InputType, ...]:
        """Return that of the depth image."""
        image = self.model.depth_image
        return (InputType((image.height, image.width), np.float32),)

    def describe(self) -> dict[str, Any]:
        """Return the channels and the depth image's settings."""
        return {"channels": list(self.channels), "input": vars(self.model.depth_image).copy()}


def _channels(design: Section) -> list[int]:
    channels = design.whole_numbers("channels", 1, 4096)
    if len(channels) != CONVOLUTIONS:
        raise design.error(f"'channels' must be {CONVOLUTIONS} numbers, found {channels}")
    return channels
