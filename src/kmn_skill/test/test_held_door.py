"""A hand tells the angles of the door that it holds; the planner's world is who knows better."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.errors import BlockedHandError, ExecutionError
from kmn_skill.execution.grasp_quantities import (
    HANDLE_POSITION,
    grasp_quantities,
    with_handle_moved,
)
from kmn_skill.execution.held_door import DoorAngles, GripSettings, HeldDoor
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.world import CONTACTS, World

VALUES = np.array([0.3, -0.5, 0.7, -0.2, 0.15, 0.02, -0.06])
ACTION = KinematicModel.load("door").actions[0]
ROBOT = np.zeros(11)
CLOSED = np.zeros(2)
PAD_WIDTH = 0.0255
SETTINGS = GripSettings(max_grip_change=0.5, resume_distance=0.02)


class Fingers:
    """A hand of which the test says where its fingers are."""

    def __init__(self) -> None:
        self.pads: NDArray[np.float64] = np.zeros((2, 3))

    def __call__(self, robot: NDArray[np.float64]) -> NDArray[np.float64]:
        return self.pads


class Scene(NamedTuple):
    """A door in the planner's world, and who tells its angles."""

    world: World
    fingers: Fingers
    held: HeldDoor

    def move(self, hinge: float, handle: float, offset: float = 0.0) -> None:
        """Move the door with the fingers at its handle, or metres beside it on the lever."""
        configuration = np.array([[*ROBOT, hinge, handle]])
        contacts = self.world.poses(configuration, list(CONTACTS))[0]
        self.fingers.pads = contacts[:, :3, 3] + offset * contacts[:, :3, 1]

    def angles(self) -> DoorAngles:
        return self.held.angles(ROBOT)


@pytest.fixture(scope="module")
def model() -> KinematicModel:
    return KinematicModel.load("door")


@pytest.fixture
def scene(model: KinematicModel) -> Scene:
    fingers = Fingers()
    held = HeldDoor(model, ACTION, fingers, PAD_WIDTH, SETTINGS)
    held.see(VALUES, 0.0)
    return Scene(World(PlanningSetup.load(model), *model.split(VALUES)), fingers, held)


def test_a_door_that_nobody_holds_is_as_it_was_seen(scene: Scene) -> None:
    scene.held.see(VALUES, 0.1)
    scene.move(-0.5, -0.5)
    assert scene.angles() == (0.1, 0.0)


@pytest.mark.parametrize("seen", [0.0, -0.2])
@pytest.mark.parametrize("offset", [0.0, 0.02])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_angles_are_those_of_the_handle_in_the_hand(
    scene: Scene, seen: float, offset: float, side: float
) -> None:
    """Wherever on the lever the fingers took it."""
    scene.held.see(VALUES, seen)
    scene.move(seen, 0.0, offset)
    scene.held.grasp(ROBOT, np.array([seen, 0.0]))
    assert scene.angles() == pytest.approx((seen, 0.0), abs=1e-9)
    for part in np.linspace(0.0, 1.0, 20):
        scene.move(seen, -0.7 * part, offset)
        assert scene.angles() == pytest.approx((seen, -0.7 * part), abs=1e-6)
    for part in np.linspace(0.0, 1.0, 40):
        scene.move(seen + side * part, -0.7, offset)
        assert scene.angles() == pytest.approx((seen + side * part, -0.7), abs=1e-6)


def test_doors_believed_some_centimetres_off_are_told_within_two_degrees(scene: Scene) -> None:
    spread = [0.01, 0.01, 0.02, 0.01, 0.01, 0.005, 0.01]
    errors = []
    for seed in range(20):
        off = np.random.default_rng(seed).normal(scale=spread)
        scene.held.see(VALUES + off, 0.0)
        scene.move(0.0, 0.0)
        scene.held.grasp(ROBOT, CLOSED)
        for hinge in np.linspace(0.0, -0.9, 10):
            scene.move(hinge, -0.7)
            found = scene.angles().hinge
        errors.append(abs(found - hinge))
    assert np.median(errors) < np.radians(2.0)
    assert max(errors) < np.radians(5.0)


def test_a_door_that_was_let_go_stays_and_its_handle_springs_back(scene: Scene) -> None:
    scene.move(0.0, 0.0)
    scene.held.grasp(ROBOT, CLOSED)
    scene.move(-0.4, -0.6)
    scene.angles()
    scene.held.let_go()
    scene.move(0.0, 0.0)
    assert scene.angles() == pytest.approx((-0.4, 0.0), abs=1e-6)
    scene.move(-0.4, 0.0)
    scene.held.grasp(ROBOT, np.array([-0.4, 0.0]))
    scene.move(-0.8, -0.3)
    assert scene.angles() == pytest.approx((-0.8, -0.3), abs=1e-6)


def test_the_handle_of_a_door_moves_on_across_the_line_to_its_hinge(
    scene: Scene, model: KinematicModel
) -> None:
    """As the planner's world has it, and level: no door about a vertical axis falls shut."""
    scene.held.see(VALUES, 0.0)
    for hinge, further in ((-0.5, -0.501), (0.5, 0.501)):
        scene.move(hinge, 0.0)
        here = scene.fingers.pads.mean(axis=0)
        scene.move(further, 0.0)
        way = scene.fingers.pads.mean(axis=0) - here
        assert scene.held.way(hinge) == pytest.approx(way / np.linalg.norm(way), abs=1e-3)
        assert not scene.held.falls_shut(hinge)


@pytest.mark.parametrize("turn", [2.5, 3.0, 3.5])
def test_a_hand_that_slid_past_the_spindle_tells_no_angle_that_cannot_be(
    scene: Scene, turn: float
) -> None:
    scene.held.see(np.zeros(7), 0.0)
    place = ACTION.grasp.place(np.zeros(4))
    pads = np.array([[*place], [*place]]) + [[0.0, 0.0, 0.025], [0.0, 0.0, -0.025]]
    scene.fingers.pads = pads
    scene.held.grasp(ROBOT, CLOSED)
    scene.fingers.pads = pads + 0.2 * np.array([0.0, np.cos(turn), np.sin(turn)])
    found = scene.angles()
    assert -1.2 <= found.handle <= 0.3
    assert found.hinge == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("part", [0.4, 1.6])
def test_fingers_that_close_or_open_have_lost_the_handle(scene: Scene, part: float) -> None:
    scene.move(0.0, 0.0)
    scene.held.grasp(ROBOT, CLOSED)
    scene.move(-0.4, -0.6)
    pads, middle = scene.fingers.pads, scene.fingers.pads.mean(axis=0)
    scene.fingers.pads = middle + 0.6 * (pads - middle)  # a soft grip
    assert scene.angles() == pytest.approx((-0.4, -0.6), abs=1e-6)
    scene.fingers.pads = middle + part * (pads - middle)
    with pytest.raises(
        ExecutionError, match=r"fingers are 0\.\d+ m apart, 0\.050 m when"
    ) as raised:
        scene.angles()
    assert raised.value.reason == "slipped"
    assert scene.angles() == pytest.approx((-0.4, 0.0), abs=1e-6)


@pytest.mark.parametrize("hinge", [-0.9, -0.3, 0.0, 0.5, 1.2])
def test_a_hand_that_still_has_the_handle_tells_the_angles_after_a_restart(
    scene: Scene, model: KinematicModel, hinge: float
) -> None:
    scene.move(0.0, 0.0, 0.01)
    scene.held.grasp(ROBOT, CLOSED)
    grip = scene.held.grip
    assert grip is not None
    later = HeldDoor(model, ACTION, scene.fingers, PAD_WIDTH, SETTINGS)
    scene.move(hinge, -0.5, 0.01)
    assert later.resume(VALUES, grip, ROBOT)
    assert later.angles(ROBOT) == pytest.approx((hinge, -0.5), abs=1e-5)


@pytest.mark.parametrize("away", [(0.0, 0.0, 0.05), (-0.2, 0.1, 0.3)])
def test_a_hand_that_is_elsewhere_does_not_hold_the_handle_any_more(
    scene: Scene, model: KinematicModel, away: tuple[float, float, float]
) -> None:
    scene.move(0.0, 0.0)
    scene.held.grasp(ROBOT, CLOSED)
    assert scene.held.grip is not None
    later = HeldDoor(model, ACTION, scene.fingers, PAD_WIDTH, SETTINGS)
    scene.fingers.pads += away
    assert not later.resume(VALUES, scene.held.grip, ROBOT)
    assert later.grip is None
    assert later.angles(ROBOT) == (0.0, 0.0)


@pytest.mark.parametrize("part", [0.0, 0.4, 1.6])
def test_fingers_that_are_not_as_far_apart_as_the_handle_is_thick_have_missed_it(
    scene: Scene, part: float
) -> None:
    scene.move(0.0, 0.0)
    middle = scene.fingers.pads.mean(axis=0)
    scene.fingers.pads = middle + part * (scene.fingers.pads - middle)
    with pytest.raises(ExecutionError, match=r"apart, the handle is 0\.050 m thick") as raised:
        scene.held.grasp(ROBOT, CLOSED)
    assert raised.value.reason == "missed_handle"
    assert scene.held.grip is None


def test_a_hand_that_is_already_on_its_way_took_the_handle_where_it_is_planned_to_be(
    scene: Scene,
) -> None:
    scene.move(0.0, -0.5)
    scene.held.grasp(ROBOT, np.array([0.0, -0.5]))
    assert scene.angles() == pytest.approx((0.0, -0.5), abs=1e-6)
    scene.move(-0.3, -0.7)
    assert scene.angles() == pytest.approx((-0.3, -0.7), abs=1e-6)


@pytest.mark.parametrize("covariance", [np.full((7, 7), np.nan), np.diag(np.arange(1.0, 8.0))])
def test_a_hand_that_stands_before_it_has_closed_tells_where_the_handle_must_be(
    scene: Scene, model: KinematicModel, covariance: NDArray[np.float64]
) -> None:
    """The lower finger of a hand that came 15 mm too high stands at a lever that cannot go up."""
    scene.move(0.0, 0.0)
    scene.fingers.pads[:, 2] += [0.015, -0.015]
    with pytest.raises(BlockedHandError, match=r"0\.080 m apart") as raised:
        scene.held.grasp(ROBOT, CLOSED)
    offset = raised.value.offset(None)
    np.testing.assert_allclose(offset, [0.0, 0.0, -0.015], atol=1e-9)
    felt = with_handle_moved(model, VALUES, covariance, offset)
    before, after = (grasp_quantities(model, each) for each in (VALUES, felt))
    moved = (after - before)[HANDLE_POSITION]
    np.testing.assert_allclose(moved, [0.0, 0.0, -0.015], atol=1e-4)


def test_a_hand_that_holds_a_lever_slantwise_came_too_low(
    scene: Scene, model: KinematicModel
) -> None:
    """Its upper finger pressed the lever until edges of both held it: a lower place is worse."""
    scene.move(0.0, 0.0)
    rest, slant = scene.fingers.pads, 0.7
    _, gamma = model.split(VALUES)
    assert ACTION.unlatch is not None
    lever = abs(ACTION.grasp.place(gamma) - ACTION.unlatch.origin(gamma))[1]
    thickness = float(np.linalg.norm(rest[0] - rest[1]))
    width = thickness / np.cos(slant) + PAD_WIDTH * np.tan(slant)
    too_low = np.array([0.0, 0.0, lever * np.tan(slant)])
    scene.fingers.pads = rest.mean(axis=0) - too_low + np.outer([0.5, -0.5], [0.0, 0.0, width])
    with pytest.raises(BlockedHandError) as first:
        scene.held.grasp(ROBOT, CLOSED)
    scene.fingers.pads += np.outer([0.001, -0.001], [0.0, 0.0, 1.0])
    with pytest.raises(BlockedHandError) as second:
        scene.held.grasp(ROBOT, CLOSED)
    assert first.value.offset(None)[2] < 0.0
    assert first.value.offset(second.value)[2] < 0.0  # it had come nearer
    np.testing.assert_allclose(first.value.offset(first.value), too_low, atol=1e-6)
    assert second.value.offset(first.value)[2] > 0.0


def test_fingers_that_closed_beside_the_handle_tell_nothing_of_where_it_is(scene: Scene) -> None:
    scene.move(0.0, 0.0)
    scene.fingers.pads[:, 2] -= [0.015, -0.015]
    with pytest.raises(ExecutionError) as raised:
        scene.held.grasp(ROBOT, CLOSED)
    assert not isinstance(raised.value, BlockedHandError)
