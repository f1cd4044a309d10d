"""Solve the policy for an object without solutions to start from, and keep the best.

Those for doors in a wall are solved one from the other.

Run as ``./run kmn_skill make_prototypes --robot R --object M config/skill/prototypes/R/M.json``.
"""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.parts import WORLD
from kmn_skill.experiments.action_option import add_action_option, chosen_action
from kmn_skill.experiments.settings import (
    Experiment,
    add_object_option,
    add_robot_option,
    modes_of,
)
from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.layout import (
    ARM,
    BASE,
    BASE_AND_ARM,
    GRIPPER,
    LATCH,
    MOVED,
    OBJECT_JOINTS,
    ROBOT,
)
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import PUSH, PUSH_IN_WALL, Prototypes, Solution
from kmn_skill.planning.solver import Solver
from kmn_skill.planning.transfer import transfer


def key_frame(
    request: PlanRequest,
    setup: PlanningSetup,
    side: float,
    spread: float,
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Return a guess (T + 1, D): drive before the door, hold a random posture, follow the door."""
    robot, slices = setup.robot, setup.settings.planner.coarse
    times = np.arange(PHASE_COUNT * slices + 1) / slices
    path = np.zeros((len(times), request.configuration.size))
    posture = request.start.copy()
    posture[BASE] = robot.planning.stance[0], side, 0.0
    arm = posture[ARM]
    arm += generator.normal(0.0, spread, arm.size)
    posture[GRIPPER] = robot.planning.grip.open
    reached = np.clip(times / PhaseEnd.PRE_GRASP, 0.0, 1.0)[:, None]
    path[:, ROBOT] = request.start + (posture - request.start) * reached
    opened = np.clip(times - PhaseEnd.PRESSED, 0.0, 1.0)
    path[:, OBJECT_JOINTS][:, MOVED] = opened * request.target
    path[:, OBJECT_JOINTS][:, LATCH] = request.unlatched * np.clip(times - PhaseEnd.GRASP, 0.0, 1.0)
    return path


def best_solution(
    solver: Solver,
    setup: PlanningSetup,
    request: PlanRequest,
    sides: tuple[float, float],
    spread: float,
    tries: int,
) -> Solution:
    """Return the smoothest of the solutions from random guesses.

    Parameters
    ----------
    sides, spread
        Between which the base stands (m), and the arm's standard deviation (rad) in the guesses.

    Raises
    ------
    PlanRejected
        If there is none.
    """
    generator = np.random.default_rng(0)
    found: list[Solution] = []
    for _ in tqdm(range(tries), unit="guess"):
        side = generator.uniform(*sides) if sides[0] < sides[1] else sides[0]
        path = key_frame(request, setup, side, spread, generator)
        try:
            guess = transfer(Solution(request.gamma, path), setup.model, setup.action, request)
            found.append(solved(solver, request, guess))
        except PlanRejected:
            continue
    if not found:
        raise PlanRejected(f"none of {tries} guesses leads to a solution")
    return min(found, key=_roughness)


def solved(solver: Solver, request: PlanRequest, guess: NDArray[np.float64]) -> Solution:
    """Return the solution to which a guess (T, D) leads; raise `PlanRejected` if to none."""
    path = solver.coarse(solver.world(request), request, guess)
    return Solution(request.gamma, np.vstack([request.configuration, path]))


def free_solutions(
    solver: Solver, setup: PlanningSetup, experiment: Experiment, tries: int
) -> dict[str, Solution]:
    """Return solutions for the prototype that stands alone, to the sides to which it opens.

    Where random guesses lead to none, the other one is a guess: up to the open latch the same.
    """
    guesses, found = experiment.prototypes, {}
    requests = {
        mode: experiment.request(setup, setup.model.prototype, mode)
        for mode in modes_of(setup.action)
    }
    for mode, request in requests.items():
        sides = guesses.side, guesses.side
        with suppress(PlanRejected):
            found[mode] = best_solution(solver, setup, request, sides, guesses.spread, tries)
    if not found:
        raise PlanRejected(
            f"none of {tries} guesses leads to a solution, to {' or '.join(requests)}"
        )
    for mode, request in requests.items():
        if mode not in found:
            (other,) = found.values()
            found[mode] = solved(
                solver, request, transfer(other, setup.model, setup.action, request)
            )
    return found


def walled_solutions(
    solver: Solver, setup: PlanningSetup, experiment: Experiment, mode: str
) -> list[Solution]:
    """Return solutions for doors in a wall, each from the last one that was found.

    Not every robot opens every door in a wall. See `best_solution`.
    """
    settings = experiment.prototypes
    names = [parameter.name for parameter in setup.model.parameters]
    doors, tries, sides = settings.walled
    requests = []
    for door in doors:
        values = setup.model.prototype.copy()
        for name, value in door.gamma.items():
            values[names.index(name)] = value
        requests.append(experiment.request(setup, values, mode, door.recess))
    last = best_solution(solver, setup, requests[0], sides, settings.spread, tries)
    kept = [last] if doors[0].kept else []
    for door, request in zip(tqdm(doors[1:], unit="door"), requests[1:], strict=True):
        try:
            last = solved(solver, request, last.path[1:])
        except (PlanRejected, ConfigurationError, OSError) as error:
            tqdm.write(f"{door}: {error}", file=sys.stderr)
            continue
        kept += [last] if door.kept else []
    return kept or [last]


def _roughness(solution: Solution) -> float:
    """Return the sum of the squared accelerations of base and arm."""
    return float(np.square(np.diff(solution.path, 2, axis=0)[:, ROBOT][:, BASE_AND_ARM]).sum())


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=output_file, help="JSON file to write")
    parser.add_argument("--tries", type=whole_number(1), default=20, help="guesses, default 20")
    add_robot_option(parser)
    add_object_option(parser)
    add_action_option(parser)
    options = parser.parse_args()
    try:
        experiment = Experiment.load()
        model = chosen_action(experiment.kinematic_model(options.object), options.action)
        setup = PlanningSetup.load(model, options.robot)
        solver = Solver(setup)
        free = free_solutions(solver, setup, experiment, options.tries)
        solutions = {mode: [solution] for mode, solution in free.items()}
        if setup.action.joint.parent == WORLD:  # it may stand in a wall
            solutions[PUSH_IN_WALL] = walled_solutions(solver, setup, experiment, PUSH)
    except (OSError, ConfigurationError, PlanRejected) as error:
        print(f"make_prototypes: {error}", file=sys.stderr)
        return 1
    Prototypes(setup.joint_names, solutions).save(Path(options.file))
    kinds = ", ".join(f"{name}: {len(kept)}" for name, kept in solutions.items())
    print(f"motions of '{setup.model.name}' by {setup.robot.name} ({kinds}): {options.file}")
    return 0
