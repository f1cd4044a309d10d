"""The policy: a constrained trajectory optimisation problem on the kinematic model (Sec. III-D).

Time runs from 0 to the last `PhaseEnd`. One step after `PhaseEnd.GRASP` the gripper has closed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import robotic as ry
from numpy.typing import ArrayLike, NDArray

from kmn_skill.planning.layout import BASE_AND_ARM, DOOR, HANDLE, HINGE
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.world import CONTACTS, GRASP, OBJECT, PADS, TOOL, World, blunt, door_body

COST, EQUAL, INEQUALITY = ry.OT.sos, ry.OT.eq, ry.OT.ineq


class Pair(NamedTuple):
    """Two bodies that must not touch between two times."""

    first: str
    second: str
    begin: float
    end: float


class Policy:
    """The policy for a request.

    Parameters
    ----------
    world
        The kinematic model with the robot.
    slices
        Configurations a phase; T is `PHASE_COUNT` times this.
    pairs
        What must not touch.

    Attributes
    ----------
    problem
        The optimisation problem, of the package robotic.
    """

    def __init__(
        self,
        world: World,
        request: PlanRequest,
        slices: int,
        pairs: Iterable[Pair],
    ) -> None:
        self._world, self._robot = world, world.setup.robot
        self._settings = world.setup.settings.policy
        world.configuration.setJointState(request.configuration)
        self.problem: Any = ry.KOMO(world.configuration, PHASE_COUNT, slices, 2, False)
        self._step = 1.0 / slices
        self._add_costs(request)
        self._add_equalities(request)
        self._add_inequalities(pairs)

    def _add_costs(self, request: PlanRequest) -> None:
        """Smooth motion, base pose before the door, pre-grasp pose of the gripper."""
        robot, settings, step = self._robot, self._settings, self._step
        # All but the gripper.
        smooth = [*robot.model_joints[BASE_AND_ARM], *self._world.model_joints[DOOR]]
        rate = np.sqrt(step)  # the sum over the steps is an integral over time
        self._add("acceleration", [], ry.FS.qItself, smooth, COST, scale=rate, order=2)
        gripper, opening = [robot.gripper.joint], [step, PhaseEnd.PRE_GRASP]
        self._add("acceleration", opening, ry.FS.qItself, gripper, COST, scale=rate, order=2)

        base, place, along = [robot.base, GRASP], [*settings.base, 0.0], np.eye(3)[:2]
        self._add("base", [PhaseEnd.GRASP], ry.FS.positionRel, base, COST, place, along)
        self._add("base", [PhaseEnd.GRASP], ry.FS.scalarProductXY, [robot.base, OBJECT], COST)

        tool, before = [TOOL, GRASP], [settings.pre_grasp, 0.0, 0.0]
        self._add("pre_grasp", [PhaseEnd.PRE_GRASP], ry.FS.positionRel, tool, COST, before)
        self._add("end", [PhaseEnd.OPEN], ry.FS.qItself, smooth, COST, order=1)
        approach = [PhaseEnd.PRE_GRASP, PhaseEnd.GRASP]
        self._add("heading", approach, ry.FS.scalarProductXX, tool, COST, [1.0])

    def _add_equalities(self, request: PlanRequest) -> None:
        """Targets of handle and door, contact, and what is fixed when."""
        robot, step = self._robot, self._step
        hinge, handle = ([name] for name in self._world.model_joints[DOOR])
        gripper, others = [robot.gripper.joint], list(robot.model_joints[BASE_AND_ARM])
        hinge_start, handle_start = request.door_start[[HINGE, HANDLE]]
        grasped, pulling = PhaseEnd.GRASP + step, PhaseEnd.PRESSED + step

        pressed = [request.handle_angle]
        self._add("target", [PhaseEnd.PRESSED], ry.FS.qItself, handle, EQUAL, pressed)
        self._add("target", [PhaseEnd.OPEN], ry.FS.qItself, hinge, EQUAL, [request.door_angle])

        for pad, contact in zip(PADS, CONTACTS, strict=True):
            times = [grasped, PhaseEnd.OPEN]
            self._add("contact", times, ry.FS.positionDiff, [pad, contact], EQUAL)

        self._add("fixed", [step, PhaseEnd.PRESSED], ry.FS.qItself, hinge, EQUAL, [hinge_start])
        self._add("fixed", [step, grasped], ry.FS.qItself, handle, EQUAL, [handle_start])
        self._add("fixed", [pulling, PhaseEnd.OPEN], ry.FS.qItself, handle, EQUAL, pressed)
        times, opened = [PhaseEnd.PRE_GRASP, PhaseEnd.GRASP], [self._settings.open_gripper]
        self._add("fixed", times, ry.FS.qItself, gripper, EQUAL, opened)
        self._add("rest", [grasped], ry.FS.qItself, others, EQUAL, order=1)

        # Straight towards the handle, with one finger above and one below it.
        times, tool = [PhaseEnd.PRE_GRASP, PhaseEnd.GRASP - step], [TOOL, GRASP]
        self._add("approach", times, ry.FS.positionRel, tool, EQUAL, [0.0] * 3, np.eye(3)[1:])
        self._add("approach", times, ry.FS.scalarProductYX, tool, EQUAL)
        self._add("approach", times, ry.FS.scalarProductYY, tool, EQUAL)

    def _add_inequalities(self, pairs: Iterable[Pair]) -> None:
        """Limits of the joints, and collisions."""
        self._add("limits", [], ry.FS.jointLimits, [], INEQUALITY)
        margin = [-self._settings.margin]
        for first, second, begin, end in pairs:
            bodies, times = [first, second], [max(begin, self._step), end]
            self._add("collision", times, ry.FS.negDistance, bodies, INEQUALITY, margin)

    def _add(
        self,
        weight: str,
        times: Sequence[float],
        feature: Any,
        frames: list[str],
        kind: Any,
        target: list[float] | None = None,
        scale: ArrayLike = 1.0,
        order: int = 0,
    ) -> None:
        """Add a feature over times; `kind` is a cost, an equality or an inequality."""
        scale = self._settings.weights[weight] * np.atleast_1d(np.asarray(scale))
        interval = [float(time) for time in times]
        self.problem.addObjective(interval, feature, frames, kind, scale, target or [], order)


def pairs(world: World) -> list[Pair]:
    """Return all pairs of bodies that must not touch."""
    settings = world.setup.settings.policy
    panel, handle = (door_body(name) for name in world.door_bodies)
    door = [(body, panel) for body in settings.door_collisions]
    door += [(body, handle) for body in settings.handle_collisions]
    around = [*settings.obstacle_collisions, *map(blunt, settings.blunt_collisions)]
    door += [(body, name) for name in world.obstacle_names for body in around]
    own = [(body, other) for body, others in settings.self_collisions.items() for other in others]
    always = [Pair(*names, 0.0, float(PHASE_COUNT)) for names in (*door, *own)]
    before = float(PhaseEnd.PRE_GRASP)
    return always + [Pair(body, handle, 0.0, before) for body in settings.approach_collisions]


def near_pairs(
    world: World, pairs: Iterable[Pair], path: NDArray[np.float64], near: float
) -> list[Pair]:
    """Return the pairs that come near each other on a coarse path, and when.

    Parameters
    ----------
    path
        (T, D) positions of the dofs, equally spaced over the time.
    near
        Metres.
    """
    pairs = list(pairs)
    distances = np.empty((len(path), len(pairs)))
    for row, positions in zip(distances, path, strict=True):
        world.configuration.setJointState(positions)
        row[:] = [-world.configuration.eval(ry.FS.negDistance, pair[:2])[0][0] for pair in pairs]
    step = PHASE_COUNT / len(path)
    kept = []
    for pair, distance in zip(pairs, distances.T, strict=True):
        close = np.flatnonzero(distance < near)
        if len(close):
            begin, end = max(close[0] * step, pair.begin), min((close[-1] + 2) * step, pair.end)
            if begin < end:
                kept.append(pair._replace(begin=begin, end=end))
    return kept
