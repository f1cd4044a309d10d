"""The controllers of a robot, of which each has some of the joints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from kmn_sim.control.interpolation import State
from kmn_sim.control.trajectory import Command, check
from kmn_sim.control.trajectory_controller import TrajectoryController
from kmn_sim.control.trajectory_goal import Goal
from kmn_sim.control.velocity_controller import VelocityController


class RobotControllers(Mapping[str, TrajectoryController]):
    """Those that take trajectories by name; one of the whole robot takes them all over.

    Parameters
    ----------
    groups
        Joints of each controller by its name; each joint has one.
    limits
        Lower and upper position of each joint by name, in the order of the robot's states.
    positions
        (J,) where the joints are, m and rad.
    continuous
        (J,) whether a whole turn of a joint changes nothing.
    from_desired_state, allow_partial
        As of each controller.
    base
        Drives the joints that are in no group; without it these stay where they are.

    Attributes
    ----------
    base
        As it was given.
    """

    def __init__(
        self,
        groups: Mapping[str, Sequence[str]],
        limits: Mapping[str, tuple[float, float]],
        positions: NDArray[np.float64],
        continuous: NDArray[np.bool_],
        from_desired_state: bool,
        allow_partial: bool,
        base: VelocityController | None = None,
    ) -> None:
        self.base, self._allow_partial = base, allow_partial
        order, grouped = list(limits), {joint for joints in groups.values() for joint in joints}
        told = [joint for joint in order if joint in grouped]
        self._limits = {joint: limits[joint] for joint in told}
        self._start = State.at_rest(positions)
        self._driven = [column for column, joint in enumerate(order) if joint not in grouped]
        self._shares = {
            name: [told.index(joint) for joint in joints] for name, joints in groups.items()
        }
        self._columns = {
            name: [order.index(joint) for joint in joints] for name, joints in groups.items()
        }
        self._controllers = {
            name: TrajectoryController(
                {joint: limits[joint] for joint in joints},
                positions[self._columns[name]],
                continuous[self._columns[name]],
                from_desired_state,
                allow_partial,
            )
            for name, joints in groups.items()
        }

    def __getitem__(self, name: str) -> TrajectoryController:
        return self._controllers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._controllers)

    def __len__(self) -> int:
        return len(self._controllers)

    def accept(self, command: Command, now: float) -> None:
        """Take over a command of the whole robot, from whatever the controllers do.

        Raises
        ------
        TrajectoryError
            If the command is refused; what is done goes on.
        """
        trajectory = check(command, self._limits, now, self._allow_partial)
        for name, controller in self.items():
            controller.follow(trajectory.of(self._shares[name]))

    def part(self, name: str, state: State) -> State:
        """Return the state of a controller's joints out of that of all."""
        return state.of(self._columns[name])

    def cancel(self, name: str, goal: Goal, measured: State, now: float) -> None:
        """Cancel a controller's goal; ``measured`` is where all joints are."""
        self[name].cancel(goal, self.part(name, measured), now)

    def sample(self, now: float, measured: State) -> State:
        """Return the desired state of all joints at a time; ``measured`` is where they are."""
        desired = State(*(np.empty_like(measured.positions) for _ in State._fields))
        parts = [
            (columns, self[name].sample(now, measured.of(columns)))
            for name, columns in self._columns.items()
        ]
        base, driven = self.base, self._driven
        held = self._start.of(driven)
        parts.append((driven, base.sample(now, measured.of(driven)) if base else held))
        for columns, part in parts:
            for whole, values in zip(desired, part, strict=True):
                whole[columns] = values
        return desired

    def progress(self, now: float) -> float | None:
        """Return the progress of the controller that is behind; None where none moves."""
        parts = [part for each in self.values() if (part := each.progress(now)) is not None]
        return min(parts, default=None)
