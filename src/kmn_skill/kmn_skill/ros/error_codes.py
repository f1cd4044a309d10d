"""The codes by which programs tell how a goal of the action ``open_door`` ended."""

from __future__ import annotations

from kmn_msgs.action import OpenDoor
from kmn_skill.execution.goal import Outcome

# The constants of the action's result, which explains them.
NAMES: dict[Outcome, str] = {
    "success": "SUCCESS",
    "cancelled": "CANCELLED",
    "preempted": "PREEMPTED",
    "node_ended": "NODE_ENDED",
    "bad_goal": "INVALID_GOAL",
    "no_plan": "NO_PLAN",
    "none": "NO_DOOR",
    "few_frames": "NO_DOOR",
    "stale": "NO_DOOR",
    "future": "NO_DOOR",
    "model": "DOOR_UNUSABLE",
    "status": "DOOR_UNUSABLE",
    "frame": "DOOR_UNUSABLE",
    "names": "DOOR_UNUSABLE",
    "not_finite": "DOOR_UNUSABLE",
    "out_of_limits": "DOOR_UNUSABLE",
    "disagreement": "DOOR_UNCERTAIN",
    "covariance": "DOOR_UNCERTAIN",
    "uncertain": "DOOR_UNCERTAIN",
    "handle_not_seen": "HANDLE_NOT_SEEN",
    "no_states": "NO_STATES",
    "states_stopped": "NO_STATES",
    "stale_states": "NO_STATES",
    "another_world": "ANOTHER_WORLD",
    "controller": "CONTROLLER_FAILED",
    "tracking": "TRACKING",
    "missed_handle": "MISSED_HANDLE",
    "slipped": "SLIPPED",
    "missed": "MISSED_GOAL",
    "stuck": "STUCK",
    "internal_error": "INTERNAL_ERROR",
}


def error_code(outcome: Outcome) -> int:
    """Return the code of an outcome."""
    return getattr(OpenDoor.Result, NAMES[outcome])


def code_name(code: int) -> str:
    """Return the name of a code; the number itself where another version of the action has it."""
    names = {getattr(OpenDoor.Result, name): name for name in NAMES.values()}
    return names.get(code, str(code))
