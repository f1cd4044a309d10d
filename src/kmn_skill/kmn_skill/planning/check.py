"""The check of a plan in metres, radians and seconds, apart from the solver's own numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.clearance import REACH, clearance
from kmn_skill.planning.layout import GRIPPER, LATCH, MOVED, OBJECT_JOINTS, ROBOT
from kmn_skill.planning.phases import PhaseName
from kmn_skill.planning.plan import Phase, Plan, PlanReport, PlanRequest
from kmn_skill.planning.robot_frames import boxes, surfaces
from kmn_skill.planning.timing import near_the_handle, peaks
from kmn_skill.planning.transfer import hermite
from kmn_skill.planning.world import CONTACTS, GRASP, PADS, STEM, TOOL, World

SLACK = 1e-6  # of limits
SPEED_SLACK = 0.1  # of the speeds of hand and object, which only the mean of a motion keeps exactly


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
    unlatched, opened = _check_targets(plan, request, world)
    grasp = plan.phase(PhaseName.GRASP)
    count = len(plan.times) - 1
    instants = np.arange(count * limits.samples + 1) / limits.samples
    at = np.interp(instants, np.arange(count + 1), plan.times)
    path = _sampled(plan, at, grasp, world)
    _check_speeds(path, at, at >= plan.times[grasp.last], world)
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
    if plan.times[-1] > limits.duration:
        raise PlanRejected(
            f"it takes {plan.times[-1]:.0f} s, expected at most {limits.duration:g} s"
        )
    return replace(
        plan.report,
        contact_error=contact,
        clearance=smallest,
        unlatched=unlatched,
        opened=opened,
        duration=float(plan.times[-1]),
    )


def _check_start(plan: Plan, request: PlanRequest, tolerance: float) -> None:
    start = np.concatenate([plan.positions[0], plan.object_joints[0]])
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
    positions = np.hstack([plan.positions, plan.object_joints])
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


def _check_targets(plan: Plan, request: PlanRequest, world: World) -> tuple[float, float]:
    """Check the object's joints; return where they are when it is unlatched, and at the end."""
    press, settings = plan.phase(PhaseName.PRESS), world.setup.settings
    tolerance, clear = settings.check.angle, settings.check.unlatched
    unlatched = float(plan.object_joints[press.last, LATCH])
    opened, relaxed = plan.object_joints[-1, [MOVED, LATCH]].tolist()
    names = world.joint_names[OBJECT_JOINTS]
    for name, position, target in (
        (names[LATCH], unlatched, request.unlatched),
        (names[MOVED], opened, request.target),
        (names[LATCH], relaxed, settings.policy.relaxed * request.unlatched),
    ):
        if abs(position - target) > tolerance:
            raise PlanRejected(f"the {name} is moved to {position:.3f}, wanted is {target:.3f}")
    way = plan.object_joints[: press.last, MOVED] - request.object_start[MOVED]
    if (early := float(np.abs(way).max())) > tolerance:
        raise PlanRejected(f"the {names[MOVED]} moves by {early:.3f} before it is unlatched")
    opening = plan.object_joints[press.last :]
    let_up = np.abs(opening[:, LATCH] - request.unlatched) > tolerance
    if (least := float(np.abs(opening[let_up, MOVED]).min(initial=np.inf))) < clear:
        raise PlanRejected(
            f"the {names[LATCH]} is let up with the {names[MOVED]} at {least:.3f}, expected at "
            f"least {clear:g}"
        )
    return unlatched, opened


def _sampled(
    plan: Plan, at: NDArray[np.float64], grasp: Phase, world: World
) -> NDArray[np.float64]:
    """Return the configurations (N, D) at some times (N,).

    The fingers squeeze, but stand where they touch.
    """
    robot = hermite(plan.positions, plan.velocities, plan.times, at)
    rates = np.gradient(plan.object_joints, plan.times, axis=0)
    rates[~plan.velocities.any(axis=1)] = 0.0  # where the robot rests
    path = np.hstack([robot, hermite(plan.object_joints, rates, plan.times, at)])
    gripper = path[:, ROBOT][:, GRIPPER]
    if gripper[at >= plan.times[grasp.last]].max() > world.touching:
        raise PlanRejected("the gripper does not close about the handle")
    closing = gripper[int(np.searchsorted(at, plan.times[grasp.first])) :]
    np.maximum(closing, world.touching, out=closing)
    return path


def _check_speeds(
    path: NDArray[np.float64], at: NDArray[np.float64], held: NDArray[np.bool_], world: World
) -> None:
    """Check the speeds of the hand near the handle, and of the object's joints.

    Parameters
    ----------
    at, held
        (N,) times of the configurations (N, D), seconds, and whether the hand holds the handle.
    """
    settings, steps = world.setup.settings.timing, np.diff(at)
    places = world.poses(path, [TOOL, GRASP])[..., :3, 3]
    hand = np.linalg.norm(np.diff(places[:, 0], axis=0), axis=1) / steps
    near = near_the_handle(places, world)
    joints = np.abs(np.diff(path[:, OBJECT_JOINTS], axis=0)) / steps[:, None]
    names = world.joint_names[OBJECT_JOINTS]
    for what, speeds, allowed, unit in (
        ("hand", hand[near[:-1] & near[1:] & ~held[1:]], settings.approach_speed, "m/s"),
        ("hand that holds the handle", hand[held[:-1]], settings.held_speed, "m/s"),
        (names[MOVED], joints[:, MOVED], settings.moved_speed, "rad/s or m/s"),
        (names[LATCH], joints[:, LATCH], settings.latch_speed, "rad/s or m/s"),
    ):
        fastest = speeds.max(initial=0.0)
        if fastest > (1.0 + SPEED_SLACK) * allowed:
            raise PlanRejected(
                f"the {what} moves at {fastest:.2f} {unit}, allowed are {allowed:g} {unit}"
            )


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
    shape, held = robot.planning, (world.setup.action.grasp.body.name, STEM)
    own, parts = boxes(robot), surfaces(robot, settings.check.spacing)
    around = world.object_boxes()
    around.update({name: own[name] for name in shape.obstacles})
    frames = sorted({box.frame for box in around.values()} | {p.frame for p in parts.values()})
    poses = dict(zip(frames, world.poses(path, frames).transpose(1, 0, 2, 3), strict=True))
    inverse = {frame: np.linalg.inv(poses[frame]) for frame in {b.frame for b in around.values()}}
    smallest, names = REACH, ("", "")
    # Small bodies first: they come nearest, and leave less of the large ones to be measured.
    for body, part in sorted(parts.items(), key=lambda item: item[1].radius):
        for other, box in around.items():
            if other in shape.obstacles and body not in shape.moving:
                continue
            free = unheld if body in shape.fingers and other in held else slice(None)
            relative = inverse[box.frame][free] @ poses[part.frame][free]
            distance = clearance(part, relative, box, reach=smallest)
            if distance < smallest:
                smallest, names = distance, (body, other)
    return smallest, names
