"""Whether faces that the model has flat are seen to be curved: cans and cups are no boxes.

How far the points are from a flat face is noise. From a round body's they follow a parabola, which
leaves the face steeply for its width, be it a small cup's or a large pot's; the side of a carton
that bulges by as much does not.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.parts import NO_AXIS
from kmn_perception.refinement.geometry import cuboids
from kmn_perception.refinement.image import InverseDepthImage
from kmn_perception.refinement.problem import Problem
from kmn_perception.refinement.solids import AXIS, raycast_any
from kmn_perception.refinement.support_settings import CurvatureSettings

TERMS = 6  # 1, x, y, x^2, y^2, x y along the face
UNIFORM = np.sqrt(3.0)  # half the width of a uniform distribution, in standard deviations


class FaceSums(NamedTuple):
    """Sums over the points of each face (B, 6, ...) for a parabola of their distances from it."""

    moments: NDArray[np.float64]  # (B, 6, TERMS, TERMS)
    forces: NDArray[np.float64]  # (B, 6, TERMS)
    squares: NDArray[np.float64]  # (B, 6)


def curved_face(problem: Problem, values: NDArray[np.float64]) -> str:
    """Return how a face is seen to be curved, at the values (P,) of a fit; empty if none is."""
    settings, projection = problem.settings.curvature, problem.image.projection
    cubes, _ = cuboids(problem.shape, values)
    sums = _sums(
        problem.view(values).solids,
        problem.image,
        np.linalg.inv(projection[:, :3] @ cubes[:, :, :3]).astype(np.float64),
        cubes[:, :, 3] @ projection[:, :3].T + projection[:, 3],
        np.sqrt((cubes[:, :, :3] ** 2).sum(axis=1)),
        problem.stride(settings.pixels),
        settings,
    )
    for body in range(len(cubes)):
        for face in range(6):
            square = float(sums.squares[body, face])
            radius = _radius(sums.moments[body, face], sums.forces[body, face], square, settings)
            if radius > 0.0:
                return f"a side is curved, with a radius of {radius:.3f} m: it is of another shape"
    return ""


def _radius(
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
    square: float,
    settings: CurvatureSettings,
) -> float:
    """Return the radius at which a face is curved, metres; 0 if it may be flat."""
    count = moment[0, 0]
    if count < settings.min_pixels:
        return 0.0
    inverse = np.linalg.pinv(moment, hermitian=True)
    parabola = inverse @ force
    variance = max(square - float(parabola @ force), 0.0) / count * settings.correlated
    for axis in (1, 2):
        place = moment[0, axis] / count
        half = UNIFORM * np.sqrt(max(moment[axis, axis] / count - place**2, 0.0))
        bend = abs(parabola[2 + axis])
        sure = settings.sure * np.sqrt(variance * inverse[2 + axis, 2 + axis])
        if bend > sure and bend * half > settings.slope and bend * half**2 > settings.rise:
            return float(0.5 / bend)
    return 0.0


@njit(cache=True, error_model="numpy")
def _sums(
    solids: NDArray[np.float64],
    image: InverseDepthImage,
    to_unit: NDArray[np.float64],
    centres: NDArray[np.float64],
    sizes: NDArray[np.float64],
    stride: int,
    settings: CurvatureSettings,
) -> FaceSums:
    """Sum up the points of each face, but for those near its border: a sensor rounds corners off.

    Parameters
    ----------
    to_unit, centres
        (B, 3, 3) and (B, 3): a point of homogeneous pixels P is at ``to_unit (P - centre)`` in the
        unit cube of a body.
    sizes
        (B, 3) of the bodies, metres.
    """
    bodies, pixels = solids.shape[0], image.pixels
    moments = np.zeros((bodies, 6, TERMS, TERMS))
    forces, squares = np.zeros((bodies, 6, TERMS)), np.zeros((bodies, 6))
    terms = np.ones(TERMS)
    for i in range(0, pixels.shape[0], stride):
        u, v, seen = float(pixels[i, 0]), float(pixels[i, 1]), float(pixels[i, 2])
        predicted, body, face = raycast_any(solids, u, v)
        if body < 0 or solids[body, AXIS] != NO_AXIS:  # of a cylinder: it is round
            continue
        point = np.array([u, v, 1.0]) / seen - centres[body]
        place = np.zeros(3)
        for k in range(3):
            for j in range(3):
                place[k] += to_unit[body, k, j] * point[j]
        across, first, second = face // 2, (face // 2 + 1) % 3, (face // 2 + 2) % 3
        off = ((2 * (face % 2) - 1) * place[across] - 0.5) * sizes[body, across]
        inside = abs(off) < settings.reach
        for k in (first, second):
            inside &= (0.5 - abs(place[k])) * sizes[body, k] > settings.border
        if not inside:
            continue
        x, y = place[first] * sizes[body, first], place[second] * sizes[body, second]
        terms[1], terms[2], terms[3], terms[4], terms[5] = x, y, x * x, y * y, x * y
        squares[body, face] += off * off
        for k in range(TERMS):
            forces[body, face, k] += terms[k] * off
            for j in range(TERMS):
                moments[body, face, k, j] += terms[k] * terms[j]
    return FaceSums(moments, forces, squares)
