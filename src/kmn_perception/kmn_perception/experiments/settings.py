"""Settings of the experiment on real frames, read from ``config/experiments.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import PlainValidator

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_perception.model.camera import Camera


@dataclass(frozen=True)
class FaceSettings:
    """How planes are fitted to faces; see the comments in the file."""

    normal_window: Count
    normal_reach: Count
    min_pixels: Count
    steps: Count
    block: Count
    normal_share: Fraction
    level: Fraction
    cosine: Fraction
    outlier: Positive
    nearest: NonNegative
    corner: NonNegative
    depth_error: NonNegative
    narrow_error: NonNegative
    yaw_error: NonNegative


@dataclass(frozen=True)
class ContourSettings:
    """How ends of faces are found in the contour; see the comments in the file."""

    shadow: Count
    min_pixels: Count
    blur: Positive
    cosine: Fraction
    near_face: NonNegative
    step: NonNegative
    window: Positive
    correlated: Positive
    pixel_error: NonNegative


@dataclass(frozen=True)
class BaselineSettings:
    """How the baselines find planes; see the comments in the file."""

    hypotheses: Count
    plane_distance: Positive
    level: Fraction


@dataclass(frozen=True)
class DoorExperimentSettings:
    """The experiment on doors.

    Attributes
    ----------
    camera
        In ``config/cameras``, of frames without a JSON file.
    """

    camera: str


@dataclass(frozen=True)
class ExperimentSettings:
    """The experiment.

    Attributes
    ----------
    camera
        Of the frames; its pose does not matter.
    repetitions
        Of a frame, for its time.
    min_table
        Number of measured pixels of the table that a frame needs.
    visible
        Objects with a smaller share in view do not count.
    match
        Minimum intersection over union of an object with the reference that it is found for.
    tight, wrong
        A side of a smaller stated deviation and a larger error is a gross mistake, metres.
    confidence
        Of the ellipsoid whose coverage is counted.
    unseen
        Standard deviation of a reference's side that is not in view, metres.
    """

    camera: Annotated[Camera, PlainValidator(Camera.load)]
    repetitions: Count
    min_table: Count
    visible: Fraction
    match: Fraction
    tight: Fraction
    wrong: Fraction
    confidence: Fraction
    unseen: Fraction
    faces: FaceSettings
    contour: ContourSettings
    baselines: BaselineSettings
    doors: DoorExperimentSettings

    @classmethod
    def load(cls) -> ExperimentSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.share_directory() / "config/experiments.yaml")
