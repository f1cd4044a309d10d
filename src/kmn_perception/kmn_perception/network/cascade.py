"""Our network: one stage for each prediction, which sees every body of the object close up."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import asdict
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import nn

from kmn_perception.configuration.section import Section
from kmn_perception.configuration.settings import read_settings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.network.cascade_settings import CascadeSettings
from kmn_perception.network.morph_network import Inputs, InputType, MorphNetwork
from kmn_perception.network.stage import Stage
from kmn_perception.network.windows import CHANNELS, render_window


class Cascade(MorphNetwork):
    """The stages, one for each prediction, each for the errors that the ones before it leave.

    Parameters
    ----------
    stages
        How many; the rest of the settings' stages may be grown later.
    """

    name = "cascade"
    procedure = "stagewise"

    def __init__(self, model: KinematicModel, settings: CascadeSettings, stages: int) -> None:
        super().__init__(model)
        self.settings = settings
        self.stages = nn.ModuleList()
        for _ in range(stages):
            self.grow()

    @classmethod
    def untrained(cls, model: KinematicModel, design: Section) -> Cascade:
        """Return a cascade without stages; its design is that of ``config/cascade.yaml``."""
        design.allow(())
        return cls(model, CascadeSettings.load(), stages=0)

    @classmethod
    def described(cls, model: KinematicModel, design: Section) -> Cascade:
        """Return the cascade of a description."""
        design.allow(("settings", "stages"))
        settings = read_settings(CascadeSettings, design.section("settings"))
        stages = design.whole_number("stages", 0, len(settings.margins))
        return cls(model, settings, stages)

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
        depth = render(model.prototype_cubes, model.camera, model.cylinder_axes)
        points = depth_to_cloud(depth, model.camera)
        centre: NDArray[np.float64] = points.mean(axis=0, dtype=np.float64)
        return centre

    def start(self, observations: Sequence[Observation]) -> NDArray[np.float64]:
        """Return the prototype's 0, moved to the points' centres."""
        values = np.tile(self.model.prototype, (len(observations), 1))
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
        usual = model.camera.position
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
        return {"settings": asdict(self.settings), "stages": len(self.stages)}
