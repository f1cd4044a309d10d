"""What cannot be known from a view, where it follows from geometry."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.evaluation.information_limit import best_estimate
from kmn_perception.evaluation.observability import unobservable_directions
from kmn_perception.model.camera import Camera, look_at
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import render
from kmn_perception.training.samples import EVALUATION, sample

DOOR, BOX_C = KinematicModel.load("door"), KinematicModel.load("box_c")
X, Y, YAW, LENGTH, HEIGHT = range(5)  # of box C
DOOR_HEIGHT, DOOR_WIDTH, HANDLE_Y, HANDLE_Z = range(3, 7)


def unobservable(
    model: KinematicModel, camera: Camera, truth: NDArray[np.float64]
) -> NDArray[np.float64]:
    image = render(model.unit_cubes(*model.split(truth)), camera)
    return unobservable_directions(model, camera, truth, image)


@pytest.mark.parametrize("name", ["box_a", "box_b", "box_c", "door", "box"])
def test_an_object_entirely_in_view_can_be_known_completely(name: str) -> None:
    model = KinematicModel.load(name)
    truth = 0.1 * model.limits[:, 1]
    assert len(unobservable(model, model.camera, truth)) == 0
    np.testing.assert_array_equal(best_estimate(model, model.camera, truth), truth)


def test_a_door_without_its_top_shows_half_the_height_and_the_handle_only_together() -> None:
    """The handle's height above the ground is (2 + h) / 2 + z; h ends where the top is in view.

    The camera looks level at the door's front, so that rows of pixels are heights.
    """
    camera = replace(DOOR.camera, pose=look_at([-2.0, 0.0, 0.9], [0.0, 0.0, 0.9]))
    truth = np.array([0.0, 0.013, 0.0, -0.07, -0.021, 0.017, -0.0377])
    directions = unobservable(DOOR, camera, truth)
    assert len(directions) == 1
    direction = directions[0] / directions[0, DOOR_HEIGHT]
    np.testing.assert_allclose(direction, [0, 0, 0, 1, 0, 0, -0.5], atol=1e-9)
    # The minimum height with the top above the first row of pixels, at the door's front.
    lowest = 0.9 + (2.0 - 0.019) * camera.cy / camera.fy - 2.0
    middle = (lowest + -0.07 + 2.0 * (-0.0377 + 0.1)) / 2.0  # the highest: handle z is -0.1
    best = best_estimate(DOOR, camera, truth)
    assert best[DOOR_HEIGHT] == pytest.approx(middle, abs=1e-3)
    assert best[HANDLE_Z] == pytest.approx(-0.0377 - (middle + 0.07) / 2.0, abs=1e-3)
    rest = [X, Y, YAW, DOOR_WIDTH, HANDLE_Y]
    np.testing.assert_array_equal(best[rest], truth[rest])


def test_a_box_with_one_end_out_of_view_shows_only_its_other_end() -> None:
    """Box C along y before the camera's side: its far end at y + 0.2 (1 + s) stays where it is."""
    camera = replace(BOX_C.camera, pose=look_at([0.9, 0.45, 0.6], [0.0, 0.45, 0.05]))
    truth = np.array([0.0, 0.0, 0.0, 0.1, 0.2])
    directions = unobservable(BOX_C, camera, truth)
    assert len(directions) == 1
    direction = directions[0] / directions[0, LENGTH]
    np.testing.assert_allclose(direction, [0.0, -0.2, 0.0, 1.0, 0.0], atol=1e-9)
    best = best_estimate(BOX_C, camera, truth)
    assert best[Y] + 0.2 * best[LENGTH] == pytest.approx(0.2 * 0.1)
    assert best[LENGTH] > truth[LENGTH]  # there is more room for long boxes


def test_a_handle_out_of_view_is_best_put_in_the_middle() -> None:
    """The camera sees only the door's upper end; the handle's limits lie entirely out of view."""
    camera = replace(DOOR.camera, pose=look_at([-1.4, 0.0, 2.0], [0.0, 0.0, 2.0]))
    truth = np.array([0.0, 0.0, 0.0, 0.05, -0.1, 0.03, -0.08])
    directions = unobservable(DOOR, camera, truth)
    assert {tuple(np.flatnonzero(np.abs(row) > 1e-9)) for row in directions} == {
        (HANDLE_Y,),
        (HANDLE_Z,),
    }
    best = best_estimate(DOOR, camera, truth)
    np.testing.assert_allclose(best, [*truth[:5], 0.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("name", ["box_c", "door"])
def test_the_best_estimate_looks_like_the_truth_and_lies_within_the_limits(name: str) -> None:
    model, hidden = KinematicModel.load(name), 0
    for index in range(40):
        observation, truth = sample(model, 5, index, spawn_key=EVALUATION)
        best = best_estimate(model, observation.camera, truth)
        assert (model.limits[:, 0] <= best).all() and (best <= model.limits[:, 1]).all()
        true_image, image = (
            render(model.unit_cubes(*model.split(values)), observation.camera)
            for values in (truth, best)
        )
        np.testing.assert_allclose(image, true_image, atol=1e-5)
        hidden += not np.array_equal(best, truth)
    assert 0 < hidden < 20
