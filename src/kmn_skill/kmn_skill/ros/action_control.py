"""Moves the robot by the action of each of its controllers."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from action_msgs.msg import GoalStatus
from control_msgs.action import FollowJointTrajectory
from control_msgs.action import GripperCommand as GripperAction
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.task import Future
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.configuration.robot_parts import velocity_controller
from kmn_skill.execution.errors import ControllerError
from kmn_skill.execution.gripper_commands import GripperCommand, gripper_commands
from kmn_skill.execution.plan_execution import Part
from kmn_skill.planning.robot import RobotModel
from kmn_skill.ros import messages
from kmn_skill.ros.locked_action_client import LockedActionClient
from kmn_skill.ros.velocity_control import VelocityControl

QUEUE_DEPTH = 10
ACTIONS = {  # by type of controller
    "follow_joint_trajectory": FollowJointTrajectory,
    "gripper_command": GripperAction,
}
CODES = {
    value: name
    for name, value in vars(FollowJointTrajectory.Result).items()
    if name.isupper() and isinstance(value, int)
}


@dataclass
class Pursuit:
    """A goal on its way at one controller.

    Attributes
    ----------
    asked
        When the goal was sent, seconds of a clock that is never adjusted.
    end
        When it should be reached, seconds of the node's clock.
    handle
        Of the goal, once the controller has accepted it.
    failure
        What went wrong; empty if nothing did.
    reached
        Whether the controller says that it is.
    unwanted
        Whether it is to be cancelled, as soon as that is possible.
    """

    asked: float
    end: float
    handle: Any = None
    failure: str = ""
    reached: bool = False
    unwanted: bool = False

    def on_response(self, future: Future) -> None:
        """Take the answer to the goal."""
        handle = future.result()
        if not handle.accepted:
            self.failure = "rejected its goal"
            return
        self.handle = handle
        handle.get_result_async().add_done_callback(self.on_result)
        if self.unwanted:
            handle.cancel_goal_async()

    def on_result(self, future: Future) -> None:
        """Take the goal's result; a gripper that presses and stands has done what it should."""
        status, result = future.result().status, future.result().result
        self.reached = status == GoalStatus.STATUS_SUCCEEDED or getattr(result, "stalled", False)
        if not self.reached:
            how = "cancelled" if status == GoalStatus.STATUS_CANCELED else "aborted"
            self.failure = f"{how} its goal{_told(result)}"

    def cancel(self) -> None:
        """Cancel the goal, now or when it is accepted."""
        self.unwanted = True
        if self.handle is not None:
            self.handle.cancel_goal_async()


def _told(result: Any) -> str:
    """Return code and text of a result that has them."""
    if not isinstance(result, FollowJointTrajectory.Result):
        return ""
    code = CODES.get(result.error_code, str(result.error_code))
    return f", {code}: {result.error_string}"


class ActionControl:
    """Sends each controller its share of a plan, all with the same stamp.

    Parameters
    ----------
    robot
        Whose controllers they are.
    now
        Returns the time of the node's clock, seconds.
    timeout
        Returns in how many seconds a controller must answer, and be through after the end.
    base
        Drives a base that takes velocities.
    """

    def __init__(
        self,
        node: Node,
        robot: RobotModel,
        now: Callable[[], float],
        timeout: Callable[[], float],
        base: VelocityControl | None = None,
    ) -> None:
        self._controllers = controllers = robot.controllers
        self._gripper, names = robot.gripper.joint, robot.joint_names
        self._max_effort = robot.joints[self._gripper].effort
        self._now, self._timeout = now, timeout
        self._columns = {
            name: [names.index(joint) for joint in each.joints]
            for name, each in controllers.items()
        }
        self._clients = {
            name: LockedActionClient(node, ACTIONS[each.type], each.name)
            for name, each in controllers.items()
            if each.type in ACTIONS
        }
        self._publishers = {
            name: node.create_publisher(JointTrajectory, each.name, QUEUE_DEPTH)
            for name, each in controllers.items()
            if each.type == "topic"
        }
        self._base, self._base_name = base, velocity_controller(controllers)
        self._pursuits: dict[str, Pursuit] = {}
        self._commands: dict[str, list[GripperCommand]] = {}  # that are still to be sent

    def is_ready(self) -> bool:
        """Tell whether all actions are served, and the base's velocities listened to."""
        listened = self._base is None or self._base.is_ready()
        return listened and all(client.server_is_ready() for client in self._clients.values())

    def send(self, part: Part) -> None:
        """Send the controllers their shares of a part of a plan."""
        end = part.start + float(part.times[-1])
        for name, columns in self._columns.items():
            controller, share = self._controllers[name], part.of(columns)
            if name == self._base_name and self._base is not None:
                self._base.send(share)
                continue
            if controller.type == "gripper_command":
                self._commands[name] = gripper_commands(share)
                continue
            trajectory = messages.trajectory_from_part(share, controller.joints)
            if name in self._publishers:
                self._publishers[name].publish(trajectory)
            else:
                self._pursue(name, messages.goal_from_trajectory(trajectory, self._gripper), end)

    def hold(self, positions: NDArray[np.float64], duration: float) -> None:
        """Cancel what the controllers do; they then hold. Those with a topic are sent a point."""
        if self._base is not None:
            self._base.hold()
        for name, publisher in self._publishers.items():
            joints = self._controllers[name].joints
            point = messages.hold_trajectory(positions[self._columns[name]], joints, duration)
            publisher.publish(point)
        for pursuit in self._pursuits.values():
            pursuit.cancel()
        self._pursuits, self._commands = {}, {}

    def are_through(self) -> bool:
        """Tell whether all controllers have reached what they were sent; send what is due now.

        Raises
        ------
        ControllerError
            If one of them rejected, aborted or cancelled it, ended, or is too late.
        """
        now = self._now()
        for name, commands in self._commands.items():
            if commands and commands[0].time <= now:
                due, position = commands.pop(0)
                self._pursue(name, messages.gripper_goal(position, self._max_effort), due)
        for name, pursuit in self._pursuits.items():
            if failure := pursuit.failure or self._silence(name, pursuit):
                raise ControllerError("controller", f"the controller '{name}' {failure}")
        through = not any(self._commands.values())
        if self._base is not None:
            if failure := self._base.fault(self._latest()):
                raise ControllerError("controller", f"the controller '{self._base_name}' {failure}")
            through &= self._base.is_through()
        return through and all(pursuit.reached for pursuit in self._pursuits.values())

    def destroy(self) -> None:
        """End the actions' clients, of which the node does not know."""
        for client in self._clients.values():
            client.destroy()

    def _pursue(self, name: str, goal: Any, end: float) -> None:
        """Send a controller a goal that should be reached at a time, seconds."""
        pursuit = self._pursuits[name] = Pursuit(time.monotonic(), end)
        self._clients[name].send_goal_async(goal).add_done_callback(pursuit.on_response)

    def _latest(self) -> float:
        """Return by how many seconds a controller may be late."""
        return 2.0 * self._timeout()

    def _silence(self, name: str, pursuit: Pursuit) -> str:
        """Tell why a controller from which nothing came is not waited for; empty if it is."""
        action, timeout = self._controllers[name].name, self._timeout()
        waited = time.monotonic() - pursuit.asked
        if pursuit.reached:
            return ""
        if not self._clients[name].server_is_ready():
            return f"is not there: nobody serves '{action}'"
        if pursuit.handle is None and waited > timeout:
            return f"did not answer within {timeout:g} s"
        late = self._now() - pursuit.end
        if late > self._latest():
            return f"is not through {late:.1f} s after it should be"
        return ""
