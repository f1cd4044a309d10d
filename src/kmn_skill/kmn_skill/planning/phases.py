"""The phases of opening a door: their ends in the policy's time, and their names in a plan."""

from __future__ import annotations

from enum import IntEnum


class PhaseEnd(IntEnum):
    """Times of the policy: gripper before the handle and about it, handle pressed, door open."""

    PRE_GRASP = 1
    GRASP = 2
    PRESSED = 3
    OPEN = 4


PHASE_COUNT = len(PhaseEnd)


class PhaseName:
    """Names of what is being done; a plan has all phases from `REACH` on.

    `WAIT`, `LOOK` (from near, where the handle was not seen) and `PLAN` come before the plan. It
    begins with `RELEASE` only if the hand is at the handle. `REACH` lasts up to `PhaseEnd.GRASP`,
    where the gripper closes in `GRASP`.
    """

    WAIT = "wait"
    LOOK = "look"
    PLAN = "plan"
    RELEASE = "release"
    REACH = "reach"
    GRASP = "grasp"
    PRESS = "press"
    OPEN = "open"
