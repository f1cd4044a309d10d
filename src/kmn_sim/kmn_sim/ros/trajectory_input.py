"""Trajectories and velocities that come as messages, on their way to the simulation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.ros.stamps import seconds
from kmn_sim.control.trajectory import Command, TrajectoryError
from kmn_sim.ros import messages
from kmn_sim.ros.simulation_statistics import SimulationStatistics
from kmn_sim.world.runner import Runner
from kmn_sim.world.simulation import Simulation


class TrajectoryInput:
    """Reads commands for the simulation; those that are refused are counted and told.

    Parameters
    ----------
    offset
        Returns what is to be added to stamps to be simulated time, seconds.

    Attributes
    ----------
    runner
        Of the simulation.
    """

    def __init__(
        self,
        runner: Runner,
        statistics: SimulationStatistics,
        warnings: ThrottledWarnings,
        offset: Callable[[Simulation], float],
    ) -> None:
        self.runner, self._offset = runner, offset
        self._statistics, self._warnings = statistics, warnings

    def read(self, simulation: Simulation, message: JointTrajectory) -> Command:
        """Return the command of a message."""
        offset = self._offset(simulation)
        return messages.command_from_message(message, lambda stamp: stamp + offset)

    def take(self, accept: Callable[[Simulation], object]) -> str:
        """Let a function accept a command; return why it is refused, empty if it is not."""
        refused = self._pass_on(accept, "trajectory")
        if not refused:
            self._statistics.accept()
        return refused

    def take_velocity(self, message: Twist) -> None:
        """Let the base drive with a velocity."""
        self._drive(message, 0.0)

    def take_stamped_velocity(self, message: TwistStamped) -> None:
        """Let the base drive with a velocity of a time; a stamp of 0 is that of now."""
        self._drive(message.twist, seconds(message.header.stamp))

    def _drive(self, twist: Twist, stamp: float) -> None:
        velocity = np.array([twist.linear.x, twist.linear.y, twist.angular.z])

        def accept(simulation: Simulation) -> None:
            sent = stamp + self._offset(simulation) if stamp else simulation.time
            base = simulation.controllers.base
            assert base is not None
            base.accept(velocity, sent, simulation.time)

        self._pass_on(accept, "velocity")

    def _pass_on(self, accept: Callable[[Simulation], object], what: str) -> str:
        """Let a function accept a command; return why it is refused, empty if it is not."""
        try:
            self.runner.call(accept)
        except TrajectoryError as error:
            self._statistics.refuse(error.reason, str(error))
            self._warnings.warn(error.reason, f"{what} refused, {error.reason}: {error}")
            return str(error)
        return ""
