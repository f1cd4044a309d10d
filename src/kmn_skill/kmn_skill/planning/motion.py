"""Motion along a path: as fast as its limits allow, from rest to rest, and smooth."""

from __future__ import annotations

import numpy as np
import toppra
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray
from toppra.algorithm import TOPPRA
from toppra.constraint import JointAccelerationConstraint, JointVelocityConstraintVarying

GRID = 2  # steps of the time parametrisation between two nodes
UNLIMITED = 1e4  # instead of infinity, of which the solver knows nothing
LEAST = 0.1  # of the mean step along the path: nodes that coincide are held apart
SAMPLES = 8  # of which a mean over the time of smoothing is made


class MotionError(ValueError):
    """No motion along the path keeps within the limits."""


class Motion:
    """Follows a path through nodes, from rest to rest.

    The time-optimal motion, whose accelerations jump, is replaced by its mean over a short time
    about each instant. Means of what is allowed are allowed, so velocities and accelerations stay
    within their limits; and an acceleration changes by at most twice its limit in that time. The
    mean cuts corners of the path, by a fraction of a millimetre; a plan is checked thereafter.

    Parameters
    ----------
    nodes
        (M, C) coordinates: whatever is limited, not only joints.
    speeds
        (M, C) largest velocities at the nodes; infinite where there is no limit.
    accelerations
        (C,) largest accelerations, likewise.
    smoothing
        Over which the mean is taken, seconds.

    Attributes
    ----------
    duration
        Of the motion, seconds.

    Raises
    ------
    MotionError
        If there is no motion within the limits.
    """

    def __init__(
        self,
        nodes: NDArray[np.float64],
        speeds: NDArray[np.float64],
        accelerations: NDArray[np.float64],
        smoothing: float,
    ) -> None:
        steps = np.abs(np.diff(nodes, axis=0)) / np.minimum(speeds[:-1], speeds[1:])
        least = steps.max(axis=1)  # seconds that each step takes
        along = np.concatenate([[0.0], np.cumsum(np.hypot(least, LEAST * least.mean()))])
        self._path = toppra.SplineInterpolator(along, nodes)
        places = np.arange(GRID * (len(nodes) - 1) + 1) / GRID
        self._grid = np.interp(places, np.arange(len(nodes)), along)
        limits = np.minimum(
            speeds[np.floor(places).astype(int)], speeds[np.ceil(places).astype(int)]
        )
        self._rates = self._optimise(limits, accelerations)
        passing = 2.0 * np.diff(self._grid) / (self._rates[:-1] + self._rates[1:])
        self._times = np.concatenate([[0.0], np.cumsum(passing)])
        self._smoothing = smoothing
        self.duration = float(self._times[-1]) + smoothing

    def time_of(self, node: int) -> float:
        """Return the time at which a node is passed, seconds."""
        return float(self._times[GRID * node]) + self._smoothing / 2.0

    def positions(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the coordinates (N, C) at times (N,), seconds."""
        places, weights = leggauss(SAMPLES)
        parts = (
            weight / 2.0 * self._sharp(times + (place - 1.0) / 2.0 * self._smoothing)
            for place, weight in zip(places, weights, strict=True)
        )
        return np.sum(list(parts), axis=0)

    def velocities(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the velocities (N, C) at times (N,), seconds."""
        before, after = self._sharp(times - self._smoothing), self._sharp(times)
        return (after - before) / self._smoothing

    def _sharp(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the coordinates (N, C) of the time-optimal motion; it rests before and after."""
        at = np.clip(times, 0.0, self._times[-1])
        i = np.clip(np.searchsorted(self._times, at, side="right") - 1, 0, len(self._grid) - 2)
        passed, whole = at - self._times[i], self._times[i + 1] - self._times[i]
        gained = (self._rates[i + 1] - self._rates[i]) / whole
        along = self._grid[i] + passed * (self._rates[i] + gained * passed / 2.0)
        return np.asarray(self._path(along))

    def _optimise(
        self, speeds: NDArray[np.float64], accelerations: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the rates (G,) along the path at the grid's points, with speeds (G, C) there."""

        def bounds(limits: NDArray[np.float64]) -> NDArray[np.float64]:
            finite = np.minimum(limits, UNLIMITED)
            return np.stack([-finite, finite], axis=-1)

        velocities = bounds(speeds)
        constraints = [
            JointVelocityConstraintVarying(lambda at: velocities[np.searchsorted(self._grid, at)]),
            JointAccelerationConstraint(bounds(accelerations)),
        ]
        algorithm = TOPPRA(constraints, self._path, gridpoints=self._grid, solver_wrapper="seidel")
        rates = algorithm.compute_parameterization(0.0, 0.0)[1]
        if rates is None or not np.isfinite(rates).all() or (rates[:-1] + rates[1:]).min() <= 0.0:
            raise MotionError("no motion along the path keeps within the limits")
        return np.asarray(rates)
