"""What is known of objects beside the one that is opened, and where they are obstacles."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.other_objects import MAX_OBJECTS, OtherObjects, UnknownModelError
from kmn_skill.planning.surroundings import Obstacle

DRAWER, CUPBOARD = KinematicModel.load("drawer"), KinematicModel.load("cupboard_door")
OPENED = np.array([0.1, 0.3, 0.2, 0.05, -0.1, 0.02, 0.0, 0.01])
BESIDE = np.array([0.2, -0.4, 0.3, 0.1, -0.05, 0.02, 0.1])


def seen(
    values: NDArray[np.float64] = BESIDE, model: KinematicModel = CUPBOARD, **changes: Any
) -> DoorObservation:
    names = tuple(parameter.name for parameter in model.parameters)
    covariance = 1e-6 * np.eye(len(values))
    told = DoorObservation(1.0, model.name, "world", names, values, covariance, "", number=2)
    return told._replace(**changes)


def known(*observations: DoorObservation) -> OtherObjects:
    made = OtherObjects(DRAWER, "world", 0.1)
    for observation in observations:
        made.add(observation)
    return made


def around(*observations: DoorObservation) -> tuple[Obstacle, ...]:
    """Return the obstacles around a drawer."""
    return known(*observations).around(DRAWER, OPENED)


@pytest.mark.parametrize("hinge", [0.0, -0.7])
def test_the_bodies_of_another_object_are_obstacles_where_they_are_seen(hinge: float) -> None:
    found = around(seen(joints={"hinge": hinge}))
    assert [each.name for each in found] == [
        "cupboard_door_2/cupboard",
        "cupboard_door_2/panel",
        "cupboard_door_2/bar",
    ]
    pose = DRAWER.transformation.matrix(OPENED[:3])
    expected = CUPBOARD.moved_cubes(BESIDE, {"hinge": hinge})
    for each, cube in zip(found, expected, strict=True):
        assert each.rotation is not None
        assert each.rotation.T @ each.rotation == pytest.approx(np.eye(3))
        told = np.eye(4)
        told[:3, :3], told[:3, 3] = each.rotation * each.size, each.centre
        assert pose @ told == pytest.approx(cube)


@pytest.mark.parametrize("position", [np.nan, np.inf, 0.4, -1e9])
def test_a_joint_is_taken_to_be_within_its_limits(position: float) -> None:
    bodies = np.array([each.centre for each in around(seen(joints={"hinge": position}))])
    assert np.isfinite(bodies).all()
    expected = around(seen(joints={"hinge": -1.57 if position == -1e9 else 0.0}))
    assert bodies == pytest.approx(np.array([each.centre for each in expected]))


@pytest.mark.parametrize(("model", "number"), [("drawer", 2), ("drawer", 7), ("cupboard_door", 3)])
def test_the_object_itself_is_no_obstacle_under_any_name(model: str, number: int) -> None:
    kinematic = KinematicModel.load(model)
    values = np.array([*OPENED[:3], *np.zeros(len(kinematic.gamma))])
    assert around(seen(values, kinematic, number=number)) == ()


@pytest.mark.parametrize(
    ("name", "opened"),
    [
        ("door", -0.31),
        ("door", -0.9),
        ("room_door", -0.5),
        ("cupboard_door", -1.2),
        ("drawer", 0.2),
    ],
)
@pytest.mark.parametrize("off", [0.0, 0.08])
def test_the_object_itself_is_no_obstacle_where_it_is_seen_open(
    name: str, opened: float, off: float
) -> None:
    model = KinematicModel.load(name)
    joint, theta = model.actions[0].joint, np.array([-0.7, -0.4, 0.6])
    gamma = np.zeros(len(model.gamma))
    pose = model.transformation.matrix(theta) @ joint.motion(gamma, opened)
    askew = model.transformation.read_back(pose) + [off, -off, 0.0]  # as if it was closed
    others = OtherObjects(model, "world", 10.0)
    others.add(seen(np.array([*askew, *gamma]), model))
    assert others.around(model, np.array([*theta, *gamma])) == ()


@pytest.mark.parametrize("name", ["door", "room_door", "cupboard_door", "drawer"])
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("turned", [0.0, -0.3, 0.3])
def test_another_object_of_the_same_model_that_touches_it_is_an_obstacle(
    name: str, side: float, turned: float
) -> None:
    model = KinematicModel.load(name)
    gamma = np.zeros(len(model.gamma))
    cubes = model.unit_cubes(np.zeros(3), gamma)
    width = max(float(np.linalg.norm(cube[:3, 1])) for cube in cubes)
    others = OtherObjects(model, "world", 10.0)
    others.add(seen(np.array([0.0, side * width, turned, *gamma]), model))
    assert len(others.around(model, np.array([0.0, 0.0, 0.0, *gamma]))) == len(model.bodies)


def test_a_low_cabinet_before_a_tall_one_is_no_drawer_pulled_out_of_it() -> None:
    low, tall = np.zeros((2, len(DRAWER.parameters)))
    names = [parameter.name for parameter in DRAWER.parameters]
    low[names.index("height")], tall[names.index("height")] = -0.15, 0.15
    depth = float(np.linalg.norm(DRAWER.unit_cubes(*DRAWER.split(tall))[0][:3, 0]))
    low[0] = -depth - 0.02
    others = OtherObjects(DRAWER, "world", 10.0)
    others.add(seen(low, DRAWER))
    assert len(others.around(DRAWER, tall)) == len(DRAWER.bodies)


def test_another_object_of_the_same_model_is_an_obstacle() -> None:
    beside = OPENED + [0.0, -0.65, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert len(around(seen(beside, DRAWER), seen(OPENED, DRAWER, number=1))) == 3


def test_the_newest_observation_of_an_object_counts() -> None:
    moved = BESIDE + [0.0, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0]
    (_, _, bar), (*_, newer) = around(seen()), around(seen(), seen(moved, time=2.0))
    assert np.linalg.norm(newer.centre - bar.centre) == pytest.approx(0.1)
    assert len(around(seen(), seen(moved, number=3))) == 6


@pytest.mark.parametrize(
    "changes",
    [
        {"problem": "it is not sure"},
        {"frame": "camera"},
        {"names": ("x",)},
        {"values": np.full(7, np.nan)},
        {"values": BESIDE[:4]},
        {"values": 1e300 * np.ones(7)},
        {"covariance": np.zeros((0, 0))},
    ],
)
def test_what_is_not_told_for_sure_is_no_obstacle(changes: dict[str, Any]) -> None:
    assert around(seen(**changes)) == ()


@pytest.mark.parametrize(
    "name", ["", "no_such_thing", "/dev/zero", "../models/lid", "lid.yaml", "\0", "a" * 10000]
)
def test_a_model_without_a_file_is_told(name: str) -> None:
    others = known()
    with pytest.raises(UnknownModelError):
        others.add(seen(model=CUPBOARD)._replace(model=name))
    assert others.around(DRAWER, OPENED) == ()


def test_objects_are_forgotten_when_they_are_too_old_or_of_another_world() -> None:
    others = known(seen(), seen(time=3.0, number=3))
    others.forget_older(4.0, 2.0)
    assert {each.name[:15] for each in others.around(DRAWER, OPENED)} == {"cupboard_door_3"}
    others.forget(5.0)
    others.add(seen(time=4.9))  # came late
    assert others.around(DRAWER, OPENED) == ()
    others.add(seen(time=5.1))
    assert others.around(DRAWER, OPENED)


def test_no_more_objects_are_kept_than_can_be() -> None:
    others = known(*(seen(number=number) for number in range(2 * MAX_OBJECTS)))
    names = {each.name.split("/")[0] for each in others.around(DRAWER, OPENED)}
    assert names == {f"cupboard_door_{n}" for n in range(MAX_OBJECTS, 2 * MAX_OBJECTS)}
