"""A base that is driven by velocities: how it turns, speeds up, stops, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory import TrajectoryError
from kmn_sim.control.velocity_controller import VelocityController, VelocityLimits

LIMITS = VelocityLimits(timeout=0.5, acceleration=(5.0, 5.0, 10.0))
SPEEDS = np.array([1.0, 0.8, 2.0])
STEP = 0.01  # seconds


def drive(it: VelocityController, since: float, until: float, yaw: float = 0.0) -> State:
    """Let a base that never gets anywhere be driven for some time; return what is desired."""
    measured = State.at_rest(np.array([1.0, 2.0, yaw]))
    for now in np.arange(since, until + STEP / 2.0, STEP):
        desired = it.sample(float(now), measured)
    assert desired.positions == pytest.approx(measured.positions)
    return desired


def test_a_velocity_is_of_the_base_and_its_speed_and_acceleration_are_limited() -> None:
    it = VelocityController(SPEEDS, LIMITS)
    it.accept(np.array([0.5, -3.0, 9.0]), 0.0, 0.0)
    assert drive(it, 0.0, 0.05).velocities == pytest.approx([0.25, -0.25, 0.5])
    turned = drive(it, 0.06, 0.4, yaw=math.pi / 2.0)
    assert turned.velocities == pytest.approx([0.8, 0.5, 2.0])


def test_it_stops_when_nothing_comes() -> None:
    it = VelocityController(SPEEDS, LIMITS)
    assert drive(it, 0.0, 0.1).velocities == pytest.approx([0.0, 0.0, 0.0])
    it.accept(np.array([0.5, 0.0, 0.0]), 0.1, 0.1)
    assert drive(it, 0.11, 0.6).velocities == pytest.approx([0.5, 0.0, 0.0])
    assert drive(it, 0.61, 0.71).velocities == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    ("velocity", "sent", "text"),
    [
        ([math.nan, 0.0, 0.0], 1.0, "not finite"),
        ([0.0, 0.0, math.inf], 1.0, "not finite"),
        ([0.1, 0.0, 0.0], 0.4, "0.600 s old, expected at most 0.5 s"),
    ],
)
def test_a_wrong_velocity_is_refused_and_the_one_before_remains(
    velocity: list[float], sent: float, text: str
) -> None:
    it = VelocityController(SPEEDS, LIMITS)
    it.accept(np.array([0.5, 0.0, 0.0]), 1.0, 1.0)
    with pytest.raises(TrajectoryError, match=text):
        it.accept(np.array(velocity), sent, 1.0)
    assert drive(it, 1.0, 1.3).velocities == pytest.approx([0.5, 0.0, 0.0])
