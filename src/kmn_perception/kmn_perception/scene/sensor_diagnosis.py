"""Likely wrong descriptions of a depth camera, recognised from what it measures."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import (
    Count,
    Fraction,
    NonNegative,
    Positive,
    load_settings,
)
from kmn_perception.model.camera import Camera
from kmn_perception.scene.intrinsics import camera_of_points
from kmn_perception.scene.settings import IntrinsicsSettings

MM_PER_M = 1000.0
COLOUR_FRAMES = ("color", "colour", "rgb")  # parts of the names of colour cameras' frames

# Axes that are found where an optical frame (x right, y down, z forward) is expected, and how they
# become one.
OTHER_AXES = {
    "body_frame": (
        [[0, -1, 0], [0, 0, -1], [1, 0, 0]],
        "the points are in a body frame (x forward, y left, z up)",
    ),
    "flipped_z": (
        [[1, 0, 0], [0, 1, 0], [0, 0, -1]],
        "z is flipped: the points lie behind the camera",
    ),
    "graphics_frame": (
        [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
        "z is flipped: the points are in a graphics frame (x right, y up, z backward)",
    ),
}
EXPECTED_AXES = "expected an optical frame (x right, y down, z forward; REP-103)"


class Diagnosis(NamedTuple):
    """A likely mistake: a short key, and what was found and what was expected."""

    key: str
    text: str


class Description(NamedTuple):
    """What is said about a sensor.

    Attributes
    ----------
    camera
        Its intrinsics, if they are known.
    frame, camera_frame
        Frame ids of what it measured and of its description; empty if not known.
    """

    camera: Camera | None = None
    frame: str = ""
    camera_frame: str = ""


@dataclass(frozen=True)
class DiagnosisSettings:
    """Limits of what is plausible; see the comments in ``config/sensor_diagnosis.yaml``."""

    nearest: Positive
    farthest: Positive
    off_centre: Fraction
    focal_length: Fraction
    single_holes: Fraction
    hole_step: Fraction
    baseline: NonNegative
    ray_error: NonNegative
    hole_reach: Count
    pixels: Count

    @classmethod
    def load(cls) -> DiagnosisSettings:
        """Read the settings; raise ``ConfigurationError`` with the key that is wrong."""
        return load_settings(cls, resources.find("config", "sensor_diagnosis"))


def diagnose(
    points: NDArray[np.float32],
    described: Description,
    settings: DiagnosisSettings,
    intrinsics: IntrinsicsSettings,
) -> list[Diagnosis]:
    """Return what is likely to be wrong with the description of a sensor.

    Parameters
    ----------
    points
        (height, width, 3) organised or (N, 3) unorganised, in what is said to be an optical frame
        and metres; NaN for none. Fewer mistakes can be recognised from unorganised points.
    """
    return list(_diagnose(points, described, settings, intrinsics))


def _diagnose(
    points: NDArray[np.float32],
    described: Description,
    settings: DiagnosisSettings,
    intrinsics: IntrinsicsSettings,
) -> Iterator[Diagnosis]:
    flat = points.reshape(-1, 3)
    drawn = flat[:: max(1, len(flat) // settings.pixels)]
    drawn = drawn[np.isfinite(drawn).all(axis=1)]
    if len(drawn) < intrinsics.min_points:
        return
    yield from _unit(drawn, settings)
    other_axes = list(_axes(points, drawn, intrinsics))
    yield from other_axes
    if points.ndim == 3 and not other_axes:
        found = camera_of_points(points, np.eye(4), intrinsics)
        if found is None:
            yield from _other_origin(points, settings, intrinsics.min_points)
        else:
            yield from _intrinsics(found, described, settings)
        yield from _resampled(points[..., 2], described, settings)


def _unit(points: NDArray[np.float32], settings: DiagnosisSettings) -> Iterator[Diagnosis]:
    """Tell whether points (N, 3) are too far or too near for metres."""
    distance = float(np.median(np.linalg.norm(points, axis=1)))
    if distance > settings.farthest:
        yield Diagnosis(
            "millimetres_as_metres",
            f"the median distance is {distance:.0f} m: these are millimetres taken for metres; "
            f"divide by {MM_PER_M:.0f}, or publish a depth image as '16UC1'",
        )
    if distance < settings.nearest:
        yield Diagnosis(
            "metres_as_millimetres",
            f"the median distance is {1e3 * distance:.1f} mm: these are metres taken for "
            f"millimetres; multiply by {MM_PER_M:.0f}, or publish a depth image as '32FC1'",
        )


def _axes(
    points: NDArray[np.float32], drawn: NDArray[np.float32], intrinsics: IntrinsicsSettings
) -> Iterator[Diagnosis]:
    """Tell whether the points are in other axes than those of an optical frame.

    Rows and columns of an organised cloud show its axes. Of other clouds it is only known that all
    lies before the camera.
    """
    if (drawn[:, 2] > 0.0).all():
        return
    for key, (rows, text) in OTHER_AXES.items():
        to_optical = np.eye(4)
        to_optical[:3, :3] = rows
        if points.ndim == 3:
            fits = camera_of_points(points, to_optical, intrinsics) is not None
        else:
            fits = bool((drawn @ to_optical[2, :3] > 0.0).all())
        if fits:
            yield Diagnosis(key, f"{text}; {EXPECTED_AXES}")
            return


def _intrinsics(
    found: Camera, described: Description, settings: DiagnosisSettings
) -> Iterator[Diagnosis]:
    """Tell whether the camera that the points show is of another resolution than their image."""
    off = [
        abs(found.cx - (found.width - 1) / 2.0) / found.width,
        abs(found.cy - (found.height - 1) / 2.0) / found.height,
    ]
    if max(off) > settings.off_centre:
        yield Diagnosis(
            "other_resolution",
            f"the principal point ({found.cx:.1f}, {found.cy:.1f}) is far from the middle of an "
            f"image of {found.width} x {found.height} pixels, and in that of one of "
            f"{2.0 * found.cx + 1.0:.0f} x {2.0 * found.cy + 1.0:.0f}: the intrinsics are of "
            "another resolution",
        )
        return
    if described.camera is None:
        return
    given = described.camera.resized(found.width, found.height)
    if abs(given.fx / found.fx - 1.0) > settings.focal_length:
        yield Diagnosis(
            "other_intrinsics",
            f"the points were made with a focal length of {found.fx:.1f} px, camera_info has "
            f"{given.fx:.1f} px for this image: one of them is of another camera",
        )


def _resampled(
    depth: NDArray[np.float32], described: Description, settings: DiagnosisSettings
) -> Iterator[Diagnosis]:
    """Tell whether depth (height, width) was aligned to another camera than the described one.

    Where an image is mapped to another camera's pixels, some of them get nothing, one by one.
    """
    frames = (described.frame, described.camera_frame)
    shares = [_single_holes(image, settings) for image in (depth, depth.T)]
    resampled = min(shares) > settings.single_holes
    differ = all(frames) and frames[0] != frames[1]
    colour = [any(part in frame.lower() for part in COLOUR_FRAMES) for frame in frames]
    if differ or (resampled and not colour[1]):
        seen = f"{100.0 * sum(shares):.1f} % single missing pixels" if resampled else "frame ids"
        named = f"measured in '{frames[0]}', described in '{frames[1]}'" if any(frames) else ""
        yield Diagnosis(
            "aligned_to_other_camera",
            f"the depth is aligned to another camera ({seen}{', ' if named else ''}{named}): "
            "camera_info and pose must be of the camera that it was aligned to",
        )


def _single_holes(depth: NDArray[np.float32], settings: DiagnosisSettings) -> float:
    """Return the share of single missing pixels within surfaces, along the rows."""
    measured, reach = np.isfinite(depth), settings.hole_reach
    width = depth.shape[1] - 2 * reach
    if width <= 0 or not measured.any():
        return 0.0

    holes = ~measured[:, reach : reach + width]
    for pixels in range(1, reach + 1):
        for start in (reach - pixels, reach + pixels):
            holes &= measured[:, start : start + width]
    rows, columns = np.nonzero(holes)
    left, right = depth[rows, columns + reach - 1], depth[rows, columns + reach + 1]
    single = np.abs(left - right) < settings.hole_step * np.minimum(left, right)
    return float(single.sum() / measured.sum())


def _other_origin(
    points: NDArray[np.float32], settings: DiagnosisSettings, min_points: int
) -> Iterator[Diagnosis]:
    """Tell whether the rays of an organised cloud start beside the origin of its frame.

    With u z = f (x + t) + c z the pixels are linear in x, y, z and 1, also for small turns.
    """
    step = max(1, int(np.sqrt(points.shape[0] * points.shape[1] / settings.pixels)))
    drawn = points[::step, ::step].astype(np.float64)
    v, u = np.mgrid[: points.shape[0] : step, : points.shape[1] : step]
    measured = drawn[..., 2] > 0.0
    if measured.sum() < min_points:
        return
    p, z = drawn[measured], drawn[measured][:, 2:]
    matrix = np.column_stack([p, np.ones(len(p))]) / z
    pixels = np.column_stack([u[measured], v[measured]])
    solution = np.linalg.lstsq(matrix, pixels, rcond=None)[0]
    if np.abs(matrix @ solution - pixels).max() > settings.ray_error:
        return
    offset = np.hypot(solution[3, 0] / solution[0, 0], solution[3, 1] / solution[1, 1])
    if offset > settings.baseline:
        yield Diagnosis(
            "other_origin",
            f"the rays of the cloud start {1e3 * offset:.0f} mm beside the origin of its frame: it "
            "was measured by another camera than the one in whose frame it is given",
        )
