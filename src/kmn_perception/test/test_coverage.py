"""Confidence ellipsoids, against the published table and against samples of known covariance."""

from __future__ import annotations

import numpy as np
import pytest

from kmn_perception.evaluation.coverage import chi2_quantile, is_covered
from kmn_perception.model.kinematic_model import KinematicModel

DOOR, BOX = KinematicModel.load("door"), KinematicModel.load("box")


@pytest.mark.parametrize(
    ("probability", "degrees", "quantile"),
    [
        (0.95, 1, 3.841), (0.95, 2, 5.991), (0.95, 3, 7.815), (0.95, 5, 11.070),
        (0.95, 7, 14.067), (0.95, 10, 18.307), (0.99, 1, 6.635), (0.99, 7, 18.475),
        (0.5, 2, 1.386), (0.05, 4, 0.711),
    ],
)  # fmt: skip
def test_quantiles_are_those_of_the_table(
    probability: float, degrees: int, quantile: float
) -> None:
    """NIST/SEMATECH e-Handbook of Statistical Methods, section 1.3.6.7.4."""
    assert chi2_quantile(probability, degrees) == pytest.approx(quantile, abs=0.5e-3)


def test_95_of_100_gaussian_truths_lie_within() -> None:
    generator = np.random.default_rng(0)
    root = generator.normal(size=(7, 7)) * [0.1, 0.01, 0.3, 1e-4, 0.02, 0.03, 0.001]
    covariance, estimate = root @ root.T, np.zeros(7)
    truths = generator.normal(size=(4000, 7)) @ root.T
    within = [is_covered(DOOR, estimate, covariance, truth, 0.95) for truth in truths]
    assert np.mean(within) == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 4000))


def test_along_what_is_not_known_all_is_covered_and_across_it_nothing() -> None:
    """Of a door whose top is out of view height / 2 + handle z is known, to a millimetre."""
    free, known = np.zeros(7), np.zeros(7)
    free[[3, 6]], known[[3, 6]] = (1.0, -0.5), (0.5, 1.0)
    covariance = np.diag([1e-6] * 7) + 0.1**2 * np.outer(free, free)
    assert is_covered(DOOR, np.zeros(7), covariance, 0.1 * free, 0.95)
    assert not is_covered(DOOR, np.zeros(7), covariance, 0.1 * known, 0.95)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_a_covariance_covers_nothing(bad: float) -> None:
    assert not is_covered(DOOR, np.zeros(7), np.full((7, 7), bad), np.zeros(7), 0.95)


def test_a_covariance_of_zero_covers_only_the_truth() -> None:
    covariance, truth = np.zeros((7, 7)), np.full(7, 0.01)
    assert is_covered(DOOR, truth, covariance, truth, 0.95)
    assert not is_covered(DOOR, truth + 1e-6, covariance, truth, 0.95)


def test_a_box_turned_by_a_quarter_turn_is_covered_as_the_same_box() -> None:
    """The width is known less well than the length; turned, the truth's own width is its length."""
    estimate = np.array([0.1, 0.2, 0.7, 0.5, -0.3, 0.0])
    truth = np.array([0.1, 0.2, 0.7 - np.pi / 2, -0.3, 0.6, 0.0])
    deviations = np.array([0.01, 0.01, 0.01, 0.1, 0.01, 0.01])
    assert is_covered(BOX, estimate, np.diag(deviations**2), truth, 0.95)
    assert not is_covered(BOX, estimate, np.diag(deviations[[0, 1, 2, 4, 3, 5]] ** 2), truth, 0.95)
