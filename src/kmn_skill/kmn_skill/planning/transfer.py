"""Transfer of a solution for one object to another, as the first guess of the policy's solution."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.transformation import rotation_z
from kmn_skill.planning.layout import BASE, LATCH, MOVED, OBJECT_JOINTS, ROBOT
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.prototypes import Solution


def transfer(
    solution: Solution, model: KinematicModel, action: Action, request: PlanRequest
) -> NDArray[np.float64]:
    """Return a path (T, D) for an object, made from the solution for another one.

    The base is moved by T_theta, and with what is grasped, whose place depends on gamma and on how
    far the object is open. The remaining difference to the present state fades out up to the
    pre-grasp pose.

    Parameters
    ----------
    solution
        For an object at the origin.
    """
    solved, path = solution
    guess = path.copy()
    for column, goal in ((MOVED, request.target), (LATCH, request.unlatched)):
        positions = guess[:, OBJECT_JOINTS][:, column]
        positions[:] = _stretched(positions, request.object_start[column], goal)
    pose = model.transformation.matrix(request.theta)
    joint, here, there = (
        action.joint,
        action.grasp.place(solved),
        action.grasp.place(request.gamma, request.hold),
    )
    for before, after in zip(path, guess, strict=True):
        closed = joint.motion(solved, before[OBJECT_JOINTS][MOVED])
        opened = pose @ joint.motion(request.gamma, after[OBJECT_JOINTS][MOVED])
        ends = closed @ [*here, 1.0], opened @ [*there, 1.0]
        yaw = _yaw(opened @ np.linalg.inv(closed))
        after[BASE] = move_base(before[BASE], yaw, ends[0][:2], ends[1][:2])
    before_handle = PhaseEnd.PRE_GRASP * ((len(path) - 1) // PHASE_COUNT)
    fading = np.clip(1.0 - np.arange(len(path)) / before_handle, 0.0, 1.0)[:, None]
    robot = guess[:, ROBOT]
    robot += fading**2 * (3.0 - 2.0 * fading) * (request.start - robot[0])
    return guess[1:]


def move_base(
    base: NDArray[np.float64], yaw: float, start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Turn x, y and yaw (..., 3) by an angle (rad), as a point (2,) moves from start to end."""
    turn = rotation_z(np.array(yaw))[:2, :2]
    place = (base[..., :2] - start) @ turn.T + end
    return np.concatenate([place, base[..., 2:] + yaw], axis=-1)


def _yaw(motion: NDArray[np.float64]) -> float:
    """Return by what angle (rad) a motion (4, 4) turns about the vertical."""
    return float(np.arctan2(motion[1, 0], motion[0, 0]))


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


def _stretched(positions: NDArray[np.float64], start: float, end: float) -> NDArray[np.float64]:
    """Let positions that begin at 0 begin elsewhere, and come as far as another one."""
    furthest = positions[np.abs(positions).argmax()]
    way = positions / furthest if furthest else np.linspace(0.0, 1.0, len(positions))
    return np.asarray(start + way * (end - start))


def _resampled(nodes: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Return ``count`` configurations on the curve from rest to rest through nodes (M, D)."""
    velocities: NDArray[np.float64] = np.gradient(nodes, axis=0)
    velocities[[0, -1]] = 0.0
    times = np.arange(len(nodes), dtype=np.float64)
    at = np.linspace(0.0, len(nodes) - 1.0, count, dtype=np.float64)
    return hermite(nodes, velocities, times, at)
