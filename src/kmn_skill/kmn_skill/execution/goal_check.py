"""Whether a goal can be reached, and whether it was."""

from __future__ import annotations

import math

from kmn_perception.model.actions import Action
from kmn_perception.model.parts import Joint
from kmn_skill.execution.errors import ExecutionError, GoalError
from kmn_skill.execution.goal import Goal


def check_goal(goal: Goal, action: Action, tolerance: float) -> None:
    """Raise ``GoalError`` if the object's joints cannot have the goal's positions.

    Parameters
    ----------
    tolerance
        By which what is opened may miss the goal, m or rad.
    """
    if action.unlatch is not None:
        _check_position(goal.unlatched, action.unlatch)
    elif goal.unlatched != 0.0:
        raise GoalError(
            "bad_goal",
            f"{goal.unlatched:g} is asked of what unlatches the joint '{action.joint.name}', but "
            "there is no such thing: expected 0",
        )
    _check_position(goal.target, action.joint)
    if abs(goal.target) <= tolerance:
        raise GoalError(
            "bad_goal",
            f"{goal.target:g} does not open the joint '{action.joint.name}', expected more than "
            f"the tolerance {tolerance:g} {action.joint.unit} to either side",
        )


def check_reached(
    reached: Goal, goal: Goal, action: Action, tolerances: tuple[float, float]
) -> None:
    """Raise ``ExecutionError`` if a joint of the object came less far than the goal has it.

    Parameters
    ----------
    reached
        Positions to which they came.
    tolerances
        By which what unlatches the object, and what is opened, may miss the goal, m or rad.
    """
    pairs = [(action.unlatch, reached.unlatched, goal.unlatched)]
    pairs.append((action.joint, reached.target, goal.target))
    for (joint, position, wanted), tolerance in zip(pairs, tolerances, strict=True):
        if joint is None:
            continue
        if math.copysign(1.0, wanted) * position < abs(wanted) - tolerance:
            raise ExecutionError(
                "missed",
                f"the {joint.name} came to {position:.2f} {joint.unit}, expected {wanted:.2f} "
                f"{joint.unit}",
            )


def _check_position(position: float, joint: Joint) -> None:
    low, high = joint.limits
    if not low <= position <= high:
        raise GoalError(
            "bad_goal",
            f"{position:g} is beyond the joint '{joint.name}', "
            f"expected [{low:g}, {high:g}] {joint.unit}",
        )
