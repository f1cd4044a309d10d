"""What moves the simulated robot: a topic for all joints, and an action or topic a controller."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from geometry_msgs.msg import Twist, TwistStamped
from rclpy.node import Node
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.configuration.robot_parts import ControllerSettings
from kmn_sim.control.trajectory import Command
from kmn_sim.ros.controller_action import ControllerAction
from kmn_sim.ros.gripper_action import GripperAction
from kmn_sim.ros.trajectory_action import TrajectoryAction
from kmn_sim.ros.trajectory_input import TrajectoryInput
from kmn_sim.world.simulation import Simulation

QUEUE_DEPTH = 10
FEEDBACK_PERIOD = 0.05  # simulated seconds
ACTIONS: dict[str, type[ControllerAction]] = {  # by type of controller
    "follow_joint_trajectory": TrajectoryAction,
    "gripper_command": GripperAction,
}
WHOLE_ROBOT = "joint_trajectory"  # topic


class ControllerServers:
    """Passes trajectories on to the controllers.

    Parameters
    ----------
    trajectories
        Takes the messages.
    controllers
        What each of them serves, by name.
    """

    def __init__(
        self,
        node: Node,
        trajectories: TrajectoryInput,
        controllers: Mapping[str, ControllerSettings],
    ) -> None:
        self._trajectories = trajectories
        self._subscribe(
            node, WHOLE_ROBOT, lambda world, command: world.controllers.accept(command, world.time)
        )
        self._actions: list[ControllerAction] = []
        for name, settings in controllers.items():
            if settings.type == "topic":
                self._subscribe(node, settings.name, partial(_accept, name))
            elif settings.type == "velocity":
                kind, take = (
                    (TwistStamped, trajectories.take_stamped_velocity)
                    if settings.stamped
                    else (Twist, trajectories.take_velocity)
                )
                node.create_subscription(kind, settings.name, take, QUEUE_DEPTH)
            else:
                action = ACTIONS[settings.type]
                self._actions.append(action(node, trajectories, name, settings.name))
        trajectories.runner.every(FEEDBACK_PERIOD, self._feed_back)

    def end_goals(self, reason: str) -> None:
        """End all goals, as when the world is set up anew."""
        for action in self._actions:
            action.end_goals(reason)

    def destroy(self) -> None:
        """End the actions, of which the node does not know."""
        for action in self._actions:
            action.destroy()

    def _subscribe(
        self, node: Node, topic: str, accept: Callable[[Simulation, Command], None]
    ) -> None:
        def take(message: JointTrajectory) -> None:
            self._trajectories.take(
                lambda simulation: accept(simulation, self._trajectories.read(simulation, message))
            )

        node.create_subscription(JointTrajectory, topic, take, QUEUE_DEPTH)

    def _feed_back(self, simulation: Simulation) -> None:
        for action in self._actions:
            action.feed_back(simulation)


def _accept(name: str, simulation: Simulation, command: Command) -> None:
    simulation.controllers[name].accept(command, simulation.time)
