"""What is fitted to what, and how well it fits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.refinement.geometry import Shape, cuboids, shape_of
from kmn_perception.refinement.image import (
    InverseDepthImage,
    inverse_depth_image,
    single_pixel_noise,
)
from kmn_perception.refinement.misfit import misfit
from kmn_perception.refinement.settings import RefinementSettings
from kmn_perception.refinement.view import ModelView, model_view

MIN_MOVEMENT = 1e-12  # pixels per unit


@dataclass(frozen=True, eq=False)
class Problem:
    """A model, the limits (P, 2) of what is fitted of it, and an observation of it.

    The P parameters are (theta, gamma) and then the positions of the joints that are free.

    Attributes
    ----------
    shape_error
        Standard deviation by which faces and edges lie off those of the model, metres.
    """

    shape: Shape
    limits: NDArray[np.float64]
    image: InverseDepthImage
    settings: RefinementSettings
    shape_error: float

    @classmethod
    def of(
        cls,
        model: KinematicModel,
        observation: Observation,
        settings: RefinementSettings,
        shape_error: float = 0.0,
    ) -> Problem:
        """Return the problem of fitting a model to an observation."""
        image = inverse_depth_image(observation, settings.occlusion)
        return cls(shape_of(model), model.limits, image, settings, shape_error)

    def freed(self, model: KinematicModel) -> Problem:
        """Return the problem with the joints free whose positions are estimated."""
        free = model.states
        limits = np.array([*model.limits, *(joint.limits for joint in free)])
        settings = self.settings.without_retries()  # positions are searched instead
        return replace(self, shape=shape_of(model, free), limits=limits, settings=settings)

    @cached_property
    def half_range(self) -> NDArray[np.float64]:
        """(P,) half the distance between the limits."""
        return 0.5 * (self.limits[:, 1] - self.limits[:, 0])

    @cached_property
    def inverse_depth_per_metre(self) -> float:
        """Change of the inverse depth per metre at the object's distance, 1 / m^2."""
        stride = self.stride(self.settings.distance_pixels)
        return float(np.mean(self.image.pixels[::stride, 2])) ** 2

    @cached_property
    def depth_noise(self) -> float:
        """Standard deviation of the inverse depth of single pixels, 1 / m."""
        return single_pixel_noise(self.image.inverse_depth)

    @cached_property
    def depth_noise_in_metres(self) -> float:
        """The same of the depth, at the object's distance."""
        return self.depth_noise / self.inverse_depth_per_metre

    @cached_property
    def visible_step(self) -> float:
        """Smallest step in depth that single pixels show, metres."""
        settings = self.settings.edges
        return max(settings.contrast, settings.single * self.depth_noise_in_metres)

    @cached_property
    def shape_error_in_pixels(self) -> float:
        """The same in the image, at the object's distance."""
        focal_length = float(np.linalg.norm(self.image.projection[0, :3]))
        return self.shape_error * focal_length * float(np.sqrt(self.inverse_depth_per_metre))

    def stride(self, pixels: int) -> int:
        """Return the stride that leaves about this many of the observed pixels."""
        return max(1, round(len(self.image.pixels) / pixels))

    def view(self, values: NDArray[np.float64]) -> ModelView:
        """Return the model at ``values`` (P,) as the sensor sees it."""
        edges, projection = self.settings.edges, self.image.projection
        return model_view(self.shape, values, projection, edges.contrast, edges.background)

    def misfit(self, values: NDArray[np.float64]) -> float:
        """Return the fraction of pixels that the model explains wrongly, from some of them."""
        settings = self.settings.misfit
        return misfit(self.view(values), self.image, settings, settings.pixels)

    def final_misfit(self, values: NDArray[np.float64]) -> float:
        """Return the fraction of pixels that the model explains wrongly, from many of them."""
        settings = self.settings.misfit
        return misfit(self.view(values), self.image, settings, settings.final_pixels)

    def explains(self, misfit: float) -> bool:
        """Tell whether a misfit is hardly more than what the noise of single pixels makes."""
        noise = (self.depth_noise_in_metres / self.settings.misfit.depth) ** 2
        return misfit <= noise + self.settings.states.unexplained

    def clipped(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the values (P,), clipped to the limits and a margin beside them."""
        margin = 2.0 * self.settings.limit_margin * self.half_range
        low, high = self.limits.T
        return np.minimum(np.maximum(values, low - margin), high + margin)

    def pixels_per_unit(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return approximately how far each parameter (P,) moves the surface in the image."""
        _, jacobians = cuboids(self.shape, values)
        squares = jacobians**2
        corners = 0.25 * squares[:, :, :3].sum(axis=(1, 2)) + squares[:, :, 3].sum(axis=1)
        focal_length = np.linalg.norm(self.image.projection[0, :3])
        return (
            np.sqrt(corners.max(axis=0) * self.inverse_depth_per_metre) * focal_length
            + MIN_MOVEMENT
        )
