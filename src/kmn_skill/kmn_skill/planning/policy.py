"""The policy: a constrained trajectory optimisation problem on the kinematic model (Sec. III-D).

Time runs from 0 to the last `PhaseEnd`. One step after `PhaseEnd.GRASP` the gripper has closed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import robotic as ry
from numpy.typing import ArrayLike, NDArray

from kmn_skill.planning.layout import BASE, BASE_AND_ARM, LATCH, MOVED, OBJECT_JOINTS
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.world import (
    CONTACTS,
    GRASP,
    OBJECT,
    PADS,
    STANCE,
    TOOL,
    World,
    blunt,
    object_body,
)

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
        """Smooth motion, base pose before the object, pre-grasp pose of the gripper."""
        robot, settings, step = self._robot, self._settings, self._step
        # All but the gripper.
        smooth = [*robot.model_joints[BASE_AND_ARM], *self._world.model_joints[OBJECT_JOINTS]]
        rate = np.sqrt(step)  # the sum over the steps is an integral over time
        self._add("acceleration", [], ry.FS.qItself, smooth, COST, scale=rate, order=2)
        gripper, opening = [robot.gripper.joint], [step, PhaseEnd.PRE_GRASP]
        self._add("acceleration", opening, ry.FS.qItself, gripper, COST, scale=rate, order=2)

        base, stance = robot.base.frame, [*robot.planning.stance, 0.0]
        self._add(
            "base", [PhaseEnd.GRASP], ry.FS.positionRel, [base, STANCE], COST, stance, np.eye(3)[:2]
        )
        self._add("base", [PhaseEnd.GRASP], ry.FS.scalarProductXY, [base, OBJECT], COST)

        tool, before = [TOOL, GRASP], [settings.pre_grasp, 0.0, 0.0]
        self._add("pre_grasp", [PhaseEnd.PRE_GRASP], ry.FS.positionRel, tool, COST, before)
        self._add("end", [PhaseEnd.OPEN], ry.FS.qItself, smooth, COST, order=1)
        approach = [PhaseEnd.PRE_GRASP, PhaseEnd.GRASP]
        self._add("heading", approach, ry.FS.scalarProductXX, tool, COST, [1.0])

    def _add_equalities(self, request: PlanRequest) -> None:
        """Targets of the object's joints, contact, and what is fixed when."""
        robot, step = self._robot, self._step
        joints = self._world.model_joints[OBJECT_JOINTS]
        moved, latch = [joints[MOVED]], [joints[LATCH]]
        gripper, others = [robot.gripper.joint], list(robot.model_joints[BASE_AND_ARM])
        moved_start, latch_start = request.object_start[[MOVED, LATCH]]
        grasped, pulling = PhaseEnd.GRASP + step, PhaseEnd.PRESSED + step
        clear = PhaseEnd.PRESSED + self._settings.pressed

        pressed, relaxed = [request.unlatched], [self._settings.relaxed * request.unlatched]
        self._add("target", [PhaseEnd.PRESSED], ry.FS.qItself, latch, EQUAL, pressed)
        self._add("target", [PhaseEnd.OPEN], ry.FS.qItself, moved, EQUAL, [request.target])
        # Where an object is not where it is believed, the hand slides along its lever: one that is
        # still pressed would come to its stop, and be torn out of the hand.
        self._add("target", [PhaseEnd.OPEN], ry.FS.qItself, latch, EQUAL, relaxed)

        for pad, contact in zip(PADS, CONTACTS, strict=True):
            times = [grasped, PhaseEnd.OPEN]
            self._add("contact", times, ry.FS.positionDiff, [pad, contact], EQUAL)

        self._add("fixed", [step, PhaseEnd.PRESSED], ry.FS.qItself, moved, EQUAL, [moved_start])
        self._add("fixed", [step, grasped], ry.FS.qItself, latch, EQUAL, [latch_start])
        self._add("fixed", [pulling, clear], ry.FS.qItself, latch, EQUAL, pressed)
        times, opened = [PhaseEnd.PRE_GRASP, PhaseEnd.GRASP], [robot.planning.grip.open]
        self._add("fixed", times, ry.FS.qItself, gripper, EQUAL, opened)
        if robot.is_fixed:
            stands = request.start[BASE].tolist()
            self._add("stand", [], ry.FS.qItself, [robot.base.frame], EQUAL, stands)
        self._add("rest", [grasped], ry.FS.qItself, others, EQUAL, order=1)

        # Straight towards what is grasped, with a finger to either side of it.
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
    avoided = world.setup.robot.planning.collisions
    grasped = world.setup.action.grasp.body
    others = [object_body(b.name) for b in world.setup.model.bodies if b.name != grasped.name]
    handle = object_body(grasped.name)
    object_pairs = [(body, other) for body in avoided.door for other in others]
    object_pairs += [(body, handle) for body in avoided.handle]
    around = [*avoided.obstacles, *map(blunt, avoided.blunt)]
    object_pairs += [(body, name) for name in world.obstacle_names for body in around]
    own = [(body, other) for body, others in avoided.own.items() for other in others]
    always = [Pair(*names, 0.0, float(PHASE_COUNT)) for names in (*object_pairs, *own)]
    before = float(PhaseEnd.PRE_GRASP)
    return always + [Pair(body, handle, 0.0, before) for body in avoided.approach]


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
