"""Time parametrisation: a path becomes a plan at the limits of robot, hand and object."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.layout import GRIPPER, OBJECT_JOINTS, ROBOT
from kmn_skill.planning.motion import Motion
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd, PhaseName
from kmn_skill.planning.plan import Phase, Plan, PlanReport, PlanRequest
from kmn_skill.planning.world import GRASP, TOOL, World

UNCHECKED = PlanReport(np.inf, -np.inf, np.nan, np.nan, np.nan, np.nan, "")


class Stretch(NamedTuple):
    """A motion of robot and object from rest to rest.

    Attributes
    ----------
    times
        (P,) seconds from its start.
    positions, velocities
        (P, J) of the robot's joints, m and rad, and per second.
    object_joints
        (P, 2) positions of the object's joints, m and rad.
    motion
        Of which they are samples.
    slowed
        By how much the motion was slowed down.
    """

    times: NDArray[np.float64]
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    object_joints: NDArray[np.float64]
    motion: Motion
    slowed: float

    def waypoint(self, node: int) -> int:
        """Return the first waypoint at which a node of the path was passed."""
        return int(np.searchsorted(self.times, self.slowed * self.motion.time_of(node)))


def timed_plan(path: NDArray[np.float64], request: PlanRequest, world: World) -> Plan:
    """Return the plan that follows a path; it is not checked yet.

    Up to the handle, and from there, it stops nowhere. Between the two the robot rests while the
    gripper closes; from then on it squeezes, for the handle stops the fingers.

    Parameters
    ----------
    path
        (T, D) positions after the start.

    Raises
    ------
    MotionError
        If the path cannot be followed.
    """
    settings, slices = world.setup.settings.timing, len(path) // PHASE_COUNT
    grasp = PhaseEnd.GRASP * slices
    nodes = np.vstack([request.configuration, path])
    reach = _stretch(nodes[: grasp + 1], world, settings.approach_speed)
    held = _stretch(nodes[grasp + 1 :], world, settings.held_speed)
    grip = held.positions[:, GRIPPER]
    grip[:] = np.maximum(grip - world.setup.robot.planning.grip.squeeze, 0.0)
    held.velocities[:, GRIPPER] = 0.0
    dwell = max(settings.dwell, _least_time(reach.positions[-1], held.positions[0], world))
    closed = len(reach.times)
    pressed = closed + held.waypoint(PhaseEnd.PRESSED * slices - grasp - 1)
    phases = (
        Phase(PhaseName.REACH, 0, closed - 1),
        Phase(PhaseName.GRASP, closed - 1, closed),
        Phase(PhaseName.PRESS, closed, pressed),
        Phase(PhaseName.OPEN, pressed, closed + len(held.times) - 1),
    )
    return Plan(
        world.setup.robot.joint_names,
        np.concatenate([reach.times, reach.times[-1] + dwell + held.times]),
        np.vstack([reach.positions, held.positions]),
        np.vstack([reach.velocities, held.velocities]),
        np.vstack([reach.object_joints, held.object_joints]),
        phases,
        UNCHECKED,
    )


def preceded(plan: Plan, motions: Sequence[NDArray[np.float64]], world: World) -> Plan:
    """Return a plan that first lets go of the handle.

    Parameters
    ----------
    motions
        (R + 1, D) positions of each motion, from rest to rest, up to where the plan begins.

    Raises
    ------
    MotionError
        If the path cannot be followed.
    """
    speed, led = world.setup.settings.timing.approach_speed, plan
    for motion in reversed(motions):
        before = _stretch(motion, world, speed)
        led = replace(
            led,
            times=np.concatenate([before.times, before.times[-1] + led.times[1:]]),
            positions=np.vstack([before.positions, led.positions[1:]]),
            velocities=np.vstack([before.velocities, led.velocities[1:]]),
            object_joints=np.vstack([before.object_joints, led.object_joints[1:]]),
        )
    count = len(led.times) - len(plan.times)
    phases = [Phase(name, first + count, last + count) for name, first, last in plan.phases]
    return replace(led, phases=(Phase(PhaseName.RELEASE, 0, count), *phases))


def _stretch(nodes: NDArray[np.float64], world: World, near_speed: float) -> Stretch:
    """Follow nodes (M, D) from rest to rest, at the limits of joints, hand and object.

    Parameters
    ----------
    near_speed
        Largest speed of the hand where it is near the handle, m/s.
    """
    settings, limits = world.setup.settings.timing, world.setup.robot.limits
    places = world.poses(nodes, [TOOL, GRASP])[..., :3, 3]
    way = np.linalg.norm(np.diff(places[:, 0], axis=0), axis=1)
    hand = np.concatenate([[0.0], np.cumsum(way)])
    near = near_the_handle(places, world)
    speeds = np.full((len(nodes), nodes.shape[1] + 1), np.inf)
    speeds[:, :-1][:, ROBOT] = limits[:, 0]
    speeds[:, :-1][:, OBJECT_JOINTS] = settings.moved_speed, settings.latch_speed
    speeds[near, -1] = near_speed
    accelerations = np.concatenate([limits[:, 1], np.full(3, np.inf)])
    motion = Motion(np.column_stack([nodes, hand]), speeds, accelerations, settings.smoothing)
    count = int(np.ceil(motion.duration / settings.step))
    times = np.linspace(0.0, motion.duration, count + 1, dtype=np.float64)
    positions, velocities = motion.positions(times)[:, :-1], motion.velocities(times)[:, :-1]
    # A spline may leave the limits that its nodes keep. The start is as measured, maybe beyond.
    positions[1:] = np.clip(positions[1:], *world.limits())
    robot, rates = positions[:, ROBOT], velocities[:, ROBOT]
    fastest, sharpest = peaks(robot, rates, np.diff(times))
    # Between waypoints the controller's cubic splines differ a little from the motion.
    slowed = max(1.0, (fastest / limits[:, 0]).max(), np.sqrt((sharpest / limits[:, 1]).max()))
    return Stretch(
        slowed * times, robot, rates / slowed, positions[:, OBJECT_JOINTS], motion, slowed
    )


def _least_time(start: NDArray[np.float64], end: NDArray[np.float64], world: World) -> float:
    """Return the time of a cubic motion of the joints (J,) from rest to rest, seconds."""
    way, limits = np.abs(end - start), world.setup.robot.limits
    return float(np.maximum(1.5 * way / limits[:, 0], np.sqrt(6.0 * way / limits[:, 1])).max())


def near_the_handle(places: NDArray[np.float64], world: World) -> NDArray[np.bool_]:
    """Tell where (N,) the hand is not further from the grasp than before it.

    Parameters
    ----------
    places
        (N, 2, 3) of the hand, and of where it grasps the handle, metres.
    """
    distance = np.linalg.norm(places[:, 0] - places[:, 1], axis=1)
    return distance <= abs(world.setup.settings.policy.pre_grasp)


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
