"""The network f: depth image -> (theta, gamma) (paper, Eq. 4 and Sec. III-C)."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from kmn_perception.encoding import ParameterEncoding
from kmn_perception.kinematic_model import KinematicModel


class MorphNetwork(nn.Module):
    """Five convolutions 3x3, each with ReLU and max-pooling, then one linear layer.

    The depth image enters as two channels, see `split`; all else is as in the paper.

    Parameters
    ----------
    model
        Gives the size of the depth image and the parameters to predict.
    channels
        Output channels of the convolutions.
    """

    def __init__(self, model: KinematicModel, channels: Sequence[int]) -> None:
        super().__init__()
        self.channels = tuple(channels)
        self.contrast = model.input.contrast
        self.encoding = ParameterEncoding(model)
        layers: list[nn.Module] = []
        for inputs, outputs in zip((2, *channels), channels, strict=False):
            # Pooling before the ReLU gives the same values and is cheaper.
            layers += [nn.Conv2d(inputs, outputs, 3, padding=1), nn.MaxPool2d(2), nn.ReLU()]
        self.convolutions = nn.Sequential(*layers)
        shrunk = 2 ** len(channels)
        features = channels[-1] * (model.input.width // shrunk) * (model.input.height // shrunk)
        self.linear = nn.Linear(features, self.encoding.size)
        self._initialise()
        # Twice as fast to train on a CPU.
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

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
        return torch.stack((covered, self.contrast * (depth - 0.5) * covered), dim=1)

    @torch.inference_mode()
    def predict(self, depth: Tensor) -> Tensor:
        """Map depth images (B, height, width) to morphing parameters (B, n + m), float64."""
        return self.encoding.decode(self(depth).double())
