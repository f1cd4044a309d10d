"""Solve the policy for the prototype without a solution to start from, and keep the best.

Run as ``./run kmn_skill make_prototypes FILE``; it writes ``config/skill/prototypes.json``.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number
from kmn_skill.planning.check import PlanRejected
from kmn_skill.planning.plan import PlanRequest
from kmn_skill.planning.policy import PHASE_COUNT
from kmn_skill.planning.prototypes import PULL, PUSH
from kmn_skill.planning.settings import SkillSettings
from kmn_skill.planning.solver import Solver
from kmn_skill.planning.transfer import transfer

HOME = (-3.3, 0.0, 0.0, 1.0, 0.5, 1.0, -2.0, 1.5, -0.5, 0.5, 0.1)  # the robot's start
HANDLE_ANGLE, DOOR_ANGLE = -0.7, 0.9  # radians
SPREAD = 0.5  # rad, standard deviation of the arm from the start


def key_frame(request: PlanRequest, generator: np.random.Generator) -> NDArray[np.float64]:
    """Return a guess (T + 1, 13): drive before the door, hold a random posture, follow the door."""
    settings = SkillSettings.load()
    slices = settings.planner.coarse
    times = np.arange(PHASE_COUNT * slices + 1) / slices
    path = np.zeros((len(times), 13))
    posture = request.start.copy()
    posture[:3] = settings.policy.base[0], -0.5, 0.0
    posture[3:10] += generator.normal(0.0, SPREAD, 7)
    posture[10] = settings.policy.open_gripper
    path[:, :11] = request.start + (posture - request.start) * np.clip(times, 0.0, 1.0)[:, None]
    path[:, 11] = np.clip(times - 3.0, 0.0, 1.0) * np.sign(request.door_angle)
    path[:, 12] = -np.clip(times - 2.0, 0.0, 1.0)
    return path


def best_solution(solver: Solver, request: PlanRequest, tries: int) -> NDArray[np.float64]:
    """Return the shortest of the solutions (T + 1, 13) from random guesses, with its start.

    Raises
    ------
    PlanRejected
        If there is none.
    """
    world = solver.world(request.theta, request.gamma)
    generator = np.random.default_rng(0)
    start = np.concatenate([request.start, request.door_start])
    found: list[NDArray[np.float64]] = []
    for _ in tqdm(range(tries), unit="guess"):
        guess = transfer(key_frame(request, generator), solver.model, request)
        try:
            found.append(np.vstack([start, solver.coarse(world, request, guess)]))
        except PlanRejected:
            continue
    if not found:
        raise PlanRejected(f"none of {tries} guesses leads to a solution")
    return min(found, key=lambda path: float(np.square(np.diff(path, 2, axis=0)[:, :10]).sum()))


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=output_file, help="JSON file to write")
    parser.add_argument("--tries", type=whole_number(1), default=20, help="guesses, default 20")
    options = parser.parse_args()
    solver = Solver()
    zeros = (np.zeros(len(solver.model.theta)), np.zeros(len(solver.model.gamma)))
    solutions = {}
    for name, sign in ((PULL, -1.0), (PUSH, 1.0)):
        request = PlanRequest(*zeros, np.array(HOME), np.zeros(2), HANDLE_ANGLE, sign * DOOR_ANGLE)
        solutions[name] = best_solution(solver, request, options.tries).round(5).tolist()
    Path(options.file).write_text(json.dumps(solutions) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
