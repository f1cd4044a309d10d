"""A stage of the cascade: convolutions over the bodies' windows, and what is left to predict."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network.cascade_settings import CascadeSettings
from kmn_perception.network.encoding import ParameterEncoding
from kmn_perception.network.windows import CHANNELS, Window


class Stage(nn.Module):
    """Predict what is left of (theta, gamma) from the bodies' windows.

    A trunk of convolutions for each window, then two linear layers that also know the estimate so
    far: where the sensor stands in the object's frame, and the sizes. Images enter as the
    difference from their mean over the training data, by their deviation: in the later stages all
    that matters is a few grey values along the edges.

    Attributes
    ----------
    scale
        (k,) mean size of the encoded parameters that this stage has to predict.
    """

    scale: Tensor

    def __init__(
        self,
        model: KinematicModel,
        settings: CascadeSettings,
        margins: tuple[float, float],
        symmetry: str,
    ) -> None:
        super().__init__()
        self.windows = Window.of_model(model, margins, settings.pixels)
        self.encoding = ParameterEncoding(model, symmetry)
        self.trunks = nn.ModuleList(_trunk(settings.channels) for _ in self.windows)
        features = 0
        for i, (window, trunk) in enumerate(zip(self.windows, self.trunks, strict=True)):
            shape = (CHANNELS, window.camera.height, window.camera.width)
            self.register_buffer(f"mean{i}", torch.zeros(shape))
            self.register_buffer(f"gain{i}", torch.ones(shape))
            features += trunk(torch.zeros(1, *shape)).numel()
        self.head = nn.Sequential(
            nn.Linear(features + 3 + len(model.parameters), settings.hidden),
            nn.ReLU(),
            nn.Linear(settings.hidden, self.encoding.size),
        )
        self.register_buffer("scale", torch.ones(self.encoding.size))
        # Twice as fast to train on a CPU.
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, *inputs: Tensor) -> Tensor:
        """Map the windows' images (B, 3, h, w) and the estimate (B, 3 + n + m) to codes (B, k)."""
        *images, estimate = inputs
        features = [
            trunk((image - getattr(self, f"mean{i}")) * getattr(self, f"gain{i}")).flatten(1)
            for i, (trunk, image) in enumerate(zip(self.trunks, images, strict=True))
        ]
        outputs: Tensor = self.head(torch.cat((*features, estimate), dim=1))
        return outputs * self.scale

    def standardise(self, images: Sequence[Tensor], codes: Tensor, min_deviation: float) -> None:
        """Take the means and deviations of the training data.

        Parameters
        ----------
        images
            (N, 3, h, w) for each window.
        codes
            (N, k) what is to be predicted.
        min_deviation
            Added to the deviations, for pixels that hardly ever change.
        """
        for i, image in enumerate(images):
            getattr(self, f"mean{i}").copy_(image.mean(dim=0))
            getattr(self, f"gain{i}").copy_(1.0 / (image.std(dim=0) + min_deviation))
        self.scale.copy_(codes.abs().mean(dim=0).clamp(min=1e-9))


def _trunk(channels: Sequence[int]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in zip((CHANNELS, *channels), channels, strict=False):
        size = 3 if layers else 5
        layers += [nn.Conv2d(inputs, outputs, size, stride=2, padding=size // 2), nn.ReLU()]
    return nn.Sequential(*layers)
