"""A path is followed as fast as its limits allow, and what is sent keeps within them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.layout import BASE_AND_ARM, GRIPPER, LATCH, MOVED, ROBOT
from kmn_skill.planning.motion import Motion, MotionError
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Plan, PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.timing import timed_plan
from kmn_skill.planning.transfer import refine
from kmn_skill.planning.world import TOOL, World

SETUP = PlanningSetup.load(KinematicModel.load("door"))
CLOSED = np.zeros(3), np.zeros(4)
WORLD = World(SETUP, *CLOSED)
LIMITS, TIMING = SETUP.robot.limits, SETUP.settings.timing
SMOOTHING = 0.05
FINE = 20  # samples between two waypoints


def straight(length: float, count: int = 41) -> Motion:
    """Return the motion along a line, of speed 2 and acceleration 4 in its faster coordinate."""
    way = length * np.linspace(0.0, 1.0, count) ** 1.5  # nodes anywhere on the line
    nodes = np.column_stack([way, -0.5 * way])
    return Motion(nodes, np.full(nodes.shape, 2.0), np.full(2, 4.0), SMOOTHING)


@pytest.mark.parametrize("length", [0.1, 0.9, 1.1, 5.0])
def test_a_straight_line_has_the_trapezoidal_profile(length: float) -> None:
    v, a = 2.0, 4.0
    reaches = length > v**2 / a  # the speed, else the profile is a triangle
    duration = length / v + v / a if reaches else 2.0 * np.sqrt(length / a)
    motion = straight(length)
    assert motion.duration == pytest.approx(duration + SMOOTHING, rel=0.01)
    middle = motion.duration / 2.0
    times = np.array([0.0, middle, motion.duration])
    np.testing.assert_allclose(
        motion.positions(times)[:, 0], [0.0, length / 2.0, length], atol=1e-2 * length
    )
    peak = v if reaches else np.sqrt(a * length)
    mean_lost = 0.0 if reaches else a * SMOOTHING / 4.0  # at the triangle's tip
    np.testing.assert_allclose(
        motion.velocities(times)[:, 0], [0.0, peak - mean_lost, 0.0], atol=0.02 * peak
    )


def test_accelerations_change_by_no_more_than_the_smoothing_allows() -> None:
    motion = straight(2.0)
    count = 2000
    step = motion.duration / count
    velocities = motion.velocities(np.linspace(0.0, motion.duration, count + 1, dtype=np.float64))
    accelerations = np.diff(velocities, axis=0) / step
    jerks = np.diff(accelerations, axis=0) / step
    assert np.abs(accelerations).max() <= 4.0 * 1.02
    assert np.abs(jerks).max() <= 2.0 * 4.0 / SMOOTHING * 1.02


def test_a_limit_at_some_nodes_is_kept_there_alone() -> None:
    nodes = np.linspace(0.0, 4.0, 81, dtype=np.float64)[:, None]
    speeds = np.full(nodes.shape, 2.0)
    speeds[60:] = 0.5
    motion = Motion(nodes, speeds, np.full(1, 4.0), SMOOTHING)
    times = np.linspace(0.0, motion.duration, 500, dtype=np.float64)
    places, velocities = motion.positions(times)[:, 0], motion.velocities(times)[:, 0]
    assert velocities.max() == pytest.approx(2.0, rel=0.01)
    assert velocities[places >= 3.0].max() == pytest.approx(0.5, rel=0.15)
    assert velocities[places >= 3.1].max() == pytest.approx(0.5, rel=0.01)


def test_a_path_that_is_no_number_is_refused() -> None:
    with pytest.raises((MotionError, ValueError)):
        Motion(np.full((5, 1), np.nan), np.ones((5, 1)), np.ones(1), SMOOTHING)


def bent(amplitudes: NDArray[np.float64]) -> Plan:
    """Return the plan along the prototype's solution, whose base and arm swing in addition."""
    path = Prototypes.load("door").solutions["pull"][0].path
    path = refine(path[1:], path[0], SETUP.settings.planner.fine)
    parts = np.linspace(0.0, 1.0, len(path))[:, None]
    path[:, ROBOT][:, BASE_AND_ARM] += amplitudes * np.sin(3.0 * np.pi * parts) ** 2
    home = SETUP.robot.home
    return timed_plan(path, PlanRequest(*CLOSED, home, np.zeros(2), -0.7, -0.9), WORLD)


def interpolated(plan: Plan) -> tuple[NDArray[np.float64], ...]:
    """Return times (N,), positions, velocities and accelerations (N, J) of the cubic splines."""
    s = np.linspace(0.0, 1.0, FINE)[:, None]
    powers = np.hstack([s**3, s**2, s, np.ones_like(s)])
    slopes = np.hstack([3.0 * s**2, 2.0 * s, np.ones_like(s), 0.0 * s])
    bends = np.hstack([6.0 * s, 2.0 + 0.0 * s, 0.0 * s, 0.0 * s])
    at_ends = np.vstack([powers[[0, -1]], slopes[[0, -1]]])
    parts = []
    for i, j in itertools.pairwise(range(len(plan.times))):
        step = plan.times[j] - plan.times[i]
        given_there = np.vstack([plan.positions[[i, j]], step * plan.velocities[[i, j]]])
        cubic = np.linalg.solve(at_ends, given_there)
        times = plan.times[i] + step * s[:, 0]
        parts.append((times, powers @ cubic, slopes @ cubic / step, bends @ cubic / step**2))
    return tuple(np.concatenate(each) for each in zip(*parts, strict=True))


@settings(max_examples=10)
@given(st.lists(st.floats(-0.2, 0.2), min_size=10, max_size=10))
def test_what_is_sent_keeps_the_limits_of_joints_and_door(swings: list[float]) -> None:
    plan = bent(np.array(swings))
    _, _, velocities, accelerations = interpolated(plan)
    assert (np.diff(plan.times) > 0.0).all()
    assert not plan.velocities[[0, -1]].any()
    assert (np.abs(velocities) <= LIMITS[:, 0] * (1.0 + 1e-6)).all()
    assert (np.abs(accelerations) <= LIMITS[:, 1] * (1.0 + 1e-6)).all()
    rates = np.abs(np.diff(plan.object_joints, axis=0) / np.diff(plan.times)[:, None]).max(axis=0)
    assert rates[MOVED] <= TIMING.moved_speed * 1.001
    assert rates[LATCH] <= TIMING.latch_speed * 1.001


def test_the_hand_that_holds_the_handle_is_as_fast_as_it_may_be() -> None:
    plan = bent(np.zeros(10))
    times, positions, _, _ = interpolated(plan)
    grasp = plan.times[plan.phase(PhaseName.GRASP).last]
    held = np.flatnonzero(times > grasp)[::4]
    door = np.array([np.interp(times[held], plan.times, each) for each in plan.object_joints.T]).T
    places = WORLD.poses(np.hstack([positions[held], door]), [TOOL])[:, 0, :3, 3]
    steps = np.diff(times[held])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1)[steps > 0.0] / steps[steps > 0.0]
    # All of a motion is slowed down by as much as its splines would exceed a limit.
    assert speeds.max() == pytest.approx(TIMING.held_speed, rel=0.04)


def test_a_plan_is_near_its_limits_and_stops_only_where_the_gripper_closes() -> None:
    plan = bent(np.zeros(10))
    _, _, velocities, accelerations = interpolated(plan)
    used = np.maximum(np.abs(velocities) / LIMITS[:, 0], np.abs(accelerations) / LIMITS[:, 1])
    assert np.median(used.max(axis=1)) > 0.8
    at_rest = np.flatnonzero(~plan.velocities[:, BASE_AND_ARM].any(axis=1))
    grasp = plan.phase(PhaseName.GRASP)
    assert at_rest.tolist() == [0, grasp.first, grasp.last, len(plan.times) - 1]
    assert plan.positions[grasp.last, GRIPPER] < plan.positions[grasp.first, GRIPPER]
