"""The contour of an object in the image, and where it shows an edge of a face."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.experiments.settings import ContourSettings
from kmn_perception.model.camera import Camera

STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1))  # to the neighbours of a pixel


class Contour(NamedTuple):
    """Points between a pixel of the object and one beside it.

    Attributes
    ----------
    rays
        (N, 3) in the optical frame, of depth 1.
    normals
        (N, 2) unit vectors out of the object, in the image.
    depths
        (N,) of the object beside them, metres.
    beyond, beyond_rays
        (N,) depth that was measured next beyond them, metres, NaN for none; and (N, 3) its rays.
    """

    rays: NDArray[np.float64]
    normals: NDArray[np.float64]
    depths: NDArray[np.float64]
    beyond: NDArray[np.float64]
    beyond_rays: NDArray[np.float64]


class Plane(NamedTuple):
    """A plane ``normal . p = offset`` in the world."""

    normal: NDArray[np.float64]
    offset: float


class Edge(NamedTuple):
    """Where a face ends: along which axis, its coordinate and standard deviation, metres."""

    coordinate: float
    deviation: float


def find_contour(
    mask: NDArray[np.bool_], depth: NDArray[np.float32], camera: Camera, settings: ContourSettings
) -> Contour:
    """Return the contour of a mask (height, width), without that of its holes."""
    blurred = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), settings.blur)
    outward = -np.dstack(np.gradient(blurred)[::-1])
    outward /= np.maximum(np.linalg.norm(outward, axis=-1, keepdims=True), 1e-9)
    parts = [_contour_along(step, mask, depth, outward, camera, settings) for step in STEPS]
    return Contour(*(np.concatenate(values) for values in zip(*parts, strict=True)))


def _contour_along(
    step: tuple[int, int],
    mask: NDArray[np.bool_],
    depth: NDArray[np.float32],
    outward: NDArray[np.float64],
    camera: Camera,
    settings: ContourSettings,
) -> Contour:
    du, dv = step
    height, width = mask.shape
    padded = np.pad(mask, 1)
    leaves = mask & ~padded[1 + dv : height + 1 + dv, 1 + du : width + 1 + du]
    along = outward[..., 0] * du + outward[..., 1] * dv
    leaves &= along >= np.abs(outward[..., 0] * dv + outward[..., 1] * du)
    v, u = np.nonzero(leaves)
    beyond = np.full(len(u), np.nan)
    distance = np.zeros(len(u), dtype=np.int64)
    hole = np.zeros(len(u), dtype=bool)
    for far in range(1, settings.shadow + 1):
        row, column = v + far * dv, u + far * du
        inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
        open_ = inside & (distance == 0)
        measured = np.zeros(len(u), dtype=bool)
        measured[open_] = np.isfinite(depth[row[open_], column[open_]])
        beyond[measured] = depth[row[measured], column[measured]]
        hole[measured] = mask[row[measured], column[measured]]
        distance[measured] = far
    kept = ~hole
    u, v, beyond, distance = u[kept], v[kept], beyond[kept], distance[kept]
    return Contour(
        rays=camera.rays(u + 0.5 * du, v + 0.5 * dv),
        normals=outward[v, u],
        depths=depth[v, u].astype(np.float64),
        beyond=beyond,
        beyond_rays=camera.rays(u + distance * du, v + distance * dv),
    )


def find_edge(
    contour: Contour,
    camera: Camera,
    plane: Plane,
    outwards: NDArray[np.float64],
    settings: ContourSettings,
) -> Edge | None:
    """Return where a face ends in a direction, or None where that is not seen.

    Only those parts of the contour count that run as the edge would, and beyond which the camera
    looks past the face: where something stands before it, its end is hidden.

    Parameters
    ----------
    plane
        Of the face, in the world.
    outwards
        (3,) unit vector in the face, across the edge.
    """
    rotation, eye = camera.pose[:3, :3], camera.position
    reach = plane.offset - plane.normal @ eye
    with np.errstate(divide="ignore", invalid="ignore"):
        depths = reach / (contour.rays @ rotation.T @ plane.normal)
        behind = reach / (contour.beyond_rays @ rotation.T @ plane.normal)
    points = contour.rays * depths[:, None]  # in the optical frame
    across, along = rotation.T @ outwards, rotation.T @ np.cross(plane.normal, outwards)
    flow = _flow(points, across, camera)
    normal = _perpendicular(_flow(points, along, camera), flow)
    with np.errstate(invalid="ignore"):
        fits = np.sum(normal * contour.normals, axis=1) > settings.cosine
        fits &= np.abs(depths - contour.depths) < settings.near_face
        fits &= (contour.beyond > behind + settings.step) | (behind <= 0.0)
        fits &= np.isfinite(contour.beyond)
    if fits.sum() < settings.min_pixels:
        return None
    found = points[fits]
    coordinates = found @ across + eye @ outwards
    nearest = np.abs(coordinates[:, None] - coordinates) < settings.window
    peak = coordinates[np.argmax(nearest.sum(axis=1))]
    near = np.abs(coordinates - peak) < settings.window
    if near.sum() < settings.min_pixels:
        return None
    spread = float(np.std(coordinates[near]) / np.sqrt(near.sum() / settings.correlated))
    pixels_per_metre = np.sum(flow * normal, axis=1)[fits][near]
    pixel = settings.pixel_error / float(np.median(pixels_per_metre))
    return Edge(float(np.median(coordinates[near])), float(np.hypot(spread, pixel)))


def _flow(
    points: NDArray[np.float64], direction: NDArray[np.float64], camera: Camera
) -> NDArray[np.float64]:
    """Return the motion in the image (N, 2) of points (N, 3), in pixels per metre."""
    x, y, z = points.T
    return np.column_stack(
        [
            camera.fx * (direction[0] - x / z * direction[2]) / z,
            camera.fy * (direction[1] - y / z * direction[2]) / z,
        ]
    )


def _perpendicular(along: NDArray[np.float64], across: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit vectors (N, 2) at right angles to one direction, on the side of another."""
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    normal *= np.sign(np.sum(normal * across, axis=1))[:, None]
    with np.errstate(invalid="ignore"):
        unit: NDArray[np.float64] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    return unit
