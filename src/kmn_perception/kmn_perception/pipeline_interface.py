"""What morph_node asks of a pipeline, be it that of single objects or that of doors in walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_tracker import DoorTracker
from kmn_perception.estimate import Estimate
from kmn_perception.estimator import EstimatorSettings
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.scene.camera_pose import CameraPose
from kmn_perception.scene.depth_view import DepthView
from kmn_perception.scene.segmentation import SegmentationSettings
from kmn_perception.scene.settings import SceneSettings
from kmn_perception.scene.standing import Standing
from kmn_perception.scene.support_plane import SupportPlaneSettings


class CalibrationState(Enum):
    """What was done about a depth camera's calibration: that of its maker, or the user's own."""

    DELIVERED = "delivered"
    CALIBRATED = "calibrated"


class FrameBudget(NamedTuple):
    """What a frame of single objects may cost.

    Attributes
    ----------
    objects
        Number that is estimated at most, the nearest ones.
    seconds
        After which no other one is begun.
    """

    objects: int
    seconds: float


@dataclass(frozen=True, eq=False)
class PipelineSettings:
    """How a frame becomes objects in the world frame.

    Attributes
    ----------
    camera_pose
        The view's own, the model's canonical one, the given one, or estimated from the support
        plane.
    given_pose
        (4, 4) optical frame in the world frame, metres.
    plane
        What counts as a support plane.
    background
        The stages of the background removal.
    scene
        How objects are told apart.
    calibration
        Of the depth camera; counts for doors in walls.
    budget
        Of a frame of single objects.
    """

    camera_pose: CameraPose
    given_pose: NDArray[np.float64]
    plane: SupportPlaneSettings
    background: SegmentationSettings
    scene: SceneSettings
    calibration: CalibrationState
    budget: FrameBudget


class ObjectEstimate(NamedTuple):
    """An estimate with what it rests on.

    Attributes
    ----------
    estimate
        Morphing parameters, or why there are none.
    observation
        The object's points, in the world frame, and what is known around them.
    mask
        (height, width), or (N,) for unorganised points: which ones they are.
    truncated
        The object goes on where nothing is seen: beyond the image's border.
    standing
        What it is seen to stand on.
    left_out
        The budget of the frame did not suffice for it.
    """

    estimate: Estimate
    observation: Observation
    mask: NDArray[np.bool_]
    truncated: bool
    standing: Standing = Standing.UNSEEN
    left_out: bool = False


class Estimator(Protocol):
    """Explains single objects by one model, or by the best of several."""

    @property
    def models(self) -> tuple[KinematicModel, ...]:
        """By which objects are explained."""

    @property
    def settings(self) -> EstimatorSettings:
        """Of all models."""

    def warm_up(self) -> None:
        """Compile and load all that the first estimate needs, so that it is not slow."""

    def estimate(self, observation: Observation) -> Estimate:
        """Estimate the morphing parameters of an object from points that show nothing else."""

    def estimate_all(self, observations: Sequence[Observation]) -> list[Estimate]:
        """Estimate the morphing parameters of several objects."""

    def configured(self, settings: EstimatorSettings) -> Estimator:
        """Return the estimator with other settings, which shares what was loaded."""


class Pipeline(Protocol):
    """From a frame to estimates, as morph_node needs it."""

    @property
    def model(self) -> KinematicModel:
        """What is estimated; of several models the first."""

    @property
    def uses_image(self) -> bool:
        """Whether a view's grey values tell anything."""

    def warm_up(self) -> None:
        """Compile and load all that the first estimate needs, so that it is not slow."""

    def estimate_all(
        self, view: DepthView, max_objects: int | None = None, past: DoorTracker | None = None
    ) -> list[ObjectEstimate]:
        """Estimate ``max_objects`` or all objects; where there is none, a single one says why.

        Parameters
        ----------
        past
            The frames before: where a door in its wall was, and what it is fused with; None: the
            frame by itself.
        """

    def bodies(self, estimate: Estimate) -> NDArray[np.float64]:
        """Return the bodies (B, 4, 4) to draw, none without an estimate; see `unit_cubes`."""

    def configured(self, settings: PipelineSettings, estimator: EstimatorSettings) -> Pipeline:
        """Return the pipeline with other settings, which shares what was loaded."""
