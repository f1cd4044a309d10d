"""A base that takes velocities: how closely it follows a plan, and when odometry is too old."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from kmn_skill.execution.base_motion import BaseOdometry, BaseTracking, Motion, TrackingSettings
from kmn_skill.execution.plan_execution import Part

SPEEDS = np.array([1.0, 1.0, 2.0])
SETTINGS = TrackingSettings(
    base_gain=3.0,
    base_delay=0.04,
    base_position_tolerance=0.02,
    base_angle_tolerance=0.03,
    odometry_timeout=0.5,
)
STEP, STEPS = 1.0 / 240.0, 5  # seconds of a step; odometry and a velocity every so many of them
START = 1.0  # seconds; when the plan begins
DURATION = 4.0


def reference(time: float) -> NDArray[np.float64]:
    """Return where a base is that drives a curve of 1.2 m and turns by 1.5 rad meanwhile."""
    s = np.clip(time / DURATION, 0.0, 1.0)
    way = s - math.sin(2.0 * math.pi * s) / (2.0 * math.pi)
    return np.array([-3.0 + way, 0.5 * way**2, 3.0 + 1.5 * way])


def share() -> Part:
    """Return a plan along the curve, as coarse as plans are; its yaw goes beyond pi."""
    times = np.array([DURATION * step / 99.0 for step in range(100)])
    positions = np.array([reference(time) for time in times])
    velocities = np.gradient(positions, times, axis=0)
    velocities[[0, -1]] = 0.0
    return Part(START, times, positions, velocities)


def driven(
    tracking: BaseTracking,
    start: NDArray[np.float64],
    until: float,
    slip: Callable[[float], float] = lambda time: 1.0,
    delay: int = 2,
) -> list[tuple[float, NDArray[np.float64]]]:
    """Return where a base is from time to time.

    It has each velocity some odometry messages late, and drives a part of it.
    """
    pose: NDArray[np.float64] = start.copy()
    velocity: NDArray[np.float64] = np.zeros(3)
    on_their_way, path = [velocity] * delay, []
    for step in range(round(until / STEP)):
        now = step * STEP
        if step % STEPS == 0:
            told = pose.copy()
            told[2] = math.remainder(told[2], 2.0 * math.pi)
            on_their_way.append(tracking.velocity(now, Motion(now, told, velocity, "base")))
            velocity = slip(now) * on_their_way.pop(0)
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        ahead, left, turn = velocity
        pose = pose + STEP * np.array([cos * ahead - sin * left, sin * ahead + cos * left, turn])
        path.append((now + STEP, pose))
    return path


def errors(path: list[tuple[float, NDArray[np.float64]]]) -> NDArray[np.float64]:
    return np.abs([pose - reference(time - START) for time, pose in path])


def test_a_base_follows_the_plan_within_millimetres_though_its_velocities_come_late() -> None:
    found = errors(driven(BaseTracking(share(), SPEEDS, SETTINGS), reference(0.0), 6.0))
    assert found[:, :2].max() < 0.015
    assert found[:, 2].max() < 0.02
    assert found[-1].max() < 0.001


def test_what_wheels_slip_is_made_good_and_without_feedback_it_is_not() -> None:
    path = driven(BaseTracking(share(), SPEEDS, SETTINGS), reference(0.0), 6.0, lambda _: 0.9)
    blind = TrackingSettings(**{**vars(SETTINGS), "base_gain": 0.0})
    other = driven(BaseTracking(share(), SPEEDS, blind), reference(0.0), 6.0, lambda _: 0.9)
    assert errors(path)[-1].max() < 0.005
    assert errors(other)[-1].max() > 0.1


def test_no_velocity_is_larger_than_the_base_has_and_its_direction_is_kept() -> None:
    tracking = BaseTracking(share(), SPEEDS, SETTINGS)
    far = Motion(0.0, reference(0.0) - [2.0, 1.0, 0.0], np.zeros(3), "base")
    ahead, left, turn = tracking.velocity(0.0, far)
    assert math.hypot(ahead, left) > 1.0
    assert max(abs(ahead), abs(left)) == pytest.approx(1.0)
    assert turn == pytest.approx(0.0)
    direction = math.atan2(left, ahead) + far.pose[2]
    assert math.remainder(direction - math.atan2(1.0, 2.0), 2.0 * math.pi) == pytest.approx(0.0)


def test_it_is_through_at_the_plans_end_and_not_before() -> None:
    tracking, end = BaseTracking(share(), SPEEDS, SETTINGS), START + DURATION
    there = reference(DURATION)

    def through(now: float, off: tuple[float, float, float], told: float | None = None) -> bool:
        when = now if told is None else told
        return tracking.is_through(now, Motion(when, there + off, np.zeros(3), "base"))

    assert through(end + 0.1, (0.01, 0.01, 2.0 * math.pi - 0.02))
    assert not through(end + 0.1, (0.02, 0.02, 0.0))
    assert not through(end + 0.1, (0.0, 0.0, 0.04))
    assert not through(end - 0.1, (0.0, 0.0, 0.0))
    assert not through(end + 0.1, (0.0, 0.0, 0.0), told=end - 0.1)


def test_odometry_is_too_old_by_its_stamp_or_by_when_it_came() -> None:
    clock = [10.0]
    odometry = BaseOdometry(lambda: clock[0])
    assert odometry.fault(5.0, 0.5) == "no odometry came yet"
    odometry.put(Motion(5.0, np.zeros(3), np.zeros(3), "base"))
    assert odometry.fault(5.4, 0.5) == ""
    assert odometry.fault(5.6, 0.5) == "odometry is 0.60 s old, expected at most 0.5 s"
    clock[0] = 11.0
    assert odometry.fault(5.1, 0.5) == "odometry is 1.00 s old, expected at most 0.5 s"


def test_between_two_messages_the_base_goes_on_as_it_was_told_to() -> None:
    """A quarter of a circle of 1 m a second, of which a tenth of a second passes."""
    motion = Motion(
        2.0, np.array([1.0, 2.0, 0.5]), np.array([math.pi / 2.0, 0.0, math.pi / 2.0]), "b"
    )
    angle = 0.1 * math.pi / 2.0
    x, y = math.sin(angle), 1.0 - math.cos(angle)
    cos, sin = math.cos(0.5), math.sin(0.5)
    expected = [1.0 + cos * x - sin * y, 2.0 + sin * x + cos * y, 0.5 + angle]
    assert motion.at(2.1) == pytest.approx(expected, abs=1e-3)
    assert motion.at(9.0) == pytest.approx(motion.at(2.1))
