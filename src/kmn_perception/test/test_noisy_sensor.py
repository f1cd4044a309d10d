"""Depth sensors by their files: the statistics of their errors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import SENSORS, NoisySensor

FX = 385.9
D455 = DepthSensor.load("d455")


def plane(z: float, shape: tuple[int, int] = (480, 640)) -> NDArray[np.float32]:
    """Return the depth image of a plane that faces the camera."""
    return np.full(shape, z, dtype=np.float32)


def measure(depth: NDArray[np.float32], sensor: DepthSensor = D455, seed: int = 0,
            offset: float = 0.0) -> NDArray[np.float32]:  # fmt: skip
    return NoisySensor(sensor, seed, offset).measure(depth, FX)


@pytest.mark.parametrize(
    ("z", "pixel", "block"), [(1.5, 6.5, 2.0), (2.0, 13.0, 4.0), (2.3, 16.0, 5.0)]
)
def test_a_d455_has_the_noise_of_the_real_frames(z: float, pixel: float, block: float) -> None:
    """Of single pixels, and of the means of 40 x 40 pixels, in mm."""
    error = 1e3 * (measure(plane(z)) - z)
    means = [np.nanmean(error[v : v + 40, u : u + 40])
             for v in range(0, 480, 40) for u in range(0, 640, 40)]  # fmt: skip
    assert np.nanstd(error) == pytest.approx(pixel, rel=0.15)
    assert np.std(means) == pytest.approx(block, rel=0.15)
    assert np.mean(means) == pytest.approx(0.0, abs=0.2 * block)


def test_the_noise_of_neighbours_is_alike_by_the_stated_length() -> None:
    """The correlation of a Gaussian that smooths: exp(-(distance / length)^2)."""
    error = measure(plane(2.0)) - 2.0
    share, length = D455.axial.correlation
    for distance in (4, 8, 16):
        product = np.nanmean(error[:, distance:] * error[:, :-distance]) / np.nanvar(error)
        assert product == pytest.approx(share * np.exp(-((distance / length) ** 2)), abs=0.05)


def test_depths_are_those_of_whole_steps_of_the_disparity() -> None:
    disparity = D455.disparity.scale / measure(plane(2.0)).astype(np.float64)
    steps = disparity[np.isfinite(disparity)] / D455.disparity.step
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-3)


def test_an_error_of_calibration_is_one_of_the_inverse_depth() -> None:
    for z in (1.0, 3.0):
        seen = measure(plane(z), offset=0.03)
        assert np.nanmean(1.0 / seen) == pytest.approx(1.0 / z - 0.03, abs=1e-3)


def test_borders_and_what_is_out_of_range_are_not_measured() -> None:
    inside = np.zeros((480, 640), dtype=bool)
    inside[8:-8, 8:-8] = True
    missing = np.mean([np.isnan(measure(plane(2.0), seed=seed)) for seed in range(30)], axis=0)
    assert missing[inside].mean() < 0.03
    assert missing[0].mean() > 0.8 and missing[:, -1].mean() > 0.8
    assert np.isnan(measure(plane(0.3))).all()
    assert np.isnan(measure(plane(15.0))).all()


def test_what_is_nearer_grows_over_what_is_behind() -> None:
    depth = plane(2.0)
    depth[200:280, 300:340] = 1.0
    share = np.mean([measure(depth, seed=seed) < 1.5 for seed in range(20)], axis=0)
    column = share[210:270].mean(axis=0)
    assert column[310:330].min() > 0.9
    grown = column[280:300].sum() + column[340:360].sum()
    assert 2.0 < grown < 6.0  # pixels, of both sides, 2 on each
    assert column[:290].max() == 0.0


def test_lines_are_lost_where_the_alignment_stretches() -> None:
    """As many pixels as the disparity to the left camera changes over the image."""
    depth = np.linspace(1.0, 4.0, 640, dtype=np.float32) + np.zeros((480, 1), dtype=np.float32)
    quiet = D455._replace(
        axial=D455.axial._replace(inverse=0.0), holes=D455.holes._replace(fraction=0.0), border=0
    )
    lost = np.isnan(measure(depth, quiet)).sum(axis=1).mean()
    assert lost == pytest.approx(FX * 0.059 * (1.0 - 0.25), abs=1.5)


@pytest.mark.parametrize("name", SENSORS.values())
def test_sensors_repeat_their_noise_by_the_seed(name: str) -> None:
    depth, sensor = plane(1.5, (120, 160)), DepthSensor.load(name)
    first, again, other = (measure(depth, sensor, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other, equal_nan=True)


def test_a_sensor_without_that_noise_says_so() -> None:
    with pytest.raises(ValueError, match="must state axial: nguyen"):
        D455.nguyen  # noqa: B018
