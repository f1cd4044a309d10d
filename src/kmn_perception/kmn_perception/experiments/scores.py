"""What was found in a frame, compared with its references."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.coverage import is_covered
from kmn_perception.experiments.reference import Reference, References
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.experiments.upright_box import (
    BoxErrors,
    UprightBox,
    box_of_cube,
    errors,
    intersection_over_union,
)
from kmn_perception.model.kinematic_model import KinematicModel


class Detection(NamedTuple):
    """A box that was found.

    Attributes
    ----------
    box
        In the world of whoever found it.
    values, covariance
        (n,) and (n, n) morphing parameters; None of a method that states no uncertainty.
    """

    box: UprightBox
    values: NDArray[np.float64] | None = None
    covariance: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False)
class Score:
    """How a labelled object was estimated.

    Attributes
    ----------
    frame, reference
        Which object.
    detection
        Number of the detection that found it; None for none.
    errors
        Of the box, along the axes of its reference; NaN if it was not found.
    overlap
        Intersection over union; 0 if it was not found.
    covered
        Whether the reference lies in the stated ellipsoid; None where none is stated.
    gross
        Whether a side is stated with a small deviation, and is wrong by far.
    """

    frame: str
    reference: Reference
    detection: int | None
    errors: BoxErrors
    overlap: float
    covered: bool | None
    gross: bool


NOT_FOUND = BoxErrors(np.nan, np.full(3, np.nan), np.nan)


def score(
    frame: str,
    references: References,
    pose: NDArray[np.float64],
    detections: Sequence[Detection],
    model: KinematicModel,
    settings: ExperimentSettings,
) -> list[Score]:
    """Match detections with references, one to one, and compare them.

    Pairs are matched by their intersection over union, the largest first.

    Parameters
    ----------
    pose
        (4, 4) of the optical frame in the world of the detections.
    """
    world = [reference.seen_from(references.camera.pose, pose) for reference in references.boxes]
    pairs = _match([r.box for r in world], [d.box for d in detections], settings.match)
    return [
        _score(frame, reference, pairs.get(number), detections, model, settings)
        for number, reference in enumerate(world)
    ]


def _match(
    references: Sequence[UprightBox], found: Sequence[UprightBox], min_overlap: float
) -> dict[int, int]:
    """Return the detection that belongs to each reference that was found."""
    overlaps = sorted(
        (
            (intersection_over_union(box, reference), i, j)
            for i, reference in enumerate(references)
            for j, box in enumerate(found)
        ),
        reverse=True,
    )
    pairs: dict[int, int] = {}
    for overlap, i, j in overlaps:
        if overlap >= min_overlap and i not in pairs and j not in pairs.values():
            pairs[i] = j
    return pairs


def _score(
    frame: str,
    reference: Reference,
    number: int | None,
    detections: Sequence[Detection],
    model: KinematicModel,
    settings: ExperimentSettings,
) -> Score:
    if number is None:
        return Score(frame, reference, None, NOT_FOUND, 0.0, None, False)
    detection = detections[number]
    off = errors(detection.box, reference.box)
    overlap = intersection_over_union(detection.box, reference.box)
    covered, gross = None, False
    if detection.values is not None and detection.covariance is not None:
        same = reference.as_near(detection.box)
        truth, uncertainty = _parameters(same, model, settings)
        covariance = detection.covariance + uncertainty
        covered = is_covered(model, detection.values, covariance, truth, settings.confidence)
        gross = _is_gross(detection, same, model, settings)
    return Score(frame, reference, number, off, overlap, covered, gross)


def _parameters(
    reference: Reference, model: KinematicModel, settings: ExperimentSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a reference as morphing parameters (n,), with their covariance (n, n)."""
    mean, covariance = reference.parameters(settings.unseen)

    def values(parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, yaw, *size = parameters
        box = UprightBox(np.array([x, y, size[2] / 2.0]), np.array(size), yaw)
        return _morphing_parameters(box, model)

    slope = np.column_stack(
        [(values(mean + step) - values(mean - step)) / 2e-4 for step in 1e-4 * np.eye(len(mean))]
    )
    return values(mean), slope @ covariance @ slope.T


def _morphing_parameters(box: UprightBox, model: KinematicModel) -> NDArray[np.float64]:
    """Return theta of the transformation that maps a model of one box onto this box."""
    return model.transformation.read_back(box.unit_cube @ np.linalg.inv(model.prototype_cubes[0]))


def _is_gross(
    detection: Detection, reference: Reference, model: KinematicModel, settings: ExperimentSettings
) -> bool:
    """Tell whether a size that is in view is stated as known well, and is wrong by far."""
    assert detection.values is not None and detection.covariance is not None
    deviations = np.sqrt(np.diag(detection.covariance))

    def sizes(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return box_of_cube(model.unit_cubes(*model.split(values))[0]).size

    stated = np.array(
        [
            np.linalg.norm([sizes(detection.values + step)[i] - detection.box.size[i]
                            for step in np.diag(deviations)])
            for i in range(3)
        ]
    )  # fmt: skip
    wrong = np.abs(detection.box.size - reference.box.size) > settings.wrong
    return bool((wrong & (stated < settings.tight) & reference.sizes_in_view).any())
