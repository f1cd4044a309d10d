"""Solve the policy for some doors without solutions to start from, and keep the best.

Those in a wall are solved one from the other.

Run as ``./run kmn_skill make_prototypes FILE``; it writes ``config/skill/prototypes.json``.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.experiments.settings import MODES, Experiment
from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.layout import ARM, BASE, BASE_AND_ARM, DOOR, GRIPPER, HANDLE, HINGE, ROBOT
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import PUSH, PUSH_IN_WALL, Prototypes, Solution
from kmn_skill.planning.settings import SkillSettings
from kmn_skill.planning.solver import Solver
from kmn_skill.planning.transfer import transfer


def key_frame(
    request: PlanRequest,
    skill: SkillSettings,
    side: float,
    spread: float,
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Return a guess (T + 1, D): drive before the door, hold a random posture, follow the door."""
    slices = skill.planner.coarse
    times = np.arange(PHASE_COUNT * slices + 1) / slices
    path = np.zeros((len(times), request.configuration.size))
    posture = request.start.copy()
    posture[BASE] = skill.policy.base[0], side, 0.0
    arm = posture[ARM]
    arm += generator.normal(0.0, spread, arm.size)
    posture[GRIPPER] = skill.policy.open_gripper
    reached = np.clip(times / PhaseEnd.PRE_GRASP, 0.0, 1.0)[:, None]
    path[:, ROBOT] = request.start + (posture - request.start) * reached
    opened = np.clip(times - PhaseEnd.PRESSED, 0.0, 1.0)
    path[:, DOOR][:, HINGE] = opened * np.sign(request.door_angle)
    path[:, DOOR][:, HANDLE] = -np.clip(times - PhaseEnd.GRASP, 0.0, 1.0)
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
        path = key_frame(request, setup.settings, side, spread, generator)
        try:
            guess = transfer(Solution(request.gamma, path), setup.model, request)
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


def walled_solutions(setup: PlanningSetup, experiment: Experiment, mode: str) -> list[Solution]:
    """Return solutions for doors in a wall, each from the one before; see `best_solution`."""
    solver, settings = Solver(setup), experiment.prototypes
    names = [parameter.name for parameter in setup.model.parameters]
    kept: list[Solution] = []
    before: Solution | None = None
    for door in tqdm(settings.walled.doors, unit="door"):
        values = setup.model.prototype.copy()
        for name, value in door.gamma.items():
            values[names.index(name)] = value
        request = experiment.request(setup, values, mode, door.recess)
        if before is None:
            _, tries, sides = settings.walled
            before = best_solution(solver, setup, request, sides, settings.spread, tries)
        else:
            before = solved(solver, request, before.path[1:])
        kept += [before] if door.kept else []
    return kept


def _roughness(solution: Solution) -> float:
    """Return the sum of the squared accelerations of base and arm."""
    return float(np.square(np.diff(solution.path, 2, axis=0)[:, ROBOT][:, BASE_AND_ARM]).sum())


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=output_file, help="JSON file to write")
    parser.add_argument("--tries", type=whole_number(1), default=20, help="guesses, default 20")
    options = parser.parse_args()
    experiment = Experiment.load()
    setup = PlanningSetup.load(KinematicModel.load(experiment.model))
    solver, guesses = Solver(setup), experiment.prototypes
    solutions = {}
    for mode in MODES:
        request = experiment.request(setup, setup.model.prototype, mode)
        sides = guesses.side, guesses.side
        solutions[mode] = [
            best_solution(solver, setup, request, sides, guesses.spread, options.tries)
        ]
    solutions[PUSH_IN_WALL] = walled_solutions(setup, experiment, PUSH)
    Prototypes(setup.joint_names, solutions).save(Path(options.file))
    return 0
