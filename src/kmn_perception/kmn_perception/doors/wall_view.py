"""The metric view of a wall: what a camera that looks at it squarely would see."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.doors.search_settings import WallViewSettings
from kmn_perception.model.camera import Camera


@dataclass(frozen=True, eq=False)
class WallFrame:
    """A vertical plane with its axes in the optical frame.

    Attributes
    ----------
    normal, right, up
        (3,) unit vectors: towards the camera, to the right as seen, and up.
    distance
        Of the camera from the plane, metres.
    height
        Of the camera above the floor, metres.
    """

    normal: NDArray[np.float64]
    right: NDArray[np.float64]
    up: NDArray[np.float64]
    distance: float
    height: float

    @classmethod
    def of(cls, vector: NDArray[np.float64], up: NDArray[np.float64], height: float) -> WallFrame:
        """Return the frame of the vertical plane nearest to a plane's vector, see `Plane`."""
        level = vector - (vector @ up) * up
        length = float(np.linalg.norm(level))
        normal = -level / length
        right = np.asarray(np.cross(up, normal), dtype=np.float64)
        return cls(normal, right, up, 1.0 / length, height)

    @property
    def vector(self) -> NDArray[np.float64]:
        """(3,) normal over distance, see `Plane.vector`."""
        return -self.normal / self.distance

    def points(self, s: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the points (..., 3) at s metres to the right and z metres above the floor."""
        foot = -self.distance * self.normal - self.height * self.up
        return foot + s[..., None] * self.right + z[..., None] * self.up


@dataclass(frozen=True, eq=False)
class WallView:
    """A wall, seen squarely; rows go down.

    Attributes
    ----------
    frame
        The plane that is seen.
    s, z
        (columns,) metres to the right of the camera, and (rows,) metres above the floor.
    grey
        (rows, columns) logarithm of grey; None without an image.
    offset
        (rows, columns) inverse depth less that of the plane, 1/m; positive before it, NaN where
        nothing was measured.
    inside
        (rows, columns) what is in the image.
    footprint
        (columns,) width of an image's pixel on the wall, metres.
    """

    frame: WallFrame
    s: NDArray[np.float64]
    z: NDArray[np.float64]
    grey: NDArray[np.float32] | None
    offset: NDArray[np.float32]
    inside: NDArray[np.bool_]
    footprint: NDArray[np.float64]


DARKEST = 0.03  # grey value that is added before the logarithm


def view_wall(
    frame: WallFrame,
    depth: NDArray[np.float32],
    grey: NDArray[np.float32] | None,
    camera: Camera,
    settings: WallViewSettings,
) -> WallView | None:
    """Return the metric view of a wall, or None if little of it is in the image.

    Parameters
    ----------
    depth, grey
        (height, width) metres, 0 for none; and 0 to 1.
    """
    s = _columns_in_view(frame, camera, settings)
    if len(s) * settings.pixel < settings.min_width:
        return None
    low, high = settings.heights
    z = np.arange(high, low, -settings.pixel, dtype=np.float64)
    return resample(frame, s, z, depth, grey, camera)


def resample(
    frame: WallFrame,
    s: NDArray[np.float64],
    z: NDArray[np.float64],
    depth: NDArray[np.float32],
    grey: NDArray[np.float32] | None,
    camera: Camera,
) -> WallView:
    """Return what is seen of a plane at columns s and rows z, metres; see `view_wall`."""
    u, v, inside, offset = _look(depth, *_scaled_pixels(frame, s, z, camera), camera.near)
    shade: NDArray[np.float32] | None = None
    if grey is not None:
        seen_grey = cv2.remap(grey, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        shade = np.log(np.maximum(seen_grey, 0.0) + np.float32(DARKEST)).astype(np.float32)
    # Along a level line: the change of direction with s, in pixels.
    footprint = (frame.distance**2 + s**2) / frame.distance / camera.fx
    return WallView(frame, s, z, shade, offset, inside, footprint)


def _columns_in_view(
    frame: WallFrame, camera: Camera, settings: WallViewSettings
) -> NDArray[np.float64]:
    """Return the columns (metres) of which something is in the image."""
    s = np.arange(-settings.reach, settings.reach, settings.pixel, dtype=np.float64)
    probes = np.linspace(*settings.heights, 13, dtype=np.float64)
    along, over = _scaled_pixels(frame, s, probes, camera)
    u, v, depth = over[:, :, None] + along[:, None, :]
    inside = (depth > camera.near) & (u > 0.0) & (u < (camera.width - 1.0) * depth)
    inside &= (v > 0.0) & (v < (camera.height - 1.0) * depth)
    visible = np.flatnonzero(inside.any(axis=0) & (np.hypot(s, frame.distance) < settings.reach))
    return s[visible[0] : visible[-1] + 1] if len(visible) else s[:0]


def _scaled_pixels(
    frame: WallFrame, s: NDArray[np.float64], z: NDArray[np.float64], camera: Camera
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return column times depth, row times depth, and depth of a plane's points.

    They are affine in the columns s and rows z, metres: the sums of what belongs to a column,
    (3, columns), and to a row, (3, rows).
    """
    origin = camera.matrix @ frame.points(s[:1], z[:1])[0]
    step_s, step_z = camera.matrix @ frame.right, camera.matrix @ frame.up
    along = origin[:, None] + step_s[:, None] * (s - s[0])
    over = step_z[:, None] * (z - z[0])
    return along.astype(np.float32), over.astype(np.float32)


@njit(cache=True)
def _look(
    depth: NDArray[np.float32], along: NDArray[np.float32], over: NDArray[np.float32], near: float
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], NDArray[np.float32]]:
    """Return where a plane's points are seen in the image, and what is measured there.

    Parameters
    ----------
    along, over
        See `_scaled_pixels`.

    Returns
    -------
    u, v
        (rows, columns) pixels.
    inside, offset
        See `WallView`.
    """
    shape = over.shape[1], along.shape[1]
    u, v = np.empty(shape, np.float32), np.empty(shape, np.float32)
    inside, offset = np.empty(shape, np.bool_), np.empty(shape, np.float32)
    last_row, last_column = depth.shape[0] - np.float32(1.0), depth.shape[1] - np.float32(1.0)
    for i in range(shape[0]):
        for j in range(shape[1]):  # in vectors; what follows is not
            w = over[2, i] + along[2, j]
            w = w if w > np.float32(1e-3) else np.float32(1e-3)
            offset[i, j] = np.float32(1.0) / w
            u[i, j] = (over[0, i] + along[0, j]) * offset[i, j]
            v[i, j] = (over[1, i] + along[1, j]) * offset[i, j]
        for j in range(shape[1]):
            x, y, measured = u[i, j], v[i, j], np.float32(0.0)
            inside[i, j] = 0.0 < x < last_column and 0.0 < y < last_row
            inside[i, j] &= over[2, i] + along[2, j] > near
            if inside[i, j]:
                measured = depth[int(np.rint(y)), int(np.rint(x))]
            offset[i, j] = (
                np.float32(1.0) / measured - offset[i, j] if measured > 0.0 else np.float32(np.nan)
            )
    return u, v, inside, offset
