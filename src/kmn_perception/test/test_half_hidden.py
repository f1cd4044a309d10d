"""Lying cartons that are half hidden: yaws at which a fit may end though they are wrong."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.experiments.upright_box import UprightBox
from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import FreeSpace, Observation
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.model.sensor_noise import add_noise
from kmn_perception.refinement import RefinementSettings, refine

MODEL, SETTINGS = KinematicModel.load("box"), RefinementSettings.load()
CAMERA = replace(Camera.load("kinect_v1"), pose=look_at([0.0, -0.75, 0.65], [0.0, 0.0, 0.0]))
FLOOR = 0.008  # metres, below which points are removed with the table


def half_hidden(random: np.random.Generator) -> tuple[Observation, NDArray[np.float64]]:
    """Return a lying carton behind a standing one, and its parameters."""
    x, y, yaw = random.uniform([-0.05, 0.0, -0.7], [0.05, 0.1, 0.7])
    size = random.uniform([0.15, 0.06, 0.05], [0.28, 0.2, 0.09])
    carton = UprightBox(np.array([x, y, size[2] / 2.0]), size, yaw)
    height = random.uniform(0.15, 0.25)
    place = [*random.uniform([-0.1, -0.18], [0.1, -0.12]), height / 2.0]
    width = np.array([random.uniform(0.06, 0.14), 0.06, height])
    before = UprightBox(np.array(place), width, random.uniform(-0.6, 0.6))
    behind, front = (render(b.unit_cube[None], CAMERA) for b in (carton, before))
    seen = add_noise(np.fmin(behind, front), "kinect", random)
    points = depth_to_points(seen, CAMERA) @ CAMERA.pose[:3, :3].T + CAMERA.position
    with np.errstate(invalid="ignore"):
        own = ~(front < behind) & (np.abs(seen - behind) < 0.03) & (points[..., 2] > FLOOR)
    free = np.where(np.isfinite(front), np.nan_to_num(seen), np.inf).astype(np.float32)
    observation = Observation(
        points[own].astype(np.float32),
        CAMERA,
        FLOOR,
        FreeSpace(free, np.zeros(own.shape, dtype=np.bool_)),
        np.where(own, seen, np.nan).astype(np.float32),
    )
    return observation, np.array([x, y, yaw, *(size / 0.2 - 1.0)])


def starts(
    random: np.random.Generator, truth: NDArray[np.float64]
) -> Iterator[NDArray[np.float64]]:
    """Yield parameters far off in yaw, place and sizes."""
    for turn in (-0.7, -0.5, 0.5, 0.7):
        off = np.array([*random.normal(0.0, 0.04, 2), turn, *random.normal(0.0, 0.25, 3)])
        start = truth + off
        start[3:] = np.clip(start[3:], -0.75, 0.95)
        yield start


@pytest.mark.parametrize("seed", range(10))
def test_a_start_that_is_far_off_does_not_end_in_a_wrong_yaw(seed: int) -> None:
    random = np.random.default_rng(seed)
    observation, truth = half_hidden(random)
    for start in starts(random, truth):
        fit = refine(MODEL, observation, start, SETTINGS, 0.0015)
        assert fit.reason == ""
        off = MODEL.nearest_equivalent(truth, fit.values) - fit.values
        assert abs(off[2]) < min(0.02 + 2.0 * np.sqrt(fit.covariance[2, 2]), np.radians(2.5))


def test_fits_that_explain_as_much_widen_the_deviation() -> None:
    """Here all of them count as equally good, the wrong yaw too."""
    random = np.random.default_rng(0)
    observation, truth = half_hidden(random)
    equal = replace(SETTINGS, misfit=SETTINGS.misfit._replace(boxes_above=0.0, as_good=1.0))
    sure = refine(MODEL, observation, truth, SETTINGS, 0.0015).covariance[2, 2]
    unsure = [
        refine(MODEL, observation, start, equal, 0.0015).covariance[2, 2]
        for start in starts(random, truth)
    ]
    assert max(unsure) > 4.0 * sure
