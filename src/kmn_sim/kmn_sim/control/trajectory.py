"""Joint trajectories: what a command must fulfil to be executed, and its sampling.

The semantics are those of joint_trajectory_controller on branch jazzy of ros2_controllers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from kmn_sim.control.interpolation import State, interpolate, nearest

LIMIT_SLACK = 0.02  # m and rad; a joint that is to hold may have been measured beyond its limit


class TrajectoryError(ValueError):
    """A trajectory that is refused as a whole; the text says why.

    Attributes
    ----------
    reason
        Short key to count it by, e.g. ``unknown_joint``.
    """

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


@dataclass(frozen=True)
class Waypoint:
    """A point of a command; ``time`` in seconds from its start, lists empty where not given."""

    time: float
    positions: Sequence[float]
    velocities: Sequence[float] = ()
    accelerations: Sequence[float] = ()
    effort: Sequence[float] = ()


@dataclass(frozen=True)
class Command:
    """A trajectory as it was sent.

    Attributes
    ----------
    names
        Joints that the points are of.
    points
        Through which the joints are to go.
    start
        From which the times of the points count, seconds; None: from now.
    """

    names: Sequence[str]
    points: Sequence[Waypoint]
    start: float | None = None


@dataclass(frozen=True, eq=False)
class Trajectory:
    """P waypoints of all J joints, NaN for joints that the command does not name.

    Attributes
    ----------
    start
        Time from which it is followed, seconds.
    times
        (P,) times of the waypoints, seconds.
    states
        P states of the J joints.
    """

    start: float
    times: NDArray[np.float64]
    states: tuple[State, ...]

    def of(self, columns: list[int]) -> Trajectory:
        """Return the trajectory of some of the joints."""
        return replace(self, states=tuple(state.of(columns) for state in self.states))

    def begin(
        self, present: State, commanded: State, continuous: NDArray[np.bool_], now: float
    ) -> Trajectory:
        """Return the trajectory as it is followed from now on.

        Up to a first point that is still ahead it leads there from the present state, at once,
        whatever its start is. With points in the past it is followed from where it is now: what
        the robot does then does not matter, and its desired state jumps.

        Parameters
        ----------
        present
            State from which the first point is reached.
        commanded
            Where joints hold that the command does not name.
        continuous
            (J,) whether a whole turn of a joint changes nothing; it goes the shorter way.
        """
        times, states = self.times, tuple(_filled(state, commanded) for state in self.states)
        if times[0] > now:
            turned = nearest(present.positions, states[0].positions, continuous)
            times, states = np.insert(times, 0, now), (present._replace(positions=turned), *states)
        return Trajectory(now, times, states)

    def sample(self, now: float) -> State:
        """Return the state that is desired at a time; after the end the last one, at rest."""
        following = int(np.searchsorted(self.times, now, side="right"))
        if following == len(self.times):
            return State.at_rest(self.states[-1].positions)
        before = max(following - 1, 0)
        duration = self.times[following] - self.times[before]
        start, end = self.states[before], self.states[following]
        return interpolate(start, end, duration, max(now - self.times[before], 0.0))

    def progress(self, now: float) -> float:
        """Return the part of its time that has passed, 0 to 1."""
        duration = self.times[-1] - self.start
        return 1.0 if now >= self.times[-1] else float(max(now - self.start, 0.0) / duration)


def check(
    command: Command,
    limits: Mapping[str, tuple[float, float]],
    now: float,
    allow_partial: bool,
) -> Trajectory:
    """Return the trajectory of a command.

    What the stock controller refuses is refused, and in addition joints that are named twice,
    times before the start, numbers that are not finite, and positions well beyond the limits, which
    it would pass on to the hardware.

    Parameters
    ----------
    limits
        Lower and upper position of each joint by name, in the order of the states.
    now
        Present time, seconds.
    allow_partial
        Whether a command need not name all joints.

    Raises
    ------
    TrajectoryError
        If anything is wrong with it.
    """
    _check_names(command.names, limits, allow_partial)
    if not command.points:
        raise TrajectoryError("empty", "the trajectory has no points, expected at least one")
    times = [point.time for point in command.points]
    _check_times(times)
    for number, point in enumerate(command.points):
        _check_point(number, point, command.names, limits)
    last = command.points[-1].velocities
    if any(velocity != 0.0 for velocity in last):
        raise TrajectoryError(
            "moving_end", f"the last point has velocities {list(last)}, expected 0"
        )
    start = now if command.start is None else command.start
    if start + times[-1] < now:
        raise TrajectoryError(
            "in_the_past",
            f"the trajectory ends {now - start - times[-1]:.3f} s in the past, it is now {now:.3f}",
        )
    columns = [list(limits).index(name) for name in command.names]
    states = tuple(
        State(
            *(
                _spread(values, columns, len(limits))
                for values in (point.positions, point.velocities, point.accelerations)
            )
        )
        for point in command.points
    )
    return Trajectory(start, start + np.array(times), states)


def _filled(state: State, commanded: State) -> State:
    """Let the joints that are not named hold their commanded position."""
    absent = np.isnan(state.positions)
    moving = [
        np.where(absent & ~np.isnan(values[~absent]).any(), 0.0, values) for values in state[1:]
    ]
    return State(np.where(absent, commanded.positions, state.positions), *moving)


def _spread(values: Sequence[float], columns: list[int], joints: int) -> NDArray[np.float64]:
    """Put the values of some joints into a vector of all, NaN for the others."""
    spread = np.full(joints, np.nan)
    if len(values):
        spread[columns] = values
    return spread


def _check_names(
    names: Sequence[str], limits: Mapping[str, tuple[float, float]], allow_partial: bool
) -> None:
    if not names:
        raise TrajectoryError("empty", "the trajectory names no joints")
    for name in names:
        if name not in limits:
            raise TrajectoryError(
                "unknown_joint", f"unknown joint '{name}', there are {', '.join(limits)}"
            )
    if len(set(names)) != len(names):
        raise TrajectoryError("joint_names", f"joint names must differ: {list(names)}")
    missing = [name for name in limits if name not in names]
    if missing and not allow_partial:
        raise TrajectoryError(
            "partial",
            f"joints are missing, {', '.join(missing)}: all must be there unless "
            "allow_partial_joints_goal is set",
        )


def _check_times(times: Sequence[float]) -> None:
    if times[0] < 0.0:
        raise TrajectoryError("times", f"the first point is at {times[0]:g} s, before the start")
    for number, (before, after) in enumerate(zip(times, times[1:], strict=False)):
        if not before < after:
            raise TrajectoryError(
                "times",
                f"times must increase, points {number} and {number + 1} are at "
                f"{before:g} and {after:g} s",
            )


def _check_point(
    number: int,
    point: Waypoint,
    names: Sequence[str],
    limits: Mapping[str, tuple[float, float]],
) -> None:
    """Raise if a point lacks positions, or one of its lists is wrong."""
    for what in ("positions", "velocities", "accelerations"):
        values = getattr(point, what)
        if len(values) != len(names) and (values or what == "positions"):
            raise TrajectoryError(
                "lengths", f"point {number} has {len(values)} {what} of {len(names)} joints"
            )
        if not np.isfinite(values).all():
            raise TrajectoryError(
                "not_finite", f"point {number} has {what} that are not finite: {list(values)}"
            )
    if point.effort:
        raise TrajectoryError("effort", f"point {number} has efforts, which are not supported")
    for name, position in zip(names, point.positions, strict=True):
        low, high = limits[name]
        if not low - LIMIT_SLACK <= position <= high + LIMIT_SLACK:
            raise TrajectoryError(
                "out_of_limits",
                f"point {number} has {name} = {position:g}, outside [{low:g}, {high:g}]",
            )
