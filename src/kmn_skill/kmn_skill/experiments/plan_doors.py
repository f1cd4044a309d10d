"""Plan for random doors without a simulator, and count how many plans pass the check.

Run as ``./run kmn_skill plan_doors --mode pull --doors 100``.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_skill.experiments.settings import (
    Experiment,
    add_mode_option,
    add_object_option,
    add_robot_option,
    chosen_mode,
    random_recesses,
)
from kmn_skill.planning.plan import PlanningFailed, PlanReport, PlanRequest
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import SOLUTIONS, Prototypes


class Planned(NamedTuple):
    """A door's morphing parameters (n + m,), the report of its plan, and why there is none."""

    values: NDArray[np.float64]
    report: PlanReport | None
    reason: str


def plan_doors(
    planner: Planner,
    doors: NDArray[np.float64],
    request: Callable[[NDArray[np.float64]], PlanRequest],
) -> list[Planned]:
    """Plan for doors of parameters (N, n + m), one after the other.

    Parameters
    ----------
    request
        Returns what is asked for a door of parameters (n + m,).
    """
    planned = []
    with tqdm(doors, unit="door") as bar:
        for values in bar:
            try:
                report = planner.plan(request(values)).report
                planned.append(Planned(values, report, ""))
            except PlanningFailed as error:
                planned.append(Planned(values, None, str(error)))
            bar.set_postfix_str(f"{sum(door.report is not None for door in planned)} planned")
    return planned


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


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="plan_doors", description=__doc__)
    parser.add_argument("--doors", type=whole_number(1), default=100, help="default 100")
    add_mode_option(parser)
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the doors")
    parser.add_argument("--room", action="store_true", help="the doors stand in walls")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    add_robot_option(parser)
    add_object_option(parser)
    options = parser.parse_args()
    experiment = Experiment.load()
    model = experiment.kinematic_model(options.object, options.room)
    setup = PlanningSetup.load(model, options.robot)
    options.mode = chosen_mode(setup.action, options.mode)
    doors = experiment.random_objects(model, options.room, options.doors, options.seed)
    recesses = iter(random_recesses(options.mode, options.doors, options.seed))

    def request(values: NDArray[np.float64]) -> PlanRequest:
        recess = next(recesses) if options.room else None
        return experiment.request(setup, values, options.mode, recess)

    with Planner(setup, Prototypes.load(setup.action.motions, options.robot)) as planner:
        planned = plan_doors(planner, doors, request)
    result = tally(planned)
    print(table(result))
    if options.json:
        named = {
            "robot": options.robot,
            "object": model.name,
            "mode": options.mode,
            "seed": options.seed,
            "room": options.room,
        }
        write_json(options.json, {**named, **result})
    return 0
