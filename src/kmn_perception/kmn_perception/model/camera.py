"""Pinhole cameras: intrinsics, and the pose of the optical frame (REP-103, REP-105)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera without distortion.

    Attributes
    ----------
    width, height
        Size of the image in pixels.
    fx, fy, cx, cy
        Focal lengths and principal point in pixels; pixel centres lie at whole numbers.
    pose
        (4, 4) optical frame (x right, y down, z forward) in the world frame, metres.
    near, far
        Range of depth that it measures, metres.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    pose: NDArray[np.float64]
    near: float = 0.1
    far: float = 50.0

    @classmethod
    def load(cls, name_or_path: str | Path, folder: Path | None = None) -> Camera:
        """Read ``config/cameras/NAME.yaml`` or the user's own file.

        Parameters
        ----------
        folder
            From where a relative path leads; ``None``: from the working directory.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ConfigurationError
            If a key is missing, unknown or of a wrong value.
        """
        section = Section.load(resources.find("config/cameras", name_or_path, folder=folder))
        keys = ("name", "width", "height", "fx", "fy", "cx", "cy", "near", "far", "pose")
        section.allow(keys, optional=("colour_distortion",))
        pose = section.section("pose")
        pose.allow(("position", "look_at"))
        near = section.number("near", 0.0, 1e3)
        position, target = pose.numbers("position", 3), pose.numbers("look_at", 3)
        with np.errstate(all="ignore"):
            placed = look_at(position, target)
        if not np.isfinite(placed).all():
            raise pose.error(
                "'look_at' must not be at 'position' nor straight above or below it, found "
                f"{target} and {position}"
            )
        return cls(
            width=section.whole_number("width", 1, 16384),
            height=section.whole_number("height", 1, 16384),
            fx=section.number("fx", 1e-3, 1e6),
            fy=section.number("fy", 1e-3, 1e6),
            cx=section.number("cx"),
            cy=section.number("cy"),
            pose=placed,
            near=near,
            far=section.number("far", near, 1e4),
        )

    def resized(self, width: int, height: int) -> Camera:
        """Return the camera that sees the same view with other numbers of pixels."""
        sx, sy = width / self.width, height / self.height
        return replace(
            self,
            width=width,
            height=height,
            fx=self.fx * sx,
            fy=self.fy * sy,
            cx=(self.cx + 0.5) * sx - 0.5,
            cy=(self.cy + 0.5) * sy - 0.5,
        )

    @property
    def world_to_camera(self) -> NDArray[np.float64]:
        """(4, 4) transformation from the world frame to the optical frame."""
        return np.linalg.inv(self.pose).astype(np.float64)

    @property
    def position(self) -> NDArray[np.float64]:
        """(3,) where it stands in the world frame, metres."""
        return self.pose[:3, 3]

    @property
    def matrix(self) -> NDArray[np.float64]:
        """(3, 3) camera matrix K, which maps the optical frame to pixels z (u, v, 1)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def projection(self) -> NDArray[np.float64]:
        """(3, 4) map from the world frame to homogeneous pixels z (u, v, 1)."""
        return self.matrix @ self.world_to_camera[:3]

    def project(self, points: ArrayLike) -> NDArray[np.float64]:
        """Project points onto the image.

        Parameters
        ----------
        points
            (..., 3) world frame, metres.

        Returns
        -------
        pixels
            (..., 3) columns u, rows v, and depths z along the optical axis in metres; where z is
            not positive the point lies behind the camera, and u and v mean nothing.
        """
        points = np.asarray(points, dtype=np.float64)
        matrix = self.projection
        pixels = points @ matrix[:, :3].T + matrix[:, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels[..., :2] /= pixels[..., 2:]
        return pixels

    def rays(self, u: ArrayLike, v: ArrayLike) -> NDArray[np.float64]:
        """Return the directions (..., 3) through pixels (...), of depth 1, in the optical frame."""
        x = (np.asarray(u, dtype=np.float64) - self.cx) / self.fx
        y = (np.asarray(v, dtype=np.float64) - self.cy) / self.fy
        return np.stack([x, y, np.ones_like(x)], axis=-1)


def look_at(position: ArrayLike, target: ArrayLike) -> NDArray[np.float64]:
    """Return the pose (4, 4) of an upright optical frame at ``position`` that faces ``target``."""
    position = np.asarray(position, dtype=np.float64)
    forward = np.asarray(target, dtype=np.float64) - position
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right = right / np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = right, np.cross(forward, right), forward
    pose[:3, 3] = position
    return pose
