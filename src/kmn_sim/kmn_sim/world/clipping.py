"""How near to a camera the world can be: the nearer the clipping plane, the coarser its depth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.camera import Camera


def nearest_depth(camera: Camera, boxes: NDArray[np.float64]) -> float:
    """Return a depth before which the camera sees nothing of some boxes, metres.

    Parameters
    ----------
    boxes
        (N, 2, 3) lower and upper corner of axis-parallel boxes in the world frame, metres.
    """
    u = (np.array([-0.5, camera.width - 0.5]) - camera.cx) / camera.fx
    v = (np.array([-0.5, camera.height - 0.5]) - camera.cy) / camera.fy
    choice = np.stack(np.meshgrid(*[[0, 1]] * 3), axis=-1).reshape(8, 3)
    corners = boxes[:, choice, [0, 1, 2]]
    x, y, z = np.moveaxis((corners - camera.pose[:3, 3]) @ camera.pose[:3, :3], -1, 0)
    outside = np.stack((x < u[0] * z, x > u[1] * z, y < v[0] * z, y > v[1] * z, z < 0.0))
    seen = ~outside.all(axis=-1).any(axis=0)
    # What lies below a level is not seen nearer than where the image's corners look onto it.
    rays = np.stack([np.repeat(u, 2), np.tile(v, 2), np.ones(4)], axis=-1) @ camera.pose[2, :3]
    below = camera.pose[2, 3] - boxes[:, 1, 2]
    onto = np.where(below > 0.0, below / max(-rays.min(), 1e-9), 0.0)
    nearest = np.maximum(z.min(axis=-1), onto)[seen]
    return float(max(nearest.min(initial=camera.far / 2.0), camera.near))
