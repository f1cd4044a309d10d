"""The action ``FollowJointTrajectory`` of one controller, as the stock controller serves it."""

from __future__ import annotations

from collections.abc import Callable

from control_msgs.action import FollowJointTrajectory

from kmn_sim.control.trajectory_goal import Ending, Outcome, TrajectoryGoal
from kmn_sim.ros import messages
from kmn_sim.ros.controller_action import ControllerAction
from kmn_sim.world.simulation import Simulation

CODES = {
    Ending.SUCCESSFUL: FollowJointTrajectory.Result.SUCCESSFUL,
    Ending.CANCELLED: FollowJointTrajectory.Result.SUCCESSFUL,  # the stock controller's is 0, too
    Ending.PREEMPTED: FollowJointTrajectory.Result.INVALID_GOAL,
    Ending.PATH_TOLERANCE_VIOLATED: FollowJointTrajectory.Result.PATH_TOLERANCE_VIOLATED,
    Ending.GOAL_TOLERANCE_VIOLATED: FollowJointTrajectory.Result.GOAL_TOLERANCE_VIOLATED,
}


class TrajectoryAction(ControllerAction):
    """A goal that misses its tolerances is aborted; the joints hold where they were measured."""

    kind = FollowJointTrajectory

    def check(self, simulation: Simulation, request: FollowJointTrajectory.Goal) -> None:
        """Raise ``TrajectoryError`` if the trajectory is wrong."""
        command = self._trajectories.read(simulation, request.trajectory)
        simulation.controllers[self._name].check(command, simulation.time)

    def accept(
        self,
        simulation: Simulation,
        request: FollowJointTrajectory.Goal,
        finish: Callable[[Outcome], None],
    ) -> TrajectoryGoal:
        """Let the controller follow the trajectory."""
        controller = simulation.controllers[self._name]
        tolerances = messages.tolerances_from_goal(request, list(controller.limits))
        goal = TrajectoryGoal(tolerances, finish)
        command = self._trajectories.read(simulation, request.trajectory)
        controller.accept(command, simulation.time, goal)
        return goal

    def result(self, simulation: Simulation, outcome: Outcome) -> FollowJointTrajectory.Result:
        """Make the result: code and text."""
        return FollowJointTrajectory.Result(
            error_code=CODES[outcome.ending], error_string=outcome.text
        )

    def feedback(self, simulation: Simulation) -> FollowJointTrajectory.Feedback:
        """Make the feedback: where the joints are, and where they should be."""
        return messages.trajectory_feedback(simulation, self._name)
