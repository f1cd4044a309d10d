"""Objects that stand in one row with that of a scenario, their fronts flush."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from kmn_perception.model.actions import Action
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import WORLD
from kmn_sim.world.scenario import Scenario, ScenarioError


def in_row(
    scenario: Scenario,
    models: Sequence[KinematicModel],
    gap: float,
    generator: np.random.Generator | None = None,
) -> Scenario:
    """Return a scenario whose object has others beside it, all closed.

    The first stands at its right as who opens it sees it, the second at its left, the next ones by
    turns further out. Their theta follows from that, within its limits or not; each opens to the
    side that its file says.

    Parameters
    ----------
    gap
        Between two that stand beside each other, metres.
    generator
        Draws their gamma; None: the prototype's.

    Raises
    ------
    ScenarioError
        If one is not articulated, fills an opening of a wall or cannot be moved to where it
        would stand, or if a table stands there.
    """
    if not models:
        return scenario
    if scenario.table:
        raise ScenarioError(
            "'beside' is for objects on the floor, 'table' for a box: leave one out"
        )
    for model in (scenario.model, *models):
        _check_furniture(model)
    pose = scenario.model.transformation.matrix(scenario.theta)
    right, left = _extent(scenario.model, scenario.gamma)
    beside = []
    for number, model in enumerate(models):
        values = model.prototype if generator is None else model.sample(generator, 1)[0]
        _, gamma = model.split(values)
        low, high = _extent(model, gamma)
        if number % 2 == 0:
            y = right - gap - high
            right = y + low
        else:
            y = left + gap - low
            left = y + high
        theta = _moved(model, pose, y)
        direction = _direction(model.actions[0])
        beside.append(Scenario(model, np.concatenate([theta, gamma]), direction, in_row=True))
    return replace(scenario, beside=tuple(beside))


def _check_furniture(model: KinematicModel) -> None:
    if not model.actions:
        raise ScenarioError(
            f"'beside' is for objects that can be opened, the file of model '{model.name}' has no "
            "'actions'"
        )
    if model.actions[0].joint.parent == WORLD:
        raise ScenarioError(
            f"'beside' is for furniture, model '{model.name}' is a door that fills an opening of a "
            "wall"
        )


def _direction(action: Action) -> str:
    """Return to which side an action opens by its target."""
    return "pull" if action.target < 0.0 else "push"


def _extent(model: KinematicModel, gamma: NDArray[np.float64]) -> tuple[float, float]:
    """Return from where to where a closed object reaches along y of its frame, metres."""
    centres = np.array([body.centre(gamma)[1] for body in model.bodies])
    halves = np.array([body.size(gamma)[1] for body in model.bodies]) / 2.0
    return float((centres - halves).min()), float((centres + halves).max())


def _moved(model: KinematicModel, pose: NDArray[np.float64], y: float) -> NDArray[np.float64]:
    """Return theta (n,) of an object at ``y`` (m) in the frame of another one of a pose (4, 4)."""
    place = pose.copy()
    place[:3, 3] += y * pose[:3, 1]
    theta = model.transformation.read_back(place)
    if not np.allclose(model.transformation.matrix(theta), place):
        names = ", ".join(parameter.name for parameter in model.theta)
        at, yaw = place[:2, 3], np.arctan2(place[1, 0], place[0, 0])
        raise ScenarioError(
            f"'beside': model '{model.name}' would stand at x = {at[0]:.3f}, y = {at[1]:.3f}, "
            f"yaw = {yaw:.3f}, to where its theta ({names}) cannot move it"
        )
    return theta
