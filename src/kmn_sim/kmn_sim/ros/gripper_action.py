"""The action ``GripperCommand`` of one joint, as the stock gripper_action_controller serves it."""

from __future__ import annotations

from collections.abc import Callable

from control_msgs.action import GripperCommand

from kmn_sim.control.gripper_goal import GripperGoal
from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.control.trajectory_goal import Ending, Outcome
from kmn_sim.ros.controller_action import ControllerAction
from kmn_sim.world.simulation import Simulation


class GripperAction(ControllerAction):
    """The joint goes to its position at once, as fast as it can, with an effort at most.

    A gripper that stands before its position, as about a handle, goes on to press; its goal is
    aborted as stalled, as the stock controller does by default.
    """

    kind = GripperCommand

    def check(self, simulation: Simulation, request: GripperCommand.Goal) -> None:
        """Raise ``TrajectoryError`` if the position is wrong."""
        controller = simulation.controllers[self._name]
        controller.check(self._command(simulation, request), simulation.time)

    def accept(
        self,
        simulation: Simulation,
        request: GripperCommand.Goal,
        finish: Callable[[Outcome], None],
    ) -> GripperGoal:
        """Let the joint go to the position."""
        tolerances = simulation.settings.robot.simulation.gripper_action
        command, goal = self._command(simulation, request), GripperGoal(tolerances, finish)
        simulation.controllers[self._name].accept(command, simulation.time, goal)
        simulation.robot.limit_effort(command.names[0], request.command.max_effort)
        return goal

    def result(self, simulation: Simulation, outcome: Outcome) -> GripperCommand.Result:
        """Make the result: where the joint is, and whether it is there or stalled."""
        position, effort = self._present(simulation)
        return GripperCommand.Result(
            position=position,
            effort=effort,
            stalled=outcome.ending is Ending.STALLED,
            reached_goal=outcome.ending is Ending.SUCCESSFUL,
        )

    def feedback(self, simulation: Simulation) -> GripperCommand.Feedback:
        """Make the feedback: where the joint is."""
        position, effort = self._present(simulation)
        return GripperCommand.Feedback(position=position, effort=effort)

    def _command(self, simulation: Simulation, request: GripperCommand.Goal) -> Command:
        names = tuple(simulation.controllers[self._name].limits)
        return Command(names, [Waypoint(0.0, (request.command.position,))])

    def _present(self, simulation: Simulation) -> tuple[float, float]:
        """Return position and effort of the joint."""
        (name,) = simulation.controllers[self._name].limits
        column, robot = list(simulation.robot.limits).index(name), simulation.robot
        return float(robot.state().positions[column]), float(robot.efforts()[column])
