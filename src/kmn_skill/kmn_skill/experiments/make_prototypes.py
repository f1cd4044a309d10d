"""Solve the policy for the prototype without a solution to start from, and keep the best.

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
from kmn_skill.experiments.settings import MODES, Experiment, PrototypeGuesses
from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.layout import ARM, BASE, BASE_AND_ARM, DOOR, GRIPPER, HANDLE, HINGE, ROBOT
from kmn_skill.planning.phases import PHASE_COUNT, PhaseEnd
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.settings import SkillSettings
from kmn_skill.planning.solver import Solver
from kmn_skill.planning.transfer import transfer


def key_frame(
    request: PlanRequest,
    skill: SkillSettings,
    settings: PrototypeGuesses,
    generator: np.random.Generator,
) -> NDArray[np.float64]:
    """Return a guess (T + 1, D): drive before the door, hold a random posture, follow the door."""
    slices = skill.planner.coarse
    times = np.arange(PHASE_COUNT * slices + 1) / slices
    path = np.zeros((len(times), request.configuration.size))
    posture = request.start.copy()
    posture[BASE] = skill.policy.base[0], settings.side, 0.0
    arm = posture[ARM]
    arm += generator.normal(0.0, settings.spread, arm.size)
    posture[GRIPPER] = skill.policy.open_gripper
    reached = np.clip(times / PhaseEnd.PRE_GRASP, 0.0, 1.0)[:, None]
    path[:, ROBOT] = request.start + (posture - request.start) * reached
    opened = np.clip(times - PhaseEnd.PRESSED, 0.0, 1.0)
    path[:, DOOR][:, HINGE] = opened * np.sign(request.door_angle)
    path[:, DOOR][:, HANDLE] = -np.clip(times - PhaseEnd.GRASP, 0.0, 1.0)
    return path


def best_solution(
    setup: PlanningSetup, request: PlanRequest, settings: PrototypeGuesses, tries: int
) -> NDArray[np.float64]:
    """Return the smoothest of the solutions (T + 1, D) from random guesses, with its start.

    Raises
    ------
    PlanRejected
        If there is none.
    """
    solver = Solver(setup)
    world = solver.world(request.theta, request.gamma)
    generator = np.random.default_rng(0)
    found: list[NDArray[np.float64]] = []
    for _ in tqdm(range(tries), unit="guess"):
        guess = key_frame(request, setup.settings, settings, generator)
        guess = transfer(guess, setup.model, request)
        try:
            found.append(np.vstack([request.configuration, solver.coarse(world, request, guess)]))
        except PlanRejected:
            continue
    if not found:
        raise PlanRejected(f"none of {tries} guesses leads to a solution")
    return min(found, key=_roughness)


def _roughness(path: NDArray[np.float64]) -> float:
    """Return the sum of the squared accelerations of base and arm."""
    return float(np.square(np.diff(path, 2, axis=0)[:, ROBOT][:, BASE_AND_ARM]).sum())


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=output_file, help="JSON file to write")
    parser.add_argument("--tries", type=whole_number(1), default=20, help="guesses, default 20")
    options = parser.parse_args()
    experiment = Experiment.load()
    setup = PlanningSetup.load(KinematicModel.load(experiment.model))
    solutions = {}
    for mode in MODES:
        request = experiment.request(setup, setup.model.prototype, mode)
        solutions[mode] = best_solution(setup, request, experiment.prototypes, options.tries)
    Prototypes(setup.joint_names, solutions).save(Path(options.file))
    return 0
