"""Letting go: a hand that is at the handle opens and draws back before anything else."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.layout import BASE_POSITION, GRIPPER, LATCH, OBJECT_JOINTS, ROBOT
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.settings import SkillSettings
from kmn_skill.planning.world import GRASP, TOOL, World


def release(
    world: World, request: PlanRequest, settings: SkillSettings
) -> list[NDArray[np.float64]]:
    """Return how the hand lets go: motions (R + 1, D) from rest to rest, each with its start.

    There are none if it is not at the handle, that is nearer than the pre-grasp pose. A gripper
    that is closed opens where it is, and the handle springs back; then the base drives the hand
    straight back to the pre-grasp distance.

    Raises
    ------
    PlanRejected
        If the base stands where it is.
    """
    start = request.configuration
    tool, grasp = world.poses(start[None], [TOOL, GRASP])[0]
    distance = -settings.policy.pre_grasp
    if np.linalg.norm(tool[:3, 3] - grasp[:3, 3]) >= distance:
        return []
    if world.setup.robot.is_fixed:
        raise PlanRejected("the hand is at the handle, and only a base that moves draws it back")
    opened = start.copy()
    gripper = max(request.start[GRIPPER], world.setup.robot.planning.grip.open)
    opened[ROBOT][GRIPPER], opened[OBJECT_JOINTS][LATCH] = gripper, 0.0
    drawn_back = opened.copy()
    drawn_back[BASE_POSITION] -= distance * tool[:2, 0] / np.linalg.norm(tool[:2, 0])
    # The start is as measured: a joint may stand a little beyond its limit.
    opened, drawn_back = np.clip([opened, drawn_back], *world.limits())
    places = [start, opened, drawn_back]
    if np.allclose(start, opened, rtol=0.0, atol=settings.check.start):
        places.pop(1)  # it is open already
    steps = np.linspace(0.0, 1.0, settings.planner.release + 1)[:, None]
    smooth = steps**2 * (3.0 - 2.0 * steps)  # from rest to rest
    return [a + smooth * (b - a) for a, b in pairwise(places)]
