"""The numbers of the Kinect are those that the shipped networks were trained with."""

from __future__ import annotations

import numpy as np

from kmn_perception.experiments.faces import axial_noise
from kmn_perception.model.sensor_noise import add_noise

SCALE, STEP = 0.075 * 575.8, 0.125  # pixels times metres, pixels


def test_noise_is_the_same_to_the_last_bit() -> None:
    """Pixel by pixel in Python, in the order in which the random numbers are drawn."""
    depth = np.linspace(0.6, 3.0, 12, dtype=np.float32).reshape(3, 4)
    generator = np.random.default_rng(7)
    expected = np.empty_like(depth)
    for row, column in np.ndindex(depth.shape):
        v = row + int(np.rint(0.8 * generator.standard_normal()))
        u = column + int(np.rint(0.8 * generator.standard_normal()))
        z = float(depth[np.clip(v, 0, 2), np.clip(u, 0, 3)])
        noisy = z + (0.0012 + 0.0019 * (z - 0.4) ** 2) * generator.standard_normal()
        expected[row, column] = SCALE / (np.rint(SCALE / noisy / STEP) * STEP)
    np.testing.assert_array_equal(add_noise(depth, "kinect", np.random.default_rng(7)), expected)


def test_references_weigh_depths_by_the_same_noise() -> None:
    expected = [0.0012, 0.0012 + 0.0019, 0.0012 + 0.0019 * 4.0]
    np.testing.assert_allclose(axial_noise(np.array([0.4, 1.4, 2.4])), expected, rtol=1e-15)
