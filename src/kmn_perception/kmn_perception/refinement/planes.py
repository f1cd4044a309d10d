"""How far the observed depths lie from the model's faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.geometry import View, add_normal_equations, meet_any


class PlaneTerms(NamedTuple):
    """Sums over pixels of the squared differences in inverse depth, robustly weighted.

    Attributes
    ----------
    hessian, gradient
        (P, P) and (P,) of half the sum of squares (Gauss-Newton).
    residuals
        (K,) observed minus predicted inverse depth of the pixels that show the model.
    """

    hessian: NDArray[np.float64]
    gradient: NDArray[np.float64]
    residuals: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def plane_terms(
    view: View, pixels: NDArray[np.float32], stride: int, robust_scale: float
) -> PlaneTerms:
    """Compare every ``stride``-th pixel with the face that its ray meets.

    The prediction q . (u, v, 1) is linear in the plane, so that all pixels of a face are summed up
    in one moment matrix.

    Parameters
    ----------
    robust_scale
        Differences beyond this lose their weight (Geman and McClure), 1 / m.
    """
    solids = view.solids
    bodies, parameters = solids.shape[0], view.plane_slopes.shape[3]
    moments = np.zeros((bodies, 6, 3, 3))
    forces = np.zeros((bodies, 6, 3))
    residuals = np.empty(pixels.shape[0] // stride + 1)
    count = 0
    for i in range(0, pixels.shape[0], stride):
        u, v = float(pixels[i, 0]), float(pixels[i, 1])
        predicted, body, face = meet_any(solids, u, v)
        if body < 0:
            continue
        residual = pixels[i, 2] - predicted
        residuals[count] = residual
        count += 1
        weight = 1.0 / (1.0 + (residual / robust_scale) ** 2) ** 2
        moments[body, face, 0, 0] += weight * u * u
        moments[body, face, 0, 1] += weight * u * v
        moments[body, face, 0, 2] += weight * u
        moments[body, face, 1, 1] += weight * v * v
        moments[body, face, 1, 2] += weight * v
        moments[body, face, 2, 2] += weight
        forces[body, face, 0] -= weight * residual * u
        forces[body, face, 1] -= weight * residual * v
        forces[body, face, 2] -= weight * residual
    hessian, gradient = np.zeros((parameters, parameters)), np.zeros(parameters)
    for body in range(bodies):
        for face in range(6):
            moment = moments[body, face]
            moment[1, 0], moment[2, 0], moment[2, 1] = moment[0, 1], moment[0, 2], moment[1, 2]
            slopes = view.plane_slopes[body, face]
            add_normal_equations(hessian, gradient, slopes, moment, forces[body, face])
    return PlaneTerms(hessian, gradient, residuals[:count])
