"""Which trajectory is followed at which time: replacement, goals, and holding."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from kmn_sim.control.interpolation import State, nearest
from kmn_sim.control.trajectory import Command, Trajectory, check
from kmn_sim.control.trajectory_goal import Ending, Goal, Outcome

STOP_TIME = 0.14  # seconds in which joints are brought to rest
VIOLATIONS = (Ending.PATH_TOLERANCE_VIOLATED, Ending.GOAL_TOLERANCE_VIOLATED)


class TrajectoryController:
    """Follows the newest trajectory of some joints, or holds their position.

    As joint_trajectory_controller on branch jazzy of ros2_controllers does, a new trajectory
    replaces the running one at once, also if it starts in the future: what the old one would have
    done until then is forgotten, and the joints go to the first new point from the present state.
    That is the desired one, so that a gripper that presses goes on to press, or the measured one.
    A goal ends when another trajectory comes, when it is cancelled or when it violates its
    tolerances; in the latter two cases the joints are brought to rest from where they were
    measured, with a constant deceleration (the stock controller's ``decelerate_on_cancel``): a
    base that stops at once would throw the arm.

    Parameters
    ----------
    limits
        Lower and upper position of each joint by name.
    positions
        (J,) where the joints are, m and rad.
    continuous
        (J,) whether a whole turn of a joint changes nothing.
    from_desired_state
        Whether the present state is the desired one.
    allow_partial
        Whether a trajectory need not name all joints; the others then hold.

    Attributes
    ----------
    limits
        As they were given.
    desired
        State that is desired now.
    """

    def __init__(
        self,
        limits: Mapping[str, tuple[float, float]],
        positions: NDArray[np.float64],
        continuous: NDArray[np.bool_],
        from_desired_state: bool,
        allow_partial: bool,
    ) -> None:
        self.limits, self._continuous = dict(limits), continuous
        self._from_desired_state, self._allow_partial = from_desired_state, allow_partial
        self._low, self._high = np.array(list(self.limits.values())).T
        self._running: Trajectory | None = None
        self._taken: Trajectory | None = None  # begins with the next sample
        self._goal: Goal | None = None
        self.desired = State.at_rest(positions)

    def check(self, command: Command, now: float) -> Trajectory:
        """Return the trajectory of a command; raise ``TrajectoryError`` if it is refused."""
        return check(command, self.limits, now, self._allow_partial)

    def accept(self, command: Command, now: float, goal: Goal | None = None) -> None:
        """Take over a command, of somebody who waits for its end if there is a goal.

        Raises
        ------
        TrajectoryError
            If the command is refused; what is done goes on.
        """
        self.follow(self.check(command, now), goal)

    def follow(self, trajectory: Trajectory, goal: Goal | None = None) -> None:
        """Take over a trajectory that was checked."""
        self.end(Outcome(Ending.PREEMPTED, "preempted by another trajectory"))
        self._taken, self._goal = trajectory, goal

    def cancel(self, goal: Goal, measured: State, now: float) -> None:
        """Hold where the joints are measured, if a goal is the present one."""
        if goal is self._goal:
            self.end(Outcome(Ending.CANCELLED, "cancelled"))
            self._hold(measured, now)

    def end(self, outcome: Outcome) -> None:
        """Tell how the present goal ended, if there is one."""
        goal, self._goal = self._goal, None
        if goal is not None:
            goal.finish(outcome)

    def sample(self, now: float, measured: State) -> State:
        """Return the desired state at a time.

        Parameters
        ----------
        measured
            State in which the joints are.
        """
        self._follow(now)
        if self._taken is not None:
            present = self.desired if self._from_desired_state else measured
            self._running = self._taken.begin(present, self.desired, self._continuous, now)
            self._taken = None
            self._follow(now)
        self._judge(now, measured)
        return self.desired

    def error(self, measured: State) -> NDArray[np.float64]:
        """Return by how much the joints (J,) are not where they should be; without whole turns."""
        difference = self.desired.positions - measured.positions
        return nearest(difference, np.zeros(1), self._continuous)

    def progress(self, now: float) -> float | None:
        """Return the part of the trajectory's time that has passed; None without a trajectory."""
        return None if self._running is None else self._running.progress(now)

    def _follow(self, now: float) -> None:
        """Advance the desired state along the running trajectory, or hold it."""
        if self._running is None:
            self.desired = State.at_rest(self.desired.positions)
            return
        desired = self._running.sample(now)
        inside = np.clip(desired.positions, self._low, self._high)
        self.desired = desired._replace(positions=inside)

    def _judge(self, now: float, measured: State) -> None:
        """End the goal if it is reached or missed."""
        if self._goal is None or self._running is None:
            return
        since_end = now - float(self._running.times[-1])
        outcome = self._goal.judge(
            list(self.limits), self.error(measured), measured.velocities, since_end
        )
        if outcome is None:
            return
        self.end(outcome)
        if outcome.ending in VIOLATIONS:
            self._hold(measured, now)

    def _hold(self, measured: State, now: float) -> None:
        positions, velocities, _ = measured
        unknown = np.full_like(positions, np.nan)
        rest = State.at_rest(positions + 0.5 * STOP_TIME * velocities)
        states = State(positions, velocities, unknown), rest._replace(accelerations=unknown)
        self._taken, self._running = None, Trajectory(now, now + np.array([0.0, STOP_TIME]), states)
        self._follow(now)
