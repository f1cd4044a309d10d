"""Only parameters that are fresh, valid, in agreement and certain enough are relied upon."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_observation import DoorObservation, when_closed
from kmn_skill.execution.errors import DoorError
from kmn_skill.execution.grasp_quantities import grasp_deviations, grasp_quantities
from kmn_skill.execution.perceived_door import AcceptanceSettings, PerceivedDoor

MODEL = KinematicModel.load("door")
NAMES = tuple(parameter.name for parameter in MODEL.parameters)
VALUES = np.array([0.1, -0.2, 0.3, 0.05, -0.1, 0.01, 0.02])
SETTINGS = AcceptanceSettings(
    max_age=1.0,
    min_consistent_frames=3,
    max_distance=0.02,
    max_angle=0.03,
    max_handle_std=0.02,
    max_hinge_std=0.02,
    max_yaw_std=0.03,
    need_covariance=False,
    limit_margin=0.1,
)


def seen(time: float, values: NDArray[np.float64] = VALUES, **changes: Any) -> DoorObservation:
    covariance = 1e-6 * np.eye(len(values))
    return DoorObservation(time, "door", "world", NAMES, values, covariance, "")._replace(**changes)


def door(*observations: DoorObservation, **settings: Any) -> PerceivedDoor:
    made = PerceivedDoor(MODEL, "world", replace(SETTINGS, **settings))
    for observation in observations:
        made.add(observation)
    return made


def reason(perceived: PerceivedDoor, now: float = 0.3) -> str:
    with pytest.raises(DoorError) as raised:
        perceived.values(now)
    assert len(str(raised.value)) > 10
    return raised.value.reason


def test_the_mean_of_frames_that_agree_is_taken() -> None:
    offset = np.array([0.003, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    frames = [seen(0.1, VALUES - offset), seen(0.2), seen(0.3, VALUES + offset)]
    np.testing.assert_allclose(door(*frames).values(0.3), VALUES)


def test_the_recess_is_that_of_the_last_usable_frame_until_another_world() -> None:
    perceived = door(seen(0.1), seen(0.2, recess=0.03), seen(0.3))
    assert perceived.recess == 0.03
    with pytest.raises(DoorError):
        perceived.add(seen(0.4, recess=0.09, problem="hidden"))
    assert perceived.recess == 0.03
    perceived.forget(0.5)
    assert np.isnan(perceived.recess)


def test_without_any_there_is_no_door() -> None:
    assert reason(door()) == "none"


@pytest.mark.parametrize(("now", "key"), [(1.4, "stale"), (-0.8, "future")])
def test_old_ones_and_those_of_another_clock_are_not_taken(now: float, key: str) -> None:
    assert reason(door(seen(0.1), seen(0.2), seen(0.3)), now) == key


def test_several_exposures_are_needed() -> None:
    assert reason(door(seen(0.3), seen(0.3), seen(0.3))) == "few_frames"


@pytest.mark.parametrize("wrong", [(0, 0.03), (2, 0.05), (6, 0.03)])
def test_frames_that_disagree_are_not_taken(wrong: tuple[int, float]) -> None:
    other = VALUES.copy()
    other[wrong[0]] += wrong[1]
    perceived = door(seen(0.1), seen(0.2), seen(0.3, other))
    assert reason(perceived) == "disagreement"
    for time in (0.4, 0.5):
        perceived.add(seen(time, other))
    np.testing.assert_allclose(perceived.values(0.5), other)


def test_a_clock_that_was_set_back_is_another_world() -> None:
    assert reason(door(seen(10.1), seen(10.2), seen(10.3), seen(0.1), seen(0.2))) == "few_frames"


def test_what_is_forgotten_must_be_seen_anew() -> None:
    perceived = door(seen(0.1), seen(0.2), seen(0.3))
    perceived.forget(0.5)
    assert reason(perceived) == "none"
    perceived.add(seen(0.4))  # came late
    assert reason(perceived) == "none"
    other = VALUES.copy()
    other[1] += 0.05
    for time in (0.5, 0.6, 0.7):
        perceived.add(seen(time, other))
    np.testing.assert_allclose(perceived.values(0.7), other)


BAD = {
    "model": {"model": "box_a"},
    "status": {"problem": "TOO_FEW_POINTS: 3 points"},
    "frame": {"frame": "camera"},
    "names": {"names": NAMES[::-1]},
    "not_finite": {"values": VALUES * np.array([1, 1, np.nan, 1, 1, 1, 1])},
    "out_of_limits": {"values": VALUES + np.array([0.9, 0, 0, 0, 0, 0, 0])},
}


@pytest.mark.parametrize("key", BAD)
def test_a_bad_one_is_refused_and_parts_those_before_from_those_after(key: str) -> None:
    perceived = door(seen(0.1), seen(0.2), seen(0.3))
    with pytest.raises(DoorError) as raised:
        perceived.add(seen(0.4, **BAD[key]))  # type: ignore[arg-type]
    assert raised.value.reason == key
    assert reason(perceived, 0.4) == key
    perceived.add(seen(0.5))
    assert reason(perceived, 0.5) == "few_frames"


def test_lists_of_wrong_lengths_are_refused() -> None:
    for changes in ({"values": VALUES[:3]}, {"covariance": np.zeros(4)}):
        with pytest.raises(DoorError, match="expected x, y, yaw"):
            door(seen(0.1, **changes))


def test_an_unknown_covariance_is_refused_only_where_it_is_needed() -> None:
    unknown = np.full((7, 7), np.nan)
    frames = [seen(time, covariance=unknown) for time in (0.1, 0.2, 0.3)]
    np.testing.assert_allclose(door(*frames).values(0.3), VALUES)
    assert reason(door(*frames, need_covariance=True)) == "covariance"


def test_what_the_view_leaves_open_counts_only_where_the_grasp_needs_it() -> None:
    # The top is out of view: half the door's height plus the handle's offset is known all the same.
    open_direction = np.array([0.0, 0.0, 0.0, 2.0, 0.0, 0.0, -1.0])
    covariance = 1e-6 * np.eye(7) + 0.01 * np.outer(open_direction, open_direction)
    frames = [seen(time, covariance=covariance) for time in (0.1, 0.2, 0.3)]
    np.testing.assert_allclose(door(*frames).values(0.3), VALUES)
    covariance = 1e-6 * np.eye(7) + np.diag([0, 0, 0, 0, 0, 0, 0.01])
    assert reason(door(*(f._replace(covariance=covariance) for f in frames))) == "uncertain"


def test_deviations_are_those_of_samples() -> None:
    root = np.random.default_rng(0).normal(0.0, 0.002, (7, 7))
    samples = np.random.default_rng(1).multivariate_normal(VALUES, root @ root.T, 20000)
    spread = np.cov([grasp_quantities(MODEL, each) for each in samples], rowvar=False)
    expected = [
        np.sqrt(np.linalg.eigvalsh(spread[part, part])[-1])
        for part in (slice(0, 3), slice(3, 5), slice(5, 6))
    ]
    np.testing.assert_allclose(grasp_deviations(MODEL, VALUES, root @ root.T), expected, rtol=0.02)


@pytest.mark.parametrize("angle", [-0.5, 0.2])
def test_a_door_seen_ajar_is_shut_again(angle: float) -> None:
    # The panel of the closed door, turned about the hinge, is the panel of the parameters seen.
    panel = MODEL.moved_cubes(VALUES, {"hinge": angle})[0]
    theta, gamma = MODEL.split(VALUES)
    local = np.linalg.inv(MODEL.transformation.matrix(theta)) @ MODEL.unit_cubes(theta, gamma)[0]
    ajar = MODEL.transformation.read_back(panel @ np.linalg.inv(local))
    as_seen = np.concatenate([ajar, gamma])
    np.testing.assert_allclose(MODEL.unit_cubes(ajar, gamma)[0], panel, atol=1e-12)
    np.testing.assert_allclose(when_closed(MODEL, as_seen, angle), VALUES, atol=1e-12)


def test_a_body_moves_on_a_circle_about_its_joint() -> None:
    theta, gamma = MODEL.split(VALUES)
    hinge = MODEL.transformation.matrix(theta) @ [*MODEL.joints[0].origin(gamma), 1.0]
    for angle in (-0.9, 0.4):
        shut, moved = (MODEL.moved_cubes(VALUES, {"hinge": a})[1][:2, 3] for a in (0.0, angle))
        before, after = (complex(*(place - hinge[:2])) for place in (shut, moved))
        assert np.angle(after / before) == pytest.approx(angle)
        assert abs(after) == pytest.approx(abs(before))
    pressed = MODEL.moved_cubes(VALUES, {"handle": -0.7})[1]
    assert pressed[2, 3] < MODEL.moved_cubes(VALUES, {})[1][2, 3] - 0.01  # downwards


def lacking(time: float, values: NDArray[np.float64] = VALUES, **changes: Any) -> DoorObservation:
    return seen(time, values, problem="no handle is seen", lacks_handle=True, **changes)


def test_a_door_without_a_handle_is_not_relied_upon_but_tells_where_to_look() -> None:
    made = door()
    for time in range(3):
        assert made.without_handle(float(time)) is None
        with pytest.raises(DoorError, match="no handle is seen") as raised:
            made.add(lacking(float(time), VALUES + 0.001 * time))
        assert raised.value.reason == "handle_not_seen"
    assert made.without_handle(2.0) == pytest.approx(VALUES + 0.001)
    assert made.without_handle(3.5) is None  # too old
    made.add(seen(3.0))
    assert made.without_handle(3.0) is None


@pytest.mark.parametrize("wrong", [{"frame": "map"}, {"values": np.full(7, np.nan)}])
def test_what_lacks_more_than_its_handle_tells_nothing(wrong: dict[str, Any]) -> None:
    made = door()
    for time in range(3):
        with pytest.raises(DoorError):
            made.add(lacking(float(time))._replace(**wrong))
    assert made.without_handle(2.0) is None


def test_only_the_object_that_is_chosen_is_relied_on() -> None:
    door = PerceivedDoor(MODEL, "world", SETTINGS)
    other = VALUES + [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    for time in (0.0, 0.1, 0.2, 0.3, 0.4):
        door.add(seen(time, VALUES, number=1))
    assert door.choose(2)  # what was seen before may be of others
    with pytest.raises(DoorError, match="no morphing parameters came yet"):
        door.values(0.4)
    door.add(seen(0.45, VALUES, number=1))
    with pytest.raises(DoorError, match="object 2 is not told any more; the last one .* is 1"):
        door.values(0.45)
    for time in (0.5, 0.6, 0.7, 0.8, 0.9):
        door.add(seen(time, VALUES, number=1))
        door.add(seen(time, other, number=2))
    np.testing.assert_allclose(door.values(0.9), other)
    assert not door.choose(2)
    assert not door.choose(0)
    np.testing.assert_allclose(door.values(0.9), other)


FOREIGN: dict[str, Any] = {"model": "box_a", "number": 2}


@pytest.mark.parametrize("beside", [FOREIGN, {**FOREIGN, "problem": "x is outside"}])
def test_what_stands_beside_the_door_breaks_nothing(beside: dict[str, Any]) -> None:
    """Several models in one morph_node: each frame tells of their objects by turns."""
    perceived = door()
    for time in (0.1, 0.2, 0.3):
        perceived.add(seen(time, number=1))
        perceived.add(seen(time, **beside))
    np.testing.assert_allclose(perceived.values(0.3), VALUES)


@pytest.mark.parametrize("number", [0, 1])
def test_the_same_object_as_another_model_is_not_relied_on(number: int) -> None:
    perceived = door(*(seen(time, number=number) for time in (0.1, 0.2, 0.3)))
    with pytest.raises(DoorError, match="are of model 'box_a', expected 'door'"):
        perceived.add(seen(0.4, model="box_a", number=number))
    assert reason(perceived, 0.4) == "model"


def test_what_stood_beside_a_door_that_is_gone_is_told() -> None:
    perceived = door(*(seen(time, number=1) for time in (0.1, 0.2, 0.3)))
    with pytest.raises(DoorError):
        perceived.add(seen(1.5, **FOREIGN))
    assert reason(perceived, 1.5) == "model"


def test_the_chosen_object_is_not_relied_on_as_another_model() -> None:
    perceived = door()
    perceived.choose(2)
    with pytest.raises(DoorError):
        perceived.add(seen(0.1, **FOREIGN))
    perceived.add(seen(0.1, number=1))
    assert reason(perceived, 0.1) == "model"


def test_why_an_object_of_another_model_is_refused_is_told_with_the_model() -> None:
    with pytest.raises(DoorError, match="'box_a', expected 'door'; x is outside") as raised:
        door(seen(0.1, **FOREIGN, problem="x is outside"))
    assert raised.value.reason == "status"
