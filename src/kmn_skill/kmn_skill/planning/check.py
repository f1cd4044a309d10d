"""The check of a plan in metres, radians and seconds, apart from the solver's own numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.clearance import REACH, clearance
from kmn_skill.planning.layout import GRIPPER, HANDLE, HINGE, ROBOT
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Phase, Plan, PlanReport, PlanRequest
from kmn_skill.planning.timing import peaks
from kmn_skill.planning.transfer import hermite
from kmn_skill.planning.world import CONTACTS, PADS, STEM, World, boxes, surfaces

SLACK = 1e-6  # of limits


class PlanRejected(Exception):  # noqa: N818
    """A plan does not fulfil what it must; the text says what."""


def check(plan: Plan, request: PlanRequest, world: World) -> PlanReport:
    """Return what a plan is like.

    Parameters
    ----------
    world
        Of the request's theta and gamma.

    Raises
    ------
    PlanRejected
        If it does not fulfil what the settings of the world's setup demand.
    """
    if not all(np.isfinite(a).all() for a in (plan.times, plan.positions, plan.velocities)):
        raise PlanRejected("it has numbers that are not finite")
    limits = world.setup.settings.check
    _check_start(plan, request, limits.start)
    _check_motion(plan, world)
    handle, door = _check_targets(plan, request, limits.angle)
    grasp = plan.phase(PhaseName.GRASP)
    path = _sampled(plan, grasp, world, limits.samples)
    contact = _contact_error(path[grasp.last * limits.samples :], world)
    if contact > limits.contact:
        raise PlanRejected(
            f"gripper and handle are {1e3 * contact:.1f} mm apart, allowed are "
            f"{1e3 * limits.contact:g} mm"
        )
    reach = plan.phase(PhaseName.REACH)
    unheld = slice(reach.first * limits.samples, reach.last * limits.samples + 1)
    smallest, names = _clearance(path, unheld, world)
    if smallest < limits.clearance:
        raise PlanRejected(
            f"{names[0]} comes within {1e3 * smallest:.0f} mm of {names[1]}, expected at least "
            f"{1e3 * limits.clearance:g} mm"
        )
    return replace(
        plan.report,
        contact_error=contact,
        clearance=smallest,
        handle_angle=handle,
        door_angle=door,
        duration=float(plan.times[-1]),
    )


def _check_start(plan: Plan, request: PlanRequest, tolerance: float) -> None:
    start = np.concatenate([plan.positions[0], plan.door[0]])
    error = np.abs(start - request.configuration).max()
    if error > tolerance:
        raise PlanRejected(f"it starts {error:.3g} away from the present state")


def _check_motion(plan: Plan, world: World) -> None:
    """Check order of times, limits of positions, velocities and accelerations, and the end."""
    steps = np.diff(plan.times)
    if plan.times[0] != 0.0 or steps.min() <= 0.0:
        raise PlanRejected("its times do not increase from 0")
    if np.abs(plan.velocities[-1]).max() > SLACK:
        raise PlanRejected("it does not end at rest")
    low, high = world.limits()
    positions = np.hstack([plan.positions, plan.door])
    # The start is as measured: a joint may stand a little beyond its limit.
    excess = np.maximum(low - positions, positions - high)[1:].max(axis=0)
    if excess.max() > SLACK:
        name = world.joint_names[int(excess.argmax())]
        raise PlanRejected(f"{name} leaves its limits by {excess.max():.3g}")
    for what, values, allowed in zip(
        ("velocity", "acceleration"),
        peaks(plan.positions, plan.velocities, steps),
        world.setup.robot.limits.T,
        strict=True,
    ):
        ratio = values / allowed
        if ratio.max() > 1.0 + SLACK:
            name = plan.joint_names[int(ratio.argmax())]
            raise PlanRejected(f"{name} has {ratio.max():.2f} of the {what} allowed")


def _check_targets(plan: Plan, request: PlanRequest, tolerance: float) -> tuple[float, float]:
    """Check handle and door; return their angles when pressed and at the end."""
    press = plan.phase(PhaseName.PRESS)
    handle, door = float(plan.door[press.last, HANDLE]), float(plan.door[-1, HINGE])
    for what, angle, target in (
        ("handle is pressed", handle, request.handle_angle),
        ("door is opened", door, request.door_angle),
    ):
        if abs(angle - target) > tolerance:
            raise PlanRejected(f"the {what} to {angle:.3f} rad, wanted are {target:.3f} rad")
    closed = np.abs(plan.door[: press.last, HINGE] - request.door_start[HINGE]).max()
    if closed > tolerance:
        raise PlanRejected(f"the door moves by {closed:.3f} rad before its handle is pressed")
    return handle, door


def _sampled(plan: Plan, grasp: Phase, world: World, samples: int) -> NDArray[np.float64]:
    """Return the configurations (N, D) on the way.

    The fingers squeeze, but stand where they touch.
    """
    count = len(plan.times) - 1
    at = np.interp(np.arange(count * samples + 1) / samples, np.arange(count + 1), plan.times)
    robot = hermite(plan.positions, plan.velocities, plan.times, at)
    rates = np.gradient(plan.door, plan.times, axis=0)
    rates[~plan.velocities.any(axis=1)] = 0.0  # where the robot rests
    path = np.hstack([robot, hermite(plan.door, rates, plan.times, at)])
    gripper = path[:, ROBOT][:, GRIPPER]
    if gripper[grasp.last * samples :].max() > world.touching:
        raise PlanRejected("the gripper does not close about the handle")
    closing = gripper[grasp.first * samples :]
    np.maximum(closing, world.touching, out=closing)
    return path


def _contact_error(path: NDArray[np.float64], world: World) -> float:
    """Return the largest distance (m) between a pad and its point on the handle."""
    places = world.poses(path, [*PADS, *CONTACTS])[..., :3, 3]
    return float(np.linalg.norm(places[:, :2] - places[:, 2:], axis=-1).max())


def _clearance(
    path: NDArray[np.float64], unheld: slice, world: World
) -> tuple[float, tuple[str, str]]:
    """Return the smallest distance (m) between what must not touch, and the names of the two.

    Parameters
    ----------
    unheld
        Configurations from where the fingers have let go of the handle to where they close on it.
    """
    robot, settings = world.setup.robot, world.setup.settings
    shape, held = robot.planning, (settings.grasp.body, STEM)
    own, parts = boxes(robot), surfaces(robot, settings.check.spacing)
    around = world.door_boxes()
    around.update({name: own[name] for name in shape.obstacles})
    frames = sorted({box.frame for box in around.values()} | {p.frame for p in parts.values()})
    poses = dict(zip(frames, world.poses(path, frames).transpose(1, 0, 2, 3), strict=True))
    smallest, names = REACH, ("", "")
    # Small bodies first: they come nearest, and leave less of the large ones to be measured.
    for body, part in sorted(parts.items(), key=lambda item: item[1].radius):
        for other, box in around.items():
            if other in shape.obstacles and body not in shape.moving:
                continue
            free = unheld if body in shape.fingers and other in held else slice(None)
            part_poses, box_poses = poses[part.frame][free], poses[box.frame][free]
            distance = clearance(part, part_poses, box, box_poses, reach=smallest)
            if distance < smallest:
                smallest, names = distance, (body, other)
    return smallest, names
