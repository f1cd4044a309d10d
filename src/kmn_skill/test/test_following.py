"""Where a plan led, also if the hand slips off at its end."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.errors import ExecutionError, Reason
from kmn_skill.execution.following import RobotFollowing
from kmn_skill.execution.goal import Goal
from kmn_skill.execution.goal_check import check_reached
from kmn_skill.execution.held_door import GripSettings, HeldDoor

DOOR, LID = KinematicModel.load("door"), KinematicModel.load("lid")
ACTION = DOOR.actions[0]
CHECK = partial(check_reached, goal=Goal(-0.7, -0.9), action=ACTION, tolerances=(0.15, 0.05))


class Followed(RobotFollowing):
    """A robot that came to some angles of handle and hinge, and failed there."""

    def __init__(
        self, handle: float, hinge: float, reason: Reason | None, model: KinematicModel = DOOR
    ) -> None:
        self.handle, self.hinge, self.reason, self.holds = handle, hinge, reason, False
        self._held = HeldDoor(
            model, model.actions[0], lambda robot: np.zeros((2, 3)), 0.02, GripSettings(0.5, 0.02)
        )

    def follow(self, plan: Any) -> None:
        if self.reason is not None:
            raise ExecutionError(self.reason, "the hand is empty")

    def hold(self) -> None:
        self.holds = True


@pytest.mark.parametrize("reason", ["slipped", "stuck"])
def test_where_a_hand_slips_off_an_open_door_or_its_stop_is_it_has_opened_it(
    reason: Reason,
) -> None:
    robot = Followed(-0.68, -0.88, reason)
    robot.reach(None, CHECK)  # type: ignore[arg-type]
    assert robot.holds


def test_a_lid_of_which_the_hand_slips_off_falls_shut() -> None:
    """Its physics: `test_a_lid_falls_shut` of the simulator. The drawer beside it stays."""
    reached = partial(check_reached, goal=Goal(0.0, -0.7), tolerances=(0.15, 0.05))
    robot = Followed(math.nan, -0.7, "slipped", LID)
    with pytest.raises(ExecutionError, match="the hand is empty; it falls shut"):
        robot.reach(None, partial(reached, action=LID.actions[0]))  # type: ignore[arg-type]
    assert robot.holds
    drawer = KinematicModel.load("drawer")
    check = partial(reached, goal=Goal(0.0, -0.3), action=drawer.actions[0])
    Followed(math.nan, -0.3, "slipped", drawer).reach(None, check)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("handle", "hinge", "reason", "told"),
    [
        (-0.68, -0.6, "slipped", "the hand is empty"),
        (-0.3, -0.88, "slipped", "the hand is empty"),
        (-0.68, -0.88, "tracking", "the hand is empty"),
        (-0.68, -0.6, "stuck", "the hand is empty"),
        (-0.68, -0.6, None, "the hinge came to -0.60"),
    ],
)
def test_what_fails_before_it_is_open_has_failed(
    handle: float, hinge: float, reason: Reason | None, told: str
) -> None:
    with pytest.raises(ExecutionError, match=told):
        Followed(handle, hinge, reason).reach(None, CHECK)  # type: ignore[arg-type]
