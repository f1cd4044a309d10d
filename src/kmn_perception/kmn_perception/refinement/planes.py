"""The distances of the observed depths from the model's faces, flat ones and sides of cylinders."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.model.parts import NO_AXIS
from kmn_perception.refinement.correlation import newey_west_variance
from kmn_perception.refinement.cylinders import (
    SIDE_TERMS,
    at_border_of_cylinder,
    side_deviation,
    side_point,
    side_terms,
)
from kmn_perception.refinement.image import InverseDepthImage, Noise
from kmn_perception.refinement.solids import (
    AXIS,
    BOTTOM,
    FACES,
    LEFT,
    RIGHT,
    SIDE,
    TOP,
    gradient,
    inverse_depth_at,
    raycast_any,
)
from kmn_perception.refinement.view import ModelView, add_normal_equations


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


class PlaneSampling(NamedTuple):
    """Which pixels are compared with the faces, and how.

    Attributes
    ----------
    noise
        Standard deviations of the inverse depth, and of where a pixel looks.
    stride
        Every such pixel is compared.
    robust
        Differences beyond this many standard deviations lose their weight (Geman and McClure).
    border
        Pixels closer than this to the border of a face, or to another body, are left out: those
        that happened to look beyond it show something else, or nothing, and the others would be
        biased.
    correlated_rows
        Number of neighbouring rows (or columns) whose errors may be correlated.
    shape_error
        Standard deviation by which a whole face lies or leans off the model's, 1 / m.
    """

    noise: Noise
    stride: int
    robust: float
    border: float
    correlated_rows: int
    shape_error: float


@njit(cache=True, error_model="numpy")
def plane_terms(view: ModelView, image: InverseDepthImage, sampling: PlaneSampling) -> PlaneTerms:
    """Compare pixels with the faces that their rays meet.

    The prediction q . (u, v, 1) is linear in the plane, so that all pixels of a face are summed up
    in one moment matrix; likewise in the terms of a cylinder's side. Where the quantization of a
    sensor shifts whole rows or columns of a face together, as the sums of their residuals show, the
    face loses weight accordingly; and however many pixels show it, they tell no more of it than its
    shape allows.
    """
    pixels = image.pixels
    height, width = image.inverse_depth.shape
    solids, robust = view.solids, sampling.robust
    bodies, parameters = solids.shape[0], view.plane_jacobians.shape[3]
    borders = _borders(solids, sampling.border)
    deviations = _deviations(solids, sampling.noise)
    moments = np.zeros((bodies, 6, 3, 3))
    forces = np.zeros((bodies, 6, 3))
    side_moments = np.zeros((bodies, SIDE_TERMS, SIDE_TERMS))
    side_forces, terms = np.zeros((bodies, SIDE_TERMS)), np.zeros(SIDE_TERMS)
    side_information = np.zeros(bodies)
    residuals = np.empty(pixels.shape[0] // sampling.stride + 1)
    row_sums, column_sums = np.zeros((bodies, FACES, height)), np.zeros((bodies, FACES, width))
    counts = np.zeros((bodies, FACES), dtype=np.int64)
    count = 0
    for i in range(0, pixels.shape[0], sampling.stride):
        u, v = float(pixels[i, 0]), float(pixels[i, 1])
        predicted, body, face = raycast_any(solids, u, v)
        if body < 0 or predicted > image.nearest or predicted < image.farthest:
            continue
        if sampling.border > 0.0 and (
            _at_border(view, borders, body, face, u, v, predicted, sampling.border)
            or _beside_another(view, body, u, v, sampling.border)
        ):
            continue
        if face == SIDE:
            point = side_point(solids, body, u, v, predicted)
            deviation = side_deviation(point, sampling.noise.depth, sampling.noise.lateral)
            side_terms(point, predicted, terms)
        else:
            deviation = deviations[body, face]
        residual = (pixels[i, 2] - predicted) / deviation
        residuals[count] = residual
        count += 1
        weight = 1.0 / (1.0 + (residual / robust) ** 2) ** 2
        row_sums[body, face, int(v)] += weight * residual
        column_sums[body, face, int(u)] += weight * residual
        counts[body, face] += 1
        weight /= deviation
        residual *= weight
        weight /= deviation
        if face == SIDE:
            side_information[body] += weight
            _add_side(side_moments[body], side_forces[body], terms, weight, residual)
            continue
        moments[body, face, 0, 0] += weight * u * u
        moments[body, face, 0, 1] += weight * u * v
        moments[body, face, 0, 2] += weight * u
        moments[body, face, 1, 1] += weight * v * v
        moments[body, face, 1, 2] += weight * v
        moments[body, face, 2, 2] += weight
        forces[body, face, 0] -= residual * u
        forces[body, face, 1] -= residual * v
        forces[body, face, 2] -= residual
    hessian, total = np.zeros((parameters, parameters)), np.zeros(parameters)
    for body in range(bodies):
        for face in range(6):
            if counts[body, face] == 0:
                continue
            moment, force = moments[body, face], forces[body, face]
            moment[1, 0], moment[2, 0], moment[2, 1] = moment[0, 1], moment[0, 2], moment[1, 2]
            rows = newey_west_variance(row_sums[body, face], sampling.correlated_rows)
            columns = newey_west_variance(column_sums[body, face], sampling.correlated_rows)
            inflation = max(1.0, rows / counts[body, face], columns / counts[body, face])
            inflation += sampling.shape_error**2 * moment[2, 2]
            jacobian = view.plane_jacobians[body, face]
            add_normal_equations(hessian, total, jacobian, moment / inflation, force / inflation)
        if counts[body, SIDE] > 0:
            rows = newey_west_variance(row_sums[body, SIDE], sampling.correlated_rows)
            columns = newey_west_variance(column_sums[body, SIDE], sampling.correlated_rows)
            number = counts[body, SIDE]
            inflation = max(1.0, rows / number, columns / number)
            inflation += sampling.shape_error**2 * side_information[body]
            jacobian = view.side_jacobians[body]
            moment, force = side_moments[body] / inflation, side_forces[body] / inflation
            add_normal_equations(hessian, total, jacobian, moment, force)
    return PlaneTerms(hessian, total, residuals[:count])


@njit(cache=True, error_model="numpy")
def _add_side(
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
    terms: NDArray[np.float64],
    weight: float,
    pull: float,
) -> None:
    """Add a pixel of a cylinder's side to its moments."""
    for k in range(SIDE_TERMS):
        force[k] -= pull * terms[k]
        for c in range(SIDE_TERMS):
            moment[k, c] += weight * terms[k] * terms[c]


@njit(cache=True, error_model="numpy")
def _deviations(solids: NDArray[np.float64], noise: Noise) -> NDArray[np.float64]:
    """Return the standard deviation (B, 6) of the inverse depth that is measured on each face."""
    deviations = np.empty((solids.shape[0], 6))
    for body in range(solids.shape[0]):
        for face in range(6):
            by_u, by_v = gradient(solids, body, face)
            deviations[body, face] = math.sqrt(
                noise.depth**2 + noise.lateral**2 * (by_u**2 + by_v**2)
            )
    return deviations


@njit(cache=True, error_model="numpy")
def _borders(solids: NDArray[np.float64], border: float) -> NDArray[np.float64]:
    """Return the difference (B, 6, 6) between two planes ``border`` pixels from where they meet."""
    borders = np.zeros((solids.shape[0], 6, 6))
    for body in range(solids.shape[0]):
        for face in range(6):
            by_u, by_v = gradient(solids, body, face)
            for other in range(6):
                other_by_u, other_by_v = gradient(solids, body, other)
                steepness = math.hypot(by_u - other_by_u, by_v - other_by_v)
                borders[body, face, other] = border * steepness
    return borders


@njit(cache=True, error_model="numpy")
def _at_border(
    view: ModelView,
    borders: NDArray[np.float64],
    body: int,
    face: int,
    u: float,
    v: float,
    inverse_depth: float,
    border: float,
) -> bool:
    """Return whether a pixel lies near the border of the face that it shows."""
    solids = view.solids
    if solids[body, AXIS] != NO_AXIS:
        lines = view.lines[body]
        return at_border_of_cylinder(solids, lines, body, face, u, v, inverse_depth, border)
    for other in range(6):
        if other != face:
            beyond = inverse_depth_at(solids, body, other, u, v)
            if abs(inverse_depth - beyond) < borders[body, face, other]:
                return True
    return False


@njit(cache=True, error_model="numpy")
def _beside_another(view: ModelView, body: int, u: float, v: float, border: float) -> bool:
    """Return whether a pixel that shows a body lies near the silhouette of another, outside it."""
    solids = view.solids
    for other in range(solids.shape[0]):
        if (
            other == body
            or u < solids[other, LEFT] - border
            or u > solids[other, RIGHT] + border
            or v < solids[other, TOP] - border
            or v > solids[other, BOTTOM] + border
        ):
            continue
        inside, near = True, True
        for edge in range(12):
            if view.faces[other, edge] < 0:
                continue
            line = view.lines[other, edge]
            distance = line[0] * u + line[1] * v + line[2] + view.creases[other, edge]
            inside = inside and distance >= 0.0
            near = near and distance > -border
        if near and not inside:
            return True
    return False
