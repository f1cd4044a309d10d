"""Pictures of estimated models over the depth image that they were estimated from."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import combinations, product
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.configuration.output import replacing
from kmn_perception.model.camera import Camera
from kmn_perception.model.parts import NO_AXIS
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.model.transformation import transform_points

BACKGROUND, SCENE, OBJECT = "#20242c", "#b9bec8", "#5b9bf0"
ACCEPTED, REFUSED, REFERENCE = "#2fd66b", "#f0603c", "#f5c542"
SMOOTHING = 9  # pixels; evens out the sensor's depth steps before normals are taken
DEPTH_STEP = 0.03  # metres; larger ones are edges and stay sharp
AMBIENT = 0.25  # brightness of a surface seen edge-on
EDGE_PIECES = 128  # an edge of a body is hidden or visible piece by piece
SURFACE = 1e-3  # part of the line of sight within which a point counts as on the surface
HIDDEN_WIDTH = 0.35  # of the width of visible lines
COLUMNS = 6  # of the contact sheet

CUBE_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)), dtype=np.float32)
CUBE_EDGES = [(a, b) for a, b in combinations(CUBE_CORNERS, 2) if np.abs(a - b).sum() == 1.0]


class Bodies(NamedTuple):
    """Bodies as maps (B, 4, 4) of the unit cube, and the axes (B,) of those that are cylinders."""

    cubes: NDArray[np.float64]
    axes: NDArray[np.int64]

    @classmethod
    def of(cls, cubes: NDArray[np.float64], axes: NDArray[np.int64] | None = None) -> Bodies:
        """Return bodies, which are cuboids without axes."""
        return cls(cubes, np.full(len(cubes), NO_AXIS) if axes is None else axes)

    @classmethod
    def together(cls, all_bodies: Iterable[Bodies]) -> Bodies:
        """Return several of them as one."""
        cubes, axes = zip(cls.of(np.empty((0, 4, 4))), *all_bodies, strict=True)
        return cls(np.concatenate(cubes), np.concatenate(axes))


@dataclass(frozen=True, eq=False)
class ShownObject:
    """An object of a picture.

    Attributes
    ----------
    points
        (N, 3) world frame, metres.
    unit_cubes
        (B, 4, 4) bodies of the predicted model; B = 0 if there is no prediction.
    accepted
        Whether the prediction is valid: drawn green, else red.
    axes
        (B,) of those that are cylinders, as ``KinematicModel.cylinder_axes``; without them, all
        are cuboids.
    """

    points: NDArray[np.float32]
    unit_cubes: NDArray[np.float64]
    accepted: bool
    axes: NDArray[np.int64] | None = None

    @property
    def bodies(self) -> Bodies:
        """The bodies of the predicted model."""
        return Bodies.of(self.unit_cubes, self.axes)


@dataclass(frozen=True, eq=False)
class Overlay:
    """What one picture shows.

    Attributes
    ----------
    depth
        (height, width) metres along the optical axis, NaN where nothing was measured.
    camera
        The camera with its pose in the world.
    objects
        With their predictions.
    title
        What is written above.
    references
        (R, 4, 4) unit cubes of what the predictions are compared with, drawn thin and yellow.
    """

    depth: NDArray[np.float32]
    camera: Camera
    objects: Sequence[ShownObject]
    title: str
    references: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 4, 4)))


def save_picture(path: Path, overlay: Overlay) -> None:
    """Write one overlay as a picture."""
    figure = Figure(figsize=(8, 6.4), dpi=120, layout="constrained")
    _draw(figure.subplots(), overlay, line_width=2.5, font_size=13)
    with replacing(path) as new:
        figure.savefig(new)


def save_pictures(overlays: Iterable[Overlay], count: int, folder: Path) -> Path:
    """Write a picture of each of ``count`` frames, and one of all; return the latter's path."""
    drawn = []
    for number, overlay in enumerate(tqdm(overlays, "drawing", count, unit="frame")):
        save_picture(folder / f"frame_{number:02d}.png", overlay)
        drawn.append(overlay)
    save_contact_sheet(folder / "all_frames.png", drawn)
    return folder / "all_frames.png"


def save_contact_sheet(path: Path, overlays: Sequence[Overlay]) -> None:
    """Write all overlays side by side as one picture."""
    rows = math.ceil(len(overlays) / COLUMNS)
    figure = Figure(figsize=(3 * COLUMNS, 2.9 * rows), dpi=100, layout="constrained")
    for axes in figure.subplots(rows, COLUMNS, squeeze=False).flat:
        axes.set_axis_off()
    for axes, overlay in zip(figure.axes, overlays, strict=False):
        _draw(axes, overlay, line_width=1.5, font_size=9)
    with replacing(path) as new:
        figure.savefig(new)


def _draw(axes: Axes, overlay: Overlay, line_width: float, font_size: float) -> None:
    axes.imshow(_shaded(overlay))
    everything = Bodies.together(shown.bodies for shown in overlay.objects)
    for shown in overlay.objects:
        colour = ACCEPTED if shown.accepted else REFUSED
        visible, hidden = wireframe(shown.bodies, overlay.camera, everything)
        _add_lines(axes, hidden, colour, HIDDEN_WIDTH * line_width)
        _add_lines(axes, visible, colour, line_width)
    visible, _ = wireframe(Bodies.of(overlay.references), overlay.camera)
    _add_lines(axes, visible, REFERENCE, HIDDEN_WIDTH * line_width)
    axes.set(xlim=(-0.5, overlay.camera.width - 0.5), ylim=(overlay.camera.height - 0.5, -0.5))
    axes.set_title(overlay.title, fontsize=font_size)
    axes.set_axis_off()


def _add_lines(axes: Axes, lines: NDArray[np.float32], colour: str, width: float) -> None:
    axes.add_collection(
        LineCollection(list(lines), colors=colour, linewidths=width, capstyle="round")
    )


def _shaded(overlay: Overlay) -> NDArray[np.float64]:
    """Return the image (height, width, 3) of the surfaces as lit from the camera."""
    measured = np.isfinite(overlay.depth)
    colours = np.where(measured[..., None], to_rgb(SCENE), to_rgb(BACKGROUND))
    for shown in overlay.objects:
        u, v = np.rint(overlay.camera.project(shown.points)[:, :2]).astype(int).T
        colours[v, u] = to_rgb(OBJECT)
    brightness = AMBIENT + (1.0 - AMBIENT) * _facing(overlay.depth, overlay.camera)
    return np.where(measured[..., None], colours * brightness[..., None], colours)


def _facing(depth: NDArray[np.float32], camera: Camera) -> NDArray[np.float32]:
    """Return the cosine (height, width) between each surface's normal and the line of sight."""
    filled = np.where(np.isfinite(depth), depth, np.nanmax(depth))
    smooth = cv2.bilateralFilter(filled, SMOOTHING, DEPTH_STEP, SMOOTHING)
    points = depth_to_points(smooth.astype(np.float32), camera)
    normals = np.cross(np.gradient(points, axis=1), np.gradient(points, axis=0))
    lengths = np.linalg.norm(normals, axis=-1) * np.linalg.norm(points, axis=-1)
    cosines: NDArray[np.float32] = np.sum(normals * points, axis=-1) / np.maximum(lengths, 1e-12)
    return np.abs(cosines)


def wireframe(
    bodies: Bodies, camera: Camera, occluders: Bodies | None = None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the visible and the hidden pieces of the bodies' edges; of cylinders, also the limbs.

    Parameters
    ----------
    occluders
        All that can hide them; default: themselves.

    Returns
    -------
    visible, hidden
        (L, 2, 2) lines from pixel to pixel.
    """
    edges = [
        transform_points(cube, line)
        for cube, axis in zip(*bodies, strict=True)
        for line in _unit_edges(cube, axis, camera)
    ]
    points = np.reshape(edges, (-1, EDGE_PIECES + 1, 3))
    middles = 0.5 * (points[:, 1:] + points[:, :-1])
    hidden = np.zeros(middles.shape[:2], dtype=bool)
    for cube, axis in zip(*(bodies if occluders is None else occluders), strict=True):
        hidden |= _covers(cube, axis, camera, middles)
    pixels = camera.project(points)[..., :2].astype(np.float32)
    lines = np.stack([pixels[:, :-1], pixels[:, 1:]], axis=2)
    return lines[~hidden], lines[hidden]


def _unit_edges(cube: NDArray[np.float64], axis: int, camera: Camera) -> list[NDArray[np.float32]]:
    """Return the lines (EDGE_PIECES + 1, 3) of a body in its unit cube."""
    along = np.linspace(0.0, 1.0, EDGE_PIECES + 1, dtype=np.float32)[:, None]
    if axis == NO_AXIS:
        return [a + along * (b - a) for a, b in CUBE_EDGES]
    ends = np.eye(3, dtype=np.float32)[axis] * np.array([[-0.5], [0.5]], dtype=np.float32)
    lines = [end + unit_circle(2.0 * np.pi * along[:, 0], axis) for end in ends]
    eye = (np.linalg.inv(cube) @ camera.pose[:, 3])[[(axis + 1) % 3, (axis + 2) % 3]]
    distance = float(np.linalg.norm(eye))
    if distance > 0.5:  # else the side is not seen, and has no limbs
        half = np.arccos(0.5 / distance)
        angles = np.arctan2(eye[1], eye[0]) + np.array([-half, half])
        feet = unit_circle(angles, axis) + ends[0]
        lines += [foot + along * (ends[1] - ends[0]) for foot in feet]
    return lines


def unit_circle(angles: NDArray[np.floating], axis: int) -> NDArray[np.float32]:
    """Return the points (N, 3) at angles (N,) of a circle of diameter 1 about an axis."""
    points = np.zeros((len(angles), 3), dtype=np.float32)
    points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = np.cos(angles) / 2, np.sin(angles) / 2
    return points


def _covers(
    cube: NDArray[np.float64], axis: int, camera: Camera, points: NDArray[np.float32]
) -> NDArray[np.bool_]:
    """Tell whether a body stands between the camera and each of the points (..., 3)."""
    to_cube = np.linalg.inv(cube).astype(np.float64)
    eye = transform_points(to_cube, camera.position.astype(np.float32))
    rays = transform_points(to_cube, points) - eye
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = (-0.5 - eye) / rays, (0.5 - eye) / rays
        if axis != NO_AXIS:
            across = np.arange(3) != axis
            square, product = (rays[..., across] ** 2).sum(-1), rays[..., across] @ eye[across]
            root = np.sqrt(product**2 - square * (eye[across] @ eye[across] - 0.25))
            round_ends = (-product - root) / square, (-product + root) / square  # NaN: beside it
            first, second = (
                np.stack([flat[..., axis], side], axis=-1)
                for flat, side in zip((first, second), round_ends, strict=True)
            )
    enter = np.minimum(first, second).max(axis=-1)
    leave = np.maximum(first, second).min(axis=-1)
    covered: NDArray[np.bool_] = (enter < np.minimum(leave, 1.0) - SURFACE) & (leave > 0.0)
    return covered
