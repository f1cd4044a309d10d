"""Plan for random doors without a simulator, and count how many plans pass the check.

Run as ``./run kmn_skill plan_doors --mode pull --doors 100``.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.command_line.arguments import whole_number
from kmn_perception.command_line.columns import columns
from kmn_perception.configuration.hashes import short_hash
from kmn_perception.sharing.experiment import ExperimentCommand, SharedExperiment
from kmn_skill.experiments.action_option import add_action_option, chosen_action
from kmn_skill.experiments.settings import (
    Experiment,
    add_mode_option,
    add_object_option,
    add_robot_option,
    chosen_mode,
    random_recesses,
)
from kmn_skill.planning.plan import PlanningFailed, PlanReport
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import SOLUTIONS, Prototypes

WORTHWHILE = 5  # doors of a process; for fewer its start, some seconds, does not pay


class Planned(NamedTuple):
    """A door's morphing parameters (n + m,), the report of its plan, and why there is none."""

    values: NDArray[np.float64]
    report: PlanReport | None
    reason: str


class DoorPlanning:
    """Plans for one door after the other; to be used as a context, which owns the planner.

    Parameters
    ----------
    doors
        (N, n + m) parameters.
    recesses
        Of the doors in their walls, metres; None: they stand alone.
    """

    def __init__(
        self, setup: PlanningSetup, robot: str, mode: str, doors: NDArray[np.float64],
        recesses: Sequence[float] | None,
    ) -> None:  # fmt: skip
        prototypes = Prototypes.load(setup.action.motions, robot)
        self._setup, self._mode, self._planner = setup, mode, Planner(setup, prototypes)
        self._doors, self._recesses, self._experiment = doors, recesses, Experiment.load()

    def __enter__(self) -> DoorPlanning:
        self._planner.__enter__()
        return self

    def __exit__(self, *exception: object) -> None:
        self._planner.__exit__(*exception)

    def __call__(self, number: int) -> Planned:
        """Return what became of a door."""
        values = self._doors[number]
        recess = None if self._recesses is None else self._recesses[number]
        request = self._experiment.request(self._setup, values, self._mode, recess)
        try:
            return Planned(values, self._planner.plan(request).report, "")
        except PlanningFailed as error:
            return Planned(values, None, str(error))


def tally(doors: Sequence[Planned]) -> dict[str, Any]:
    """Return counts and figures as they are written to JSON."""
    reports = [door.report for door in doors if door.report is not None]
    result: dict[str, Any] = {"doors": len(doors), "planned": len(reports)}
    if reports:
        times = [report.planning_time for report in reports]
        result["planning_s"] = {
            "median": float(np.median(times)),
            "p95": float(np.percentile(times, 95.0)),
        }
        result["contact_error_m"] = {"max": max(report.contact_error for report in reports)}
        result["clearance_m"] = {"min": min(report.clearance for report in reports)}
        result["varied"] = sum(report.seed_used not in SOLUTIONS for report in reports)
    result["failures"] = [
        {"door": number, "values": door.values.tolist(), "reason": door.reason}
        for number, door in enumerate(doors)
        if door.report is None
    ]
    return result


def table(result: dict[str, Any]) -> str:
    """Return the figures for people to read."""
    rows = [["planned", f"{result['planned']} of {result['doors']}"]]
    if result["planned"]:
        rows += [
            ["after the first guess failed", str(result["varied"])],
            ["planning median", f"{result['planning_s']['median']:.2f} s"],
            ["planning p95", f"{result['planning_s']['p95']:.2f} s"],
            ["contact error max", f"{1e3 * result['contact_error_m']['max']:.2f} mm"],
            ["clearance min", f"{1e3 * result['clearance_m']['min']:.1f} mm"],
        ]
    reasons = [f"door {failure['door']}: {failure['reason']}" for failure in result["failures"]]
    return "\n".join([columns(rows), *reasons])


def parser() -> argparse.ArgumentParser:
    """Return the parser of what is to be planned."""
    parser = argparse.ArgumentParser(prog="plan_doors", description=__doc__)
    parser.add_argument("--doors", type=whole_number(1), default=100, help="default 100")
    add_mode_option(parser)
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the doors")
    parser.add_argument("--room", action="store_true", help="the doors stand in walls")
    add_robot_option(parser)
    add_object_option(parser)
    add_action_option(parser)
    return parser


def prepare(options: argparse.Namespace) -> SharedExperiment[Planned]:
    """Return the experiment that the options tell."""
    experiment = Experiment.load()
    options.room = experiment.stands_in_room(options)
    model = experiment.kinematic_model(options.object, options.room)
    model = chosen_action(model, options.action)
    setup = PlanningSetup.load(model, options.robot)
    options.mode = chosen_mode(setup.action, options.mode)
    doors = experiment.random_objects(model, options.room, options.doors, options.seed)
    recesses = random_recesses(options.mode, options.doors, options.seed) if options.room else None

    def conclude(planned: list[Planned]) -> tuple[str, Any]:
        result = tally(planned)
        named = {name: getattr(options, name) for name in ("robot", "mode", "seed", "room")}
        return table(result), {**named, "object": model.name, "action": setup.action.name, **result}

    return SharedExperiment(
        title="plan_doors",
        unit="doors",
        items=options.doors,
        kind=Planned,
        make=partial(DoorPlanning, setup, options.robot, options.mode, doors, recesses),
        conclude=conclude,
        worthwhile=WORTHWHILE,
        depends_on={"model file": short_hash(experiment.model_file(options.object, options.room))},
    )


COMMAND = ExperimentCommand(
    package="kmn_skill", name="plan_doors", parser=parser, prepare=prepare, expected=(ValueError,)
)


def main() -> None:
    """Run the command."""
    COMMAND.start()
