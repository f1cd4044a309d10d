"""The actions by which goals come: how each of them tells a goal, its result and its feedback."""

from __future__ import annotations

import math
from typing import Any, Protocol

from kmn_msgs.action import OpenDoor, OperateJoint
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.errors import GoalError
from kmn_skill.execution.goal import SUCCESS, Feedback, Goal, Result
from kmn_skill.ros.error_codes import error_code


class GoalInterface(Protocol):
    """An action of ROS.

    Attributes
    ----------
    type, name
        Its type, and its name relative to the node's namespace.
    """

    type: Any
    name: str

    def goal(self, request: Any) -> Goal:
        """Read a goal; raise ``GoalError`` if it is for another object or joint."""

    def result(self, result: Result) -> Any:
        """Make the message of a result."""

    def feedback(self, feedback: Feedback) -> Any:
        """Make the message of what is being done."""


class OpenDoorInterface:
    """``open_door``: angles of handle and door, which the client chooses."""

    type, name = OpenDoor, "open_door"

    def goal(self, request: OpenDoor.Goal) -> Goal:
        """Read a goal."""
        return Goal(request.handle_angle, request.door_angle)

    def result(self, result: Result) -> OpenDoor.Result:
        """Make the message of a result."""
        return OpenDoor.Result(
            handle_angle=result.unlatched, door_angle=result.opened, **_outcome(result)
        )

    def feedback(self, feedback: Feedback) -> OpenDoor.Feedback:
        """Make the message of what is being done."""
        return OpenDoor.Feedback(
            phase=feedback.phase,
            progress=feedback.progress,
            handle_angle=feedback.unlatched,
            door_angle=feedback.opened,
        )


class OperateJointInterface:
    """``operate_joint``: any object's joint; what unlatches it, and how far, its file says.

    Parameters
    ----------
    model
        What can be done with it, by its actions.
    """

    type, name = OperateJoint, "operate_joint"

    def __init__(self, model: KinematicModel) -> None:
        self._model = model

    def goal(self, request: OperateJoint.Goal) -> Goal:
        """Read a goal; raise ``GoalError`` if it is for another object or joint."""
        model = self._model
        joints = dict.fromkeys(action.joint.name for action in model.actions)
        for what, asked, known in (
            ("model", request.model, [model.name]),
            ("joint", request.joint, list(joints)),
        ):
            if asked not in ("", *known):
                expected = " or ".join(f"'{name}'" for name in known)
                raise GoalError("bad_goal", f"{what} '{asked}' is asked for, expected {expected}")
        number = self._chosen(request.joint or model.actions[0].joint.name, request.target)
        action = model.actions[number]
        target = action.target if math.isnan(request.target) else request.target
        return Goal(action.unlatched, target, request.object_id, number)

    def _chosen(self, joint: str, target: float) -> int:
        """Return the number of a joint's first action, to the target's side if one is."""
        actions = self._model.actions
        of_joint = [number for number, each in enumerate(actions) if each.joint.name == joint]
        to_side = [number for number in of_joint if actions[number].target * target > 0.0]
        return [*to_side, *of_joint][0]

    def result(self, result: Result) -> OperateJoint.Result:
        """Make the message of a result."""
        return OperateJoint.Result(position=result.opened, **_outcome(result))

    def feedback(self, feedback: Feedback) -> OperateJoint.Feedback:
        """Make the message of what is being done."""
        return OperateJoint.Feedback(
            phase=feedback.phase, progress=feedback.progress, position=feedback.opened
        )


def _outcome(result: Result) -> dict[str, Any]:
    """Return the fields that all results have."""
    report = result.report
    return {
        "success": result.outcome == SUCCESS,
        "error_code": error_code(result.outcome),
        "reason": result.reason,
        "planning_time": report.planning_time if report else math.nan,
        "contact_error": report.contact_error if report else math.nan,
        "clearance": report.clearance if report else math.nan,
        "attempts": result.attempts,
    }
