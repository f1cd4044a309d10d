"""How far the arm of a robot reaches that stands where it is."""

from __future__ import annotations

import numpy as np

from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.layout import ARM, MOVED, OBJECT_JOINTS
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.world import GRASP, TOOL, World


def check_reach(world: World, request: PlanRequest) -> None:
    """Raise `PlanRejected` if the handle is, or comes to be, further away than the arm is long.

    Nearer it may be out of reach all the same; that only the solver knows.
    """
    configurations = np.array([request.configuration, request.configuration])
    configurations[1, OBJECT_JOINTS][MOVED] = request.target
    arm = list(world.model_joints[ARM.start - 2 : -3])  # the model has one joint for the base
    places = world.poses(configurations, [*arm, TOOL, GRASP])[..., :3, 3]
    length = float(np.linalg.norm(np.diff(places[0, :-1], axis=0), axis=1).sum())
    for when, away in zip(
        ("is", "comes to be"), np.linalg.norm(places[:, -1] - places[:, 0], axis=1), strict=True
    ):
        if away > length:
            raise PlanRejected(
                f"the handle {when} {away:.2f} m from the shoulder of a robot that stands, whose "
                f"arm is {length:.2f} m long"
            )
