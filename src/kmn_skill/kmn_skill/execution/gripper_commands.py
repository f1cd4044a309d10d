"""What a gripper is told that takes positions one by one, in the place of a trajectory."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_skill.execution.plan_execution import Part

STILL = 0.02  # m or rad, by which the gripper of a plan may move without being told to


class GripperCommand(NamedTuple):
    """A position (m or rad) to which the gripper goes from a time (s) on."""

    time: float
    position: float


def gripper_commands(part: Part) -> list[GripperCommand]:
    """Return the commands that make a gripper open and close as in a part of a plan.

    Each time that it begins to move one way, it is told how far.

    Parameters
    ----------
    part
        Of the gripper's joint alone.
    """
    positions: NDArray[np.float64] = part.positions[:, 0]
    moves = np.sign(np.diff(positions))
    commands: list[GripperCommand] = []
    told = float(positions[0])
    for way in (1.0, -1.0):
        starts = np.flatnonzero((moves == way) & (np.append(0.0, moves[:-1]) != way))
        for start in starts:
            run = moves[start:] == way
            end = start + (int(run.argmin()) if not run.all() else run.size)
            time = part.start + float(part.times[start])
            commands.append(GripperCommand(time, float(positions[end])))
    kept = []
    for command in sorted(commands):
        if abs(command.position - told) > STILL:
            told = command.position
            kept.append(command)
    return kept
