"""How often correlated residuals count, against the estimator written out."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from kmn_perception.refinement.correlation import newey_west_variance

ROWS = arrays(np.float64, st.integers(0, 60), elements=st.floats(-10.0, 10.0))


@given(ROWS, st.integers(1, 40))
def test_it_is_the_estimator_of_newey_and_west(rows: NDArray[np.float64], lags: int) -> None:
    covariances = np.correlate(rows, rows, "full")[len(rows) - 1 :] if len(rows) else np.zeros(1)
    weights = 2.0 * np.maximum(1.0 - np.arange(len(covariances)) / lags, 0.0)
    weights[0] = 1.0
    expected = max(covariances[0], weights @ covariances)
    assert newey_west_variance(rows, lags) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_independent_rows_count_each_and_equal_ones_as_one() -> None:
    noise = np.random.default_rng(0).standard_normal(20000)
    assert newey_west_variance(noise, 8) == pytest.approx((noise**2).sum(), rel=0.1)
    assert newey_west_variance(np.ones(20000), 8) == pytest.approx(8 * 20000, rel=1e-3)
