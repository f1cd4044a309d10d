"""Whether the joints of a model are at 0, as far as an observation tells."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.refinement.gauss_newton import Fit
from kmn_perception.refinement.problem import Problem

UNIFORM = 3.0  # inverse variance of a uniform distribution over a range of 2


class JointEvidence(NamedTuple):
    """What a fit with k free joints says of them.

    Attributes
    ----------
    positions
        (k,) rad or m.
    covariance
        (n + m + k, n + m + k) of (theta, gamma) and the positions.
    """

    positions: NDArray[np.float64]
    covariance: NDArray[np.float64]

    @classmethod
    def of(cls, problem: Problem, fit: Fit, joints: int) -> JointEvidence:
        """Return what a fit says of the last parameters, the joints; within the limits."""
        scale = np.outer(problem.half_range, problem.half_range)
        information = (fit.depth_information + fit.edge_information) * scale
        covariance = np.linalg.inv(information + UNIFORM * np.eye(len(scale))) * scale
        return cls(fit.values[-joints:], covariance)

    @property
    def excess(self) -> float:
        """By how many standard deviations that joint is from 0 that is farthest so."""
        variances = np.diag(self.covariance)[-len(self.positions) :]
        return float(np.max(np.abs(self.positions) / np.sqrt(variances)))

    def at_rest(self, covariance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the covariance (n + m + k, n + m + k) where the joints are believed to be at 0.

        They may be off by as much as the observation allows, and by what the fit found; theta and
        gamma follow.

        Parameters
        ----------
        covariance
            (n + m, n + m) of (theta, gamma) were the joints known to be at 0.
        """
        fixed = len(covariance)
        spread = self.covariance[fixed:, fixed:]
        slopes = self.covariance[:, fixed:] @ np.linalg.inv(spread)
        result = slopes @ (spread + np.outer(self.positions, self.positions)) @ slopes.T
        result[:fixed, :fixed] += covariance
        return np.asarray(result)
