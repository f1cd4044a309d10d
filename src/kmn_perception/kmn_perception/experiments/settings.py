"""Settings of the experiment on real frames, read from ``config/frames.yaml``."""

from __future__ import annotations

from dataclasses import dataclass

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.model.camera import Camera

FACE_COUNTS = ("normal_window", "normal_reach", "min_pixels", "steps", "block")
FACE_NUMBERS = (
    "normal_share", "level", "cosine", "outlier", "nearest", "corner", "depth_error",
    "narrow_error", "yaw_error",
)  # fmt: skip
CONTOUR_COUNTS = ("shadow", "min_pixels")
CONTOUR_NUMBERS = (
    "blur", "cosine", "near_face", "step", "window", "correlated", "pixel_error",
)  # fmt: skip
NUMBERS = ("visible", "match", "tight", "wrong", "confidence", "unseen")


@dataclass(frozen=True)
class FaceSettings:
    """How planes are fitted to faces; see the comments in the file."""

    normal_window: int
    normal_reach: int
    min_pixels: int
    steps: int
    block: int
    normal_share: float
    level: float
    cosine: float
    outlier: float
    nearest: float
    corner: float
    depth_error: float
    narrow_error: float
    yaw_error: float


@dataclass(frozen=True)
class ContourSettings:
    """How ends of faces are found in the contour; see the comments in the file."""

    shadow: int
    min_pixels: int
    blur: float
    cosine: float
    near_face: float
    step: float
    window: float
    correlated: float
    pixel_error: float


@dataclass(frozen=True)
class ExperimentSettings:
    """The experiment.

    Attributes
    ----------
    camera
        Of the frames; its pose does not matter.
    visible
        Objects of which a smaller share is in view do not count.
    match
        Least intersection over union of an object with the reference that it is found for.
    tight, wrong
        A side of a smaller stated deviation and a larger error is a gross mistake, metres.
    confidence
        Of the ellipsoid whose coverage is counted.
    unseen
        Standard deviation of a reference's side that is not in view, metres.
    """

    camera: Camera
    visible: float
    match: float
    tight: float
    wrong: float
    confidence: float
    unseen: float
    faces: FaceSettings
    contour: ContourSettings

    @classmethod
    def load(cls) -> ExperimentSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        section = Section.load(resources.share_directory() / "config/frames.yaml")
        section.allow(("camera", *NUMBERS, "faces", "contour"))
        return cls(
            camera=Camera.load(section.text("camera")),
            faces=_faces(section.section("faces")),
            contour=_contour(section.section("contour")),
            **{name: section.number(name, 0.0, 1.0) for name in NUMBERS},
        )


def _faces(section: Section) -> FaceSettings:
    section.allow((*FACE_COUNTS, *FACE_NUMBERS))
    counts = {name: section.whole_number(name, 1, 1000) for name in FACE_COUNTS}
    numbers = {name: section.number(name, 0.0, 100.0) for name in FACE_NUMBERS}
    return FaceSettings(**counts, **numbers)  # type: ignore[arg-type]


def _contour(section: Section) -> ContourSettings:
    section.allow((*CONTOUR_COUNTS, *CONTOUR_NUMBERS))
    counts = {name: section.whole_number(name, 1, 1000) for name in CONTOUR_COUNTS}
    numbers = {name: section.number(name, 0.0, 100.0) for name in CONTOUR_NUMBERS}
    return ContourSettings(**counts, **numbers)  # type: ignore[arg-type]
