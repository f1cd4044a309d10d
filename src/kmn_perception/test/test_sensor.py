"""The noise models against the statistics that they stand for."""

import numpy as np
import pytest

from kmn_perception.model.sensor_noise import add_noise


@pytest.mark.parametrize("z", [0.6, 1.0, 2.5])
def test_kinect_noise_has_the_published_spread(z: float) -> None:
    """Nguyen et al. (2012), with the spread of the rounding to 1/8 px of disparity beside it."""
    depth = np.full((200, 200), z, dtype=np.float32)
    noisy = add_noise(depth, "kinect", np.random.default_rng(0))
    axial = 0.0012 + 0.0019 * (z - 0.4) ** 2
    step = z**2 / (0.075 * 575.8) / 8.0
    expected = np.hypot(axial, step / np.sqrt(12.0))
    assert np.std(noisy) == pytest.approx(expected, rel=0.1)
    assert np.mean(noisy) == pytest.approx(z, abs=0.002)


def test_kinect_depths_are_those_of_whole_eighths_of_a_pixel() -> None:
    depth = np.full((50, 50), 1.3, dtype=np.float32)
    disparity = 0.075 * 575.8 / add_noise(depth, "kinect", np.random.default_rng(0)) * 8.0
    np.testing.assert_allclose(disparity, np.round(disparity), atol=1e-3)


def test_kinect_noise_frays_edges_and_leaves_the_background_empty() -> None:
    depth = np.full((100, 100), np.nan, dtype=np.float32)
    depth[30:70, 30:70] = 1.0
    seen = np.isfinite(add_noise(depth, "kinect", np.random.default_rng(0)))
    assert seen[35:65, 35:65].all()
    assert not seen[:24].any()
    assert 0.2 < seen[30:70, 30].mean() < 0.8


def test_millimetres_are_whole() -> None:
    depth = np.array([[0.70049, 1.2346, np.nan]], dtype=np.float32)
    noisy = add_noise(depth, "mm", np.random.default_rng(0))
    np.testing.assert_allclose(noisy, [[0.700, 1.235, np.nan]], atol=1e-6)
