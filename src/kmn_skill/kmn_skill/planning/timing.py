"""Time parametrisation: a path becomes a plan that keeps the robot's velocities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.layout import DOOR, GRIPPER, ROBOT
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd, PhaseName
from kmn_skill.planning.plan import Phase, Plan, PlanReport, PlanRequest
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.settings import TimingSettings

UNCHECKED = PlanReport(np.inf, -np.inf, np.nan, np.nan, np.nan, np.nan, "")


def timed_plan(
    path: NDArray[np.float64], request: PlanRequest, robot: RobotModel, settings: TimingSettings
) -> Plan:
    """Return the plan that follows a path; it is not checked yet.

    Up to the handle, and from there, the steps have equal times. Between the two the robot rests
    while the gripper closes; from then on it squeezes, for the handle stops the fingers.

    Parameters
    ----------
    path
        (T, D) positions after the start.
    """
    nodes = np.vstack([request.configuration, path])
    slices = len(path) // PHASE_COUNT
    grasp, pressed, end = PhaseEnd.GRASP * slices, PhaseEnd.PRESSED * slices, len(path)
    positions, limits = nodes[:, ROBOT].copy(), robot.limits
    times, velocities = np.zeros(len(nodes)), np.zeros_like(positions)
    times[: grasp + 1], velocities[: grasp + 1] = _paced(
        positions[: grasp + 1], limits, settings.min_step
    )
    after, rates = _paced(positions[grasp + 1 :], limits, settings.min_step)
    times[grasp + 1 :] = times[grasp] + settings.dwell + after
    velocities[grasp + 1 :] = rates
    held = positions[grasp + 1 :, GRIPPER]
    held[:] = np.maximum(held - settings.squeeze, 0.0)
    velocities[grasp + 1 :, GRIPPER] = 0.0
    phases = (
        Phase(PhaseName.REACH, 0, grasp),
        Phase(PhaseName.GRASP, grasp, grasp + 1),
        Phase(PhaseName.PRESS, grasp + 1, pressed),
        Phase(PhaseName.OPEN, pressed, end),
    )
    door = nodes[:, DOOR].copy()
    return Plan(robot.joint_names, times, positions, velocities, door, phases, UNCHECKED)


def preceded(
    plan: Plan, path: NDArray[np.float64], robot: RobotModel, settings: TimingSettings
) -> Plan:
    """Return a plan that first lets go of the handle.

    Parameters
    ----------
    path
        (R + 1, D) positions, with the start, up to where the plan begins.
    """
    times, velocities = _paced(path[:, ROBOT], robot.limits, settings.min_step)
    count = len(path) - 1
    phases = [Phase(name, first + count, last + count) for name, first, last in plan.phases]
    return replace(
        plan,
        times=np.concatenate([times, times[-1] + plan.times[1:]]),
        positions=np.vstack([path[:, ROBOT], plan.positions[1:]]),
        velocities=np.vstack([velocities, plan.velocities[1:]]),
        door=np.vstack([path[:, DOOR], plan.door[1:]]),
        phases=(Phase(PhaseName.RELEASE, 0, count), *phases),
    )


def _paced(
    nodes: NDArray[np.float64], limits: NDArray[np.float64], min_step: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (M,) and velocities (M, J) through nodes (M, J), from rest to rest.

    Parameters
    ----------
    limits
        (J, 2) largest velocities and accelerations.
    """
    rates: NDArray[np.float64] = np.gradient(nodes, axis=0)
    rates[[0, -1]] = 0.0
    fastest, sharpest = peaks(nodes, rates, np.ones(len(nodes) - 1))
    step = max(
        min_step,
        float((fastest / limits[:, 0]).max()),
        float(np.sqrt(sharpest / limits[:, 1]).max()),
    )
    return step * np.arange(len(nodes), dtype=np.float64), rates / step


def peaks(
    nodes: NDArray[np.float64], velocities: NDArray[np.float64], steps: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the largest velocities and accelerations (J,) of the cubic spline through nodes.

    Parameters
    ----------
    nodes, velocities
        (M, J) at the nodes.
    steps
        (M - 1,) times between them.
    """
    step = steps[:, None]
    mean = np.diff(nodes, axis=0) / step
    before, after = velocities[:-1], velocities[1:]
    middle = 1.5 * mean - 0.25 * (before + after)
    first = (6.0 * mean - 4.0 * before - 2.0 * after) / step
    last = (-6.0 * mean + 2.0 * before + 4.0 * after) / step
    speeds = np.maximum(np.abs(velocities).max(axis=0), np.abs(middle).max(axis=0))
    return speeds, np.maximum(np.abs(first), np.abs(last)).max(axis=0)
