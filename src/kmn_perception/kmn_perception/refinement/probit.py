"""The likelihood of the pixels beside an edge: a probit regression, see `edges`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from kmn_perception.refinement.silhouette import Crossing, Strip, pixel

ROOT_HALF = math.sqrt(0.5)
ROOT_TWO_PI = math.sqrt(2.0 * math.pi)
NEGLIGIBLE = 6.0  # standard deviations on its own side, where a pixel has no influence


class EdgeSums(NamedTuple):
    """Sums over the samples of an edge, which are added to in place.

    Attributes
    ----------
    moment, force
        (3, 3) and (3,) hessian and gradient of the loss by the edge's line.
    totals
        (3,) loss, and its gradient and information of log s, of all edges.
    """

    moment: NDArray[np.float64]
    force: NDArray[np.float64]
    totals: NDArray[np.float64]


@njit(cache=True, error_model="numpy")
def add_probit(
    lines: NDArray[np.float64],
    faces: NDArray[np.int64],
    edge: int,
    crossing: Crossing,
    strip: Strip,
    noise: float,
    weight: float,
    sums: EdgeSums,
) -> None:
    """Add the likelihood of the pixels of a strip.

    Parameters
    ----------
    lines, faces
        Of the body, see `ModelView`.
    noise
        s, pixels.
    """
    moment, force, totals, evidence = sums.moment, sums.force, sums.totals, strip.evidence
    for k in range(evidence.shape[0]):
        if evidence[k] == 0.0:
            continue
        u, v = pixel(crossing, float(strip.start + strip.step * k))
        sign, sure = np.sign(evidence[k]), abs(evidence[k])
        t = sign * (lines[edge, 0] * u + lines[edge, 1] * v + lines[edge, 2]) / noise
        if t > NEGLIGIBLE or _nearer_to_another(lines, faces, edge, u, v):
            continue
        likely = 1.0 - sure + (2.0 * sure - 1.0) * 0.5 * math.erfc(-t * ROOT_HALF)
        density = (2.0 * sure - 1.0) * math.exp(-0.5 * t * t) / ROOT_TWO_PI
        unlikely = 1.0 - likely
        push = density / likely
        information = density * push / unlikely
        totals[0] -= weight * math.log(likely / sure)  # no pixel costs anything if it fits
        totals[1] += weight * t * push
        totals[2] += weight * t * t * information
        add_pixel(
            moment, force, weight * information / noise**2, -weight * sign * push / noise, u, v
        )


@njit(cache=True, error_model="numpy")
def _nearer_to_another(
    lines: NDArray[np.float64], faces: NDArray[np.int64], edge: int, u: float, v: float
) -> bool:
    """Return whether a pixel is farther outside (or less far inside) another edge of the body."""
    distance = lines[edge, 0] * u + lines[edge, 1] * v + lines[edge, 2]
    for other in range(12):
        if other == edge or faces[other] < 0:
            continue
        if lines[other, 0] * u + lines[other, 1] * v + lines[other, 2] < distance:
            return True
    return False


@njit(cache=True, error_model="numpy")
def add_pixel(
    moment: NDArray[np.float64],
    force: NDArray[np.float64],
    weight: float,
    pull: float,
    u: float,
    v: float,
) -> None:
    """Add a pixel with a weight, and a pull along the normal, to the moments of its edge."""
    moment[0, 0] += weight * u * u
    moment[0, 1] += weight * u * v
    moment[1, 0] += weight * u * v
    moment[0, 2] += weight * u
    moment[2, 0] += weight * u
    moment[1, 1] += weight * v * v
    moment[1, 2] += weight * v
    moment[2, 1] += weight * v
    moment[2, 2] += weight
    force[0] += pull * u
    force[1] += pull * v
    force[2] += pull
