"""The check of a plan in metres, radians and seconds, apart from the solver's own numbers."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.planning.clearance import Surface, clearance
from kmn_skill.planning.plan import RELEASE, Phase, Plan, PlanReport, PlanRequest
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.settings import SkillSettings
from kmn_skill.planning.timing import peaks
from kmn_skill.planning.transfer import hermite
from kmn_skill.planning.world import CONTACTS, PADS, World, boxes, surfaces

HOLDING = ("left_finger", "right_finger", "left_tip", "right_tip")  # may touch the handle held
OBSTACLES = ("base", "column", "torso", "head", "right_upper_arm", "right_forearm", "right_hand")
MOVING = ("forearm", "wrist", "palm", *HOLDING)  # of the left arm, that may touch the robot
SLACK = 1e-6  # of limits


class PlanRejected(Exception):  # noqa: N818
    """A plan does not fulfil what it must; the text says what."""


def check(plan: Plan, request: PlanRequest, world: World | None = None) -> PlanReport:
    """Return what a plan is like.

    Parameters
    ----------
    world
        Of the request, if it is at hand.

    Raises
    ------
    PlanRejected
        If it does not fulfil what ``config/skill/door.yaml`` demands.
    """
    settings, robot = SkillSettings.load(), RobotModel.load()
    if world is None:
        model = KinematicModel.load("door")
        world = World(model, request.theta, request.gamma, robot, settings.grasp)
    if not all(np.isfinite(a).all() for a in (plan.times, plan.positions, plan.velocities)):
        raise PlanRejected("it has numbers that are not finite")
    limits = settings.check
    _check_start(plan, request, limits.start)
    _check_motion(plan, robot, world)
    handle, door = _check_targets(plan, request, limits.angle)
    grasp = next(phase for phase in plan.phases if phase.name == "grasp")
    path = _sampled(plan, grasp, world, limits.samples)
    contact = _contact_error(path[grasp.last * limits.samples :], world)
    if contact > limits.contact:
        raise PlanRejected(
            f"gripper and handle are {1e3 * contact:.1f} mm apart, allowed are "
            f"{1e3 * limits.contact:g} mm"
        )
    released = next((phase.last for phase in plan.phases if phase.name == RELEASE), 0)
    least, names = _clearance(path, released * limits.samples, grasp.first * limits.samples, world)
    if least < limits.clearance:
        raise PlanRejected(
            f"{names[0]} comes within {1e3 * least:.0f} mm of {names[1]}, expected at least "
            f"{1e3 * limits.clearance:g} mm"
        )
    return replace(
        plan.report,
        contact_error=contact,
        clearance=least,
        handle_angle=handle,
        door_angle=door,
        duration=float(plan.times[-1]),
    )


def _check_start(plan: Plan, request: PlanRequest, tolerance: float) -> None:
    start = np.concatenate([plan.positions[0], plan.door[0]])
    error = np.abs(start - [*request.start, *request.door_start]).max()
    if error > tolerance:
        raise PlanRejected(f"it starts {error:.3g} away from the present state")


def _check_motion(plan: Plan, robot: RobotModel, world: World) -> None:
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
    for what, values, largest in zip(
        ("velocity", "acceleration"),
        peaks(plan.positions, plan.velocities, steps),
        np.array(list(robot.motors.values())).T,
        strict=True,
    ):
        ratio = values / largest
        if ratio.max() > 1.0 + SLACK:
            name = plan.joint_names[int(ratio.argmax())]
            raise PlanRejected(f"{name} has {ratio.max():.2f} of the {what} allowed")


def _check_targets(plan: Plan, request: PlanRequest, tolerance: float) -> tuple[float, float]:
    """Check handle and door; return their angles when pressed and at the end."""
    press = next(phase for phase in plan.phases if phase.name == "press")
    handle, door = float(plan.door[press.last, 1]), float(plan.door[-1, 0])
    for what, angle, target in (
        ("handle is pressed", handle, request.handle_angle),
        ("door is opened", door, request.door_angle),
    ):
        if abs(angle - target) > tolerance:
            raise PlanRejected(f"the {what} to {angle:.3f} rad, wanted are {target:.3f} rad")
    closed = np.abs(plan.door[: press.last, 0] - request.door_start[0]).max()
    if closed > tolerance:
        raise PlanRejected(f"the door moves by {closed:.3f} rad before its handle is pressed")
    return handle, door


def _sampled(plan: Plan, grasp: Phase, world: World, samples: int) -> NDArray[np.float64]:
    """Return the configurations (N, 13) on the way.

    The fingers squeeze, but stand where they touch.
    """
    count = len(plan.times) - 1
    at = np.interp(np.arange(count * samples + 1) / samples, np.arange(count + 1), plan.times)
    robot = hermite(plan.positions, plan.velocities, plan.times, at)
    rates = np.gradient(plan.door, plan.times, axis=0)
    rates[~plan.velocities.any(axis=1)] = 0.0  # where the robot rests
    path = np.hstack([robot, hermite(plan.door, rates, plan.times, at)])
    if path[grasp.last * samples :, 10].max() > world.touching:
        raise PlanRejected("the gripper does not close about the handle")
    closing = path[grasp.first * samples :, 10]
    np.maximum(closing, world.touching, out=closing)
    return path


def _contact_error(path: NDArray[np.float64], world: World) -> float:
    """Return the largest distance (m) between a pad and its point on the handle."""
    places = world.poses(path, [*PADS, *CONTACTS])[..., :3, 3]
    return float(np.linalg.norm(places[:, :2] - places[:, 2:], axis=-1).max())


@cache
def _surfaces() -> dict[str, Surface]:
    return surfaces(RobotModel.load(), SkillSettings.load().check.spacing)


def _clearance(
    path: NDArray[np.float64], released: int, closing: int, world: World
) -> tuple[float, tuple[str, str]]:
    """Return the least distance (m) between what shall not touch, and the names of the two.

    Parameters
    ----------
    released, closing
        Configurations up to which the gripper lets go of the handle, and from which on it closes
        about it.
    """
    own = boxes(RobotModel.load())
    around = world.door_boxes(SkillSettings.load().check.stem)
    around.update({name: own[name] for name in OBSTACLES})
    parts = _surfaces()
    frames = sorted({box.frame for box in around.values()} | {p.frame for p in parts.values()})
    poses = dict(zip(frames, world.poses(path, frames).transpose(1, 0, 2, 3), strict=True))
    least, names = np.inf, ("", "")
    for body, part in parts.items():
        for other, box in around.items():
            if other in OBSTACLES and body not in MOVING:
                continue
            held = body in HOLDING and other in ("handle", "stem")
            free = slice(released, closing + 1) if held else slice(None)
            distance = clearance(part, poses[part.frame][free], box, poses[box.frame][free])
            if distance < least:
                least, names = distance, (body, other)
    return least, names
