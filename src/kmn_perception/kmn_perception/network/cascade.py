"""Our network: one stage for each prediction, which sees every body of the object close up."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.network.encoding import ParameterEncoding
from kmn_perception.network.morph_network import Inputs, InputType, MorphNetwork
from kmn_perception.network.windows import CHANNELS, Window, WindowSettings, render_window


@dataclass(frozen=True)
class CascadeSettings:
    """The design of the network.

    Attributes
    ----------
    margins
        For each stage, the windows' size over that of the bodies' images: for the first body, and
        for the others.
    pixels
        Number of pixels of a window, about: for the first body, and for the others.
    channels
        Output channels of the convolutions.
    hidden
        Width of the hidden layer.
    slack
        By this part of their range (of gamma) or of themselves (scales) sizes may exceed their
        limits.
    window
        How the windows are rendered.
    """

    margins: tuple[tuple[float, float], ...]
    pixels: tuple[int, int]
    channels: tuple[int, ...]
    hidden: int
    slack: float
    window: WindowSettings

    @classmethod
    def load(cls) -> CascadeSettings:
        """Read ``config/cascade.yaml``; raise ``ConfigurationError`` with the key that is wrong."""
        section = Section.load(resources.share_directory() / "config/cascade.yaml")
        section.allow(("network", "training"))
        return cls.read(section.section("network"))

    @classmethod
    def read(cls, section: Section) -> CascadeSettings:
        """Read the settings from a file's section, or from a weight file's description."""
        section.allow(("margins", "pixels", "channels", "hidden", "slack", "window"))
        window = section.section("window")
        window.allow(("reach", "supersampling", "max_gap"))
        first, others = section.numbers("pixels", 2)
        return cls(
            margins=tuple((a, b) for a, b in section.table("margins", 2)),
            pixels=(int(first), int(others)),
            channels=tuple(section.whole_numbers("channels", 1, 4096)),
            hidden=section.whole_number("hidden", 1, 10**6),
            slack=section.number("slack", 0.0, 10.0),
            window=WindowSettings(
                reach=window.number("reach", 0.0, 100.0),
                supersampling=window.whole_number("supersampling", 1, 16),
                max_gap=window.whole_number("max_gap", 0, 64),
            ),
        )


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
        self.windows = [
            Window.around(model, body, margins[min(body, 1)], settings.pixels[min(body, 1)])
            for body in range(len(model.bodies))
        ]
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

    def standardise(self, images: Sequence[Tensor], codes: Tensor, least: float) -> None:
        """Take the means and deviations of the training data.

        Parameters
        ----------
        images
            (N, 3, h, w) for each window.
        codes
            (N, k) what is to be predicted.
        least
            Added to the deviations, for pixels that hardly ever change.
        """
        for i, image in enumerate(images):
            getattr(self, f"mean{i}").copy_(image.mean(dim=0))
            getattr(self, f"gain{i}").copy_(1.0 / (image.std(dim=0) + least))
        self.scale.copy_(codes.abs().mean(dim=0).clamp(min=1e-9))


def _trunk(channels: Sequence[int]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for inputs, outputs in zip((CHANNELS, *channels), channels, strict=False):
        size = 3 if layers else 5
        layers += [nn.Conv2d(inputs, outputs, size, stride=2, padding=size // 2), nn.ReLU()]
    return nn.Sequential(*layers)


class Cascade(MorphNetwork):
    """The stages, one for each prediction, each for the errors that the ones before it leave.

    Parameters
    ----------
    stages
        How many; the rest of the settings' stages may be grown later.
    """

    def __init__(self, model: KinematicModel, settings: CascadeSettings, stages: int) -> None:
        super().__init__(model)
        self.settings = settings
        self.stages = nn.ModuleList()
        for _ in range(stages):
            self.grow()

    def grow(self) -> None:
        """Add the next stage, untrained. Only the first has to find the turn of a symmetric box."""
        number = len(self.stages)
        symmetry = "none" if number else self.model.symmetry
        margins = self.settings.margins[number]
        self.stages.append(Stage(self.model, self.settings, margins, symmetry))
        self.steps = number + 1

    def stage(self, step: int) -> Stage:
        """Return the stage that makes a prediction."""
        stage = self.stages[step]
        assert isinstance(stage, Stage)
        return stage

    @cached_property
    def usual_centre(self) -> NDArray[np.float64]:
        """(3,) centre of the prototype's points as the canonical camera sees them, metres."""
        model = self.model
        zero = np.zeros(len(model.parameters))
        depth = render(model.unit_cubes(*model.split(zero)), model.camera)
        centre: NDArray[np.float64] = depth_to_cloud(depth, model.camera).mean(
            axis=0, dtype=np.float64
        )
        return centre

    def start(self, observations: Sequence[Observation]) -> NDArray[np.float64]:
        """Return the prototype's 0, moved to the points' centres."""
        values = np.zeros((len(observations), len(self.model.parameters)))
        for row, observation in zip(values, observations, strict=True):
            offset = observation.points.mean(axis=0, dtype=np.float64) - self.usual_centre
            for column, (kind, axis) in enumerate(self.model.transformation.kinds):
                if kind == "translation":
                    row[column] = offset["xyz".index(axis)]
        return values

    def render_anew(
        self, step: int, observations: Sequence[Observation], values: NDArray[np.float64]
    ) -> Inputs:
        """Return the windows' images (B, 3, h, w), and what is known of the estimates."""
        images = [
            np.stack(
                [
                    render_window(self.model, window, self.settings.window, observation, row)
                    for observation, row in zip(observations, values, strict=True)
                ]
            )
            for window in self.stage(step).windows
        ]
        known = [self._known(o, row) for o, row in zip(observations, values, strict=True)]
        return (*images, np.stack(known))

    def _known(self, observation: Observation, values: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the sensor's place beside the object and the sizes (3 + n + m,), about 0."""
        model = self.model
        theta, _ = model.split(values)
        usual = model.camera.pose[:3, 3]
        place = (model.transformation.inverse(theta) @ observation.camera.pose[:, 3])[:3]
        sizes = np.where(self._is_size, values / (np.ptp(model.limits, axis=1) / 2.0), 0.0)
        known: NDArray[np.float32] = np.concatenate(
            ((place - usual) / np.linalg.norm(usual), sizes), dtype=np.float32, casting="same_kind"
        )
        return known

    @cached_property
    def _is_size(self) -> NDArray[np.bool_]:
        """(n + m,) whether a parameter is a scale or one of gamma."""
        kinds = [kind for kind, _ in self.model.transformation.kinds]
        return np.array([kind == "scale" for kind in kinds] + [True] * len(self.model.gamma))

    @cached_property
    def _bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(n + m,) lower and upper bounds of estimates: of sizes somewhat beyond their limits.

        Within these all bodies have a size. Where the limits of gamma leave no room for that, they
        are the bounds.
        """
        model, slack = self.model, self.settings.slack
        low, high = model.limits.T.copy()
        gamma_low, gamma_high = model.split(low)[1], model.split(high)[1]
        room = slack * (gamma_high - gamma_low)
        corners = itertools.product(*zip(gamma_low - room, gamma_high + room, strict=True))
        if all(body.size(corner).min() > 0.0 for corner in corners for body in model.bodies):
            gamma_low -= room
            gamma_high += room
        for i, (kind, _) in enumerate(model.transformation.kinds):
            if kind == "scale":
                low[i] = (1.0 + low[i]) / (1.0 + slack) - 1.0
                high[i] = (1.0 + high[i]) * (1.0 + slack) - 1.0
            else:
                low[i], high[i] = -np.inf, np.inf
        return low, high

    @torch.inference_mode()
    def predict(self, step: int, inputs: Inputs) -> NDArray[np.float64]:
        """Return what is left of theta and gamma (B, n + m)."""
        stage = self.stage(step)
        codes = stage(*(torch.from_numpy(array) for array in inputs))
        left: NDArray[np.float64] = stage.encoding.decode(codes.double()).numpy()
        return left

    def concatenate(
        self, values: NDArray[np.float64], predicted: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return T T_bar's theta and the sum of the gammas, with sizes that can exist."""
        theta, gamma = self.model.split(values)
        theta_bar, gamma_bar = self.model.split(predicted)
        theta = self.model.transformation.concatenate(theta, theta_bar)
        return np.clip(np.concatenate((theta, gamma + gamma_bar), axis=-1), *self._bounds)

    def remainder(
        self, values: NDArray[np.float64], truth: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return what is left of theta and of gamma."""
        theta, gamma = self.model.split(values)
        true_theta, true_gamma = self.model.split(truth)
        left = self.model.transformation.remainder(theta, true_theta)
        return np.concatenate((left, true_gamma - gamma), axis=-1)

    def input_types(self, step: int) -> tuple[InputType, ...]:
        """Return those of the windows' images, and of the estimates."""
        images = [
            InputType((CHANNELS, window.camera.height, window.camera.width), np.float16)
            for window in self.stage(step).windows
        ]
        return (*images, InputType((3 + len(self.model.parameters),), np.float32))

    def describe(self) -> dict[str, Any]:
        """Return the settings and the number of stages."""
        return {"cascade": asdict(self.settings), "stages": len(self.stages)}
