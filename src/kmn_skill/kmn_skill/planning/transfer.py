"""Transfer of a solution for one door to another, as the first guess of the policy's solution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.transformation import rotation_z
from kmn_skill.planning.kinematics import turn
from kmn_skill.planning.layout import BASE, DOOR, HANDLE, HINGE, ROBOT
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.prototypes import Solution


def transfer(
    solution: Solution, model: KinematicModel, request: PlanRequest
) -> NDArray[np.float64]:
    """Return a path (T, D) for a door, made from the solution for another one.

    The base is moved by T_theta, and with the handle, whose place depends on gamma. Where the door
    is to turn by other angles than the other one, or is ajar, the base also turns with it about
    its hinge. The remaining difference to the present state fades out up to the pre-grasp pose.

    Parameters
    ----------
    solution
        For a door at the origin.
    """
    solved, path = solution
    guess = path.copy()
    for column, goal in ((HINGE, request.door_angle), (HANDLE, request.handle_angle)):
        angles = guess[:, DOOR][:, column]
        angles[:] = _stretched(angles, request.door_start[column], goal)
    pose = model.transformation.matrix(request.theta)
    hinge, handle = model.joints
    shift = np.eye(4)
    shift[:3, 3] = handle.origin(request.gamma) - handle.origin(solved)
    for before, after in zip(path, guess, strict=True):
        closing = np.linalg.inv(turn(hinge, solved, before[DOOR][HINGE]))
        opening = turn(hinge, request.gamma, after[DOOR][HINGE])
        after[BASE] = move_base(before[BASE], pose @ opening @ shift @ closing)
    before_handle = PhaseEnd.PRE_GRASP * ((len(path) - 1) // PHASE_COUNT)
    fading = np.clip(1.0 - np.arange(len(path)) / before_handle, 0.0, 1.0)[:, None]
    robot = guess[:, ROBOT]
    robot += fading**2 * (3.0 - 2.0 * fading) * (request.start - robot[0])
    return guess[1:]


def move_base(base: NDArray[np.float64], motion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Move x, y and yaw (..., 3) by a motion (4, 4) in the plane."""
    yaw = np.arctan2(motion[1, 0], motion[0, 0])
    place = base[..., :2] @ rotation_z(yaw)[:2, :2].T + motion[:2, 3]
    return np.concatenate([place, base[..., 2:] + yaw], axis=-1)


def refine(
    path: NDArray[np.float64], start: NDArray[np.float64], slices: int
) -> NDArray[np.float64]:
    """Interpolate a coarse path to more configurations a phase.

    After `PhaseEnd.GRASP` only the gripper moves for one step, on either path.

    Parameters
    ----------
    path
        (T, D) with ``T / PHASE_COUNT`` configurations a phase.
    start
        (D,) configuration before the first one.
    slices
        Configurations a phase of the result.
    """
    coarse = len(path) // PHASE_COUNT
    nodes = np.vstack([start, path])
    grasp, pressed = PhaseEnd.GRASP * coarse, PhaseEnd.PRESSED * coarse
    reach = _resampled(nodes[: grasp + 1], PhaseEnd.GRASP * slices + 1)[1:]
    press = _resampled(nodes[grasp + 1 : pressed + 1], slices)
    opening = _resampled(nodes[pressed:], slices + 1)[1:]
    return np.concatenate([reach, press, opening])


def hermite(
    nodes: NDArray[np.float64],
    velocities: NDArray[np.float64],
    times: NDArray[np.float64],
    at: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the cubic spline (N, D) through nodes (M, D), as the robot's controller has it.

    Parameters
    ----------
    velocities
        (M, D) at the nodes.
    times
        (M,) of the nodes.
    at
        (N,) times within.
    """
    i = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    duration = (times[i + 1] - times[i])[:, None]
    s = (at - times[i])[:, None] / duration
    return (
        (1.0 + 2.0 * s) * (1.0 - s) ** 2 * nodes[i]
        + s * (1.0 - s) ** 2 * duration * velocities[i]
        + s**2 * (3.0 - 2.0 * s) * nodes[i + 1]
        - s**2 * (1.0 - s) * duration * velocities[i + 1]
    )


def _stretched(angles: NDArray[np.float64], start: float, end: float) -> NDArray[np.float64]:
    """Let angles that run from 0 to their last value run between other values."""
    return start + angles / angles[-1] * (end - start)


def _resampled(nodes: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return ``count`` configurations on the curve from rest to rest through nodes (M, D)."""
    velocities: NDArray[np.float64] = np.gradient(nodes, axis=0)
    velocities[[0, -1]] = 0.0
    times = np.arange(len(nodes), dtype=np.float64)
    at = np.linspace(0.0, len(nodes) - 1.0, count, dtype=np.float64)
    return hermite(nodes, velocities, times, at)
