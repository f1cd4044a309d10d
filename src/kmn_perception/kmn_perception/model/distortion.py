"""Lens distortion: raw depth and grey images become those of a pinhole camera."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera

COEFFICIENTS = {  # of the models of sensor_msgs/CameraInfo, and how many each may have
    "plumb_bob": (4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
}


@dataclass(frozen=True, eq=False)
class Distortion:
    """How a raw image deviates from that of a pinhole camera.

    Attributes
    ----------
    model
        ``plumb_bob``, ``rational_polynomial`` or ``equidistant``.
    coefficients
        As OpenCV orders them.
    camera
        The raw image's camera matrix and size.

    Raises
    ------
    ValueError
        If the model is not known, or has another number of coefficients.
    """

    model: str
    coefficients: tuple[float, ...]
    camera: Camera

    def __post_init__(self) -> None:
        counts = COEFFICIENTS.get(self.model)
        if counts is None:
            known = ", ".join(COEFFICIENTS)
            raise ValueError(f"distortion model '{self.model}' is not known, expected {known}")
        if len(self.coefficients) not in counts or not np.isfinite(self.coefficients).all():
            raise ValueError(
                f"distortion model '{self.model}' has coefficients {list(self.coefficients)}, "
                f"expected {' or '.join(map(str, counts))} finite numbers"
            )


def rectify(
    depth: NDArray[np.float32], distortion: Distortion, camera: Camera
) -> NDArray[np.float32]:
    """Return the depth image of a pinhole camera from a raw one.

    Every pixel takes the depth of the raw pixel that looks along (nearly) the same ray: depths are
    not averaged, for in between there may be an edge.

    Parameters
    ----------
    depth
        (height, width) of the raw image, metres, NaN for none.
    camera
        The pinhole camera.

    Returns
    -------
    depth
        (height, width) of the camera's image; NaN also where the raw image does not reach.
    """
    rows, columns, inside = _raw_pixels(*_key(distortion, camera))
    rectified = depth[rows, columns]
    rectified[~inside] = np.nan
    return rectified


def resample(
    grey: NDArray[np.float32], distortion: Distortion, camera: Camera
) -> NDArray[np.float32]:
    """Return the grey image of a pinhole camera from a raw one, of the same optical centre.

    Parameters
    ----------
    grey
        (height, width) of the raw image.
    camera
        The pinhole camera.

    Returns
    -------
    grey
        (height, width) of the camera's image; where the raw image does not reach, its nearest
        pixels go on, so that its border is no edge.
    """
    raw = distortion.camera
    u, v = _raw_places(*_key(distortion, camera))
    finer = min(raw.fx / camera.fx, raw.fy / camera.fy)
    if finer > 1.0:  # several raw pixels in one
        width = 0.5 * float(np.sqrt(finer**2 - 1.0)) + 1e-3
        grey = cv2.GaussianBlur(grey, (0, 0), width).astype(np.float32, copy=False)
    seen = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return seen.astype(np.float32, copy=False)


_Intrinsics = tuple[float, float, float, float, int, int]
_Key = tuple[str, tuple[float, ...], _Intrinsics, _Intrinsics]


def _key(distortion: Distortion, camera: Camera) -> _Key:
    """Return what the places of pixels depend on."""
    raw, target = ((c.fx, c.fy, c.cx, c.cy, c.width, c.height) for c in (distortion.camera, camera))
    return distortion.model, distortion.coefficients, raw, target


@lru_cache(maxsize=4)
def _raw_places(
    model: str, coefficients: tuple[float, ...], raw: _Intrinsics, target: _Intrinsics
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return column and row in the raw image for each pixel of the target's."""
    before, after = (
        np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
        for fx, fy, cx, cy, *_ in (raw, target)
    )
    is_fisheye = model == "equidistant"
    rectify_map = (cv2.fisheye if is_fisheye else cv2).initUndistortRectifyMap
    return rectify_map(before, np.array(coefficients), np.eye(3), after, target[4:], cv2.CV_32FC1)


@lru_cache(maxsize=4)
def _raw_pixels(
    model: str, coefficients: tuple[float, ...], raw: _Intrinsics, target: _Intrinsics
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.bool_]]:
    """Return row and column of the raw pixel for each of the target's, and whether it is inside."""
    u, v = _raw_places(model, coefficients, raw, target)
    inside = (u >= -0.5) & (u < raw[4] - 0.5) & (v >= -0.5) & (v < raw[5] - 0.5)  # not NaN
    rows, columns = (np.rint(np.where(inside, place, 0.0)).astype(np.intp) for place in (v, u))
    return rows, columns, inside
