"""How far the observed depths lie from the model's faces."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.correlation import correlated_count
from kmn_perception.refinement.image import InverseDepthImage
from kmn_perception.refinement.view import PLANES, ModelView, add_normal_equations, raycast_any

LAGS = 8  # rows that may be shifted alike


class PlaneTerms(NamedTuple):
    """Sums over pixels of the squared differences in units of their noise, robustly weighted.

    Attributes
    ----------
    hessian, gradient
        (P, P) and (P,) of half the sum of squares (Gauss-Newton).
    residuals
        (K,) observed minus predicted inverse depth in units of its noise.
    """

    hessian: NDArray[np.float64]
    gradient: NDArray[np.float64]
    residuals: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def plane_terms(
    view: ModelView,
    image: InverseDepthImage,
    stride: int,
    noise: float,
    lateral: float,
    robust: float,
    border: float,
) -> PlaneTerms:
    """Compare every ``stride``-th pixel with the face that its ray meets.

    The prediction q . (u, v, 1) is linear in the plane, so that all pixels of a face are summed up
    in one moment matrix. Where the steps of a sensor shift whole rows or columns of a face alike,
    as the sums of their residuals show, they count only as often as they vary.

    Parameters
    ----------
    noise, lateral
        Standard deviations of the inverse depth (1 / m), and of where a pixel looks (pixels).
    robust
        Differences beyond this many standard deviations lose their weight (Geman and McClure).
    border
        Pixels nearer than this to the rim of a face are left out: those that happened to look
        beyond it show something else, or nothing, and the others would be biased.
    """
    pixels = image.pixels
    height, width = image.inverse_depth.shape
    solids = view.solids
    bodies, parameters = solids.shape[0], view.plane_slopes.shape[3]
    rims = _rims(solids, border)
    moments = np.zeros((bodies, 6, 3, 3))
    forces = np.zeros((bodies, 6, 3))
    deviations = np.empty((bodies, 6))
    for body in range(bodies):
        for face in range(6):
            k = PLANES + 3 * face
            steepness = solids[body, k] ** 2 + solids[body, k + 1] ** 2
            deviations[body, face] = math.sqrt(noise**2 + lateral**2 * steepness)
    residuals = np.empty(pixels.shape[0] // stride + 1)
    row_sums, column_sums = np.zeros((bodies, 6, height)), np.zeros((bodies, 6, width))
    counts = np.zeros((bodies, 6), dtype=np.int64)
    count = 0
    for i in range(0, pixels.shape[0], stride):
        u, v = float(pixels[i, 0]), float(pixels[i, 1])
        predicted, body, face = raycast_any(solids, u, v)
        if body < 0 or predicted > image.nearest or predicted < image.farthest:
            continue
        if border > 0.0 and _at_rim(solids, rims, body, face, u, v, predicted):
            continue
        residual = (pixels[i, 2] - predicted) / deviations[body, face]
        residuals[count] = residual
        count += 1
        weight = 1.0 / (1.0 + (residual / robust) ** 2) ** 2
        row_sums[body, face, int(v)] += weight * residual
        column_sums[body, face, int(u)] += weight * residual
        counts[body, face] += 1
        weight /= deviations[body, face]
        residual *= weight
        weight /= deviations[body, face]
        moments[body, face, 0, 0] += weight * u * u
        moments[body, face, 0, 1] += weight * u * v
        moments[body, face, 0, 2] += weight * u
        moments[body, face, 1, 1] += weight * v * v
        moments[body, face, 1, 2] += weight * v
        moments[body, face, 2, 2] += weight
        forces[body, face, 0] -= residual * u
        forces[body, face, 1] -= residual * v
        forces[body, face, 2] -= residual
    hessian, gradient = np.zeros((parameters, parameters)), np.zeros(parameters)
    for body in range(bodies):
        for face in range(6):
            if counts[body, face] == 0:
                continue
            moment, force = moments[body, face], forces[body, face]
            moment[1, 0], moment[2, 0], moment[2, 1] = moment[0, 1], moment[0, 2], moment[1, 2]
            in_rows, in_columns = (
                correlated_count(row_sums[body, face], LAGS),
                correlated_count(column_sums[body, face], LAGS),
            )
            often = max(1.0, in_rows / counts[body, face], in_columns / counts[body, face])
            slopes = view.plane_slopes[body, face]
            add_normal_equations(hessian, gradient, slopes, moment / often, force / often)
    return PlaneTerms(hessian, gradient, residuals[:count])


@njit(cache=True, error_model="numpy")
def _rims(solids: NDArray[np.float64], border: float) -> NDArray[np.float64]:
    """Return (B, 6, 6) by how much two planes differ, ``border`` pixels from where they meet."""
    rims = np.zeros((solids.shape[0], 6, 6))
    for body in range(solids.shape[0]):
        for face in range(6):
            for other in range(6):
                across = solids[body, PLANES + 3 * face : PLANES + 3 * face + 2]
                across = across - solids[body, PLANES + 3 * other : PLANES + 3 * other + 2]
                rims[body, face, other] = border * math.hypot(across[0], across[1])
    return rims


@njit(cache=True, error_model="numpy")
def _at_rim(
    solids: NDArray[np.float64],
    rims: NDArray[np.float64],
    body: int,
    face: int,
    u: float,
    v: float,
    inverse_depth: float,
) -> bool:
    """Tell whether a pixel lies near the rim of the face that it shows."""
    for other in range(6):
        if other != face:
            k = PLANES + 3 * other
            beyond = solids[body, k] * u + solids[body, k + 1] * v + solids[body, k + 2]
            if abs(inverse_depth - beyond) < rims[body, face, other]:
                return True
    return False
