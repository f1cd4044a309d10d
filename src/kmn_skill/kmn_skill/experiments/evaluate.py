"""Open random doors in the simulator, and count how many are planned for and opened."""

from __future__ import annotations

import argparse
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.experiments.door_system import SOURCES, DoorSystem, Room
from kmn_skill.experiments.film_strip import save_strip
from kmn_skill.experiments.settings import MODES, Experiment, random_recesses

NOISES = ("none", *SENSORS)
NAMED = ("mode", "parameters", "noise", "seed", "room")  # options that are kept with the result


class Trial(NamedTuple):
    """What became of one door.

    Attributes
    ----------
    values
        (n + m,) true morphing parameters.
    executed, opened
        Whether the plan was followed to its end, and whether the door is open in the physics.
    planning_time, contact_error, clearance
        Of the plan, in s and m; NaN without a plan.
    attempts
        Plans that were begun.
    hinge
        Angle of the door in the end, radians.
    reason
        Why it was not opened.
    """

    values: NDArray[np.float64]
    executed: bool
    opened: bool
    planning_time: float
    contact_error: float
    clearance: float
    attempts: int
    hinge: float
    reason: str

    @property
    def planned(self) -> bool:
        """Whether there was a plan."""
        return not math.isnan(self.clearance)


def random_rooms(options: argparse.Namespace, count: int) -> list[Room] | list[None]:
    """Return the rooms of so many doors, or none of them if they stand alone."""
    if not options.room:
        return [None] * count
    recesses = random_recesses(options.mode, count, options.seed)
    return [Room(options.seed + number, recess) for number, recess in enumerate(recesses)]


def run(options: argparse.Namespace, experiment: Experiment) -> list[Trial]:
    """Open all doors, one after the other."""
    doors = experiment.random_doors(options.room, options.doors, options.seed)
    rooms = random_rooms(options, options.doors)
    pace = experiment.evaluation
    sim = {**pace._asdict(), "noise": options.noise, "seed": options.seed, "placement": "given"}
    trials: list[Trial] = []
    with (
        DoorSystem(sim, options.parameters, experiment, options.room) as system,
        tqdm(doors, unit="door") as bar,
    ):
        for values, room in zip(bar, rooms, strict=True):
            strip = options.strip if not trials else None
            system.show(values, options.mode, room)
            trials.append(_open(system, values, options.mode, experiment, strip))
            bar.set_postfix_str(f"{sum(trial.opened for trial in trials)} open")
    return trials


def _open(
    system: DoorSystem,
    values: NDArray[np.float64],
    mode: str,
    experiment: Experiment,
    strip: Path | None,
) -> Trial:
    """Open the door that is shown; save a strip of pictures of it if that is asked for."""
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "recording.gif"
        if strip:
            system.record(recording, experiment.recording.rate)
        opened = system.open(experiment.goal(mode), lambda feedback: None)
        if strip:
            system.record(None, experiment.recording.rate)
            save_strip(recording, strip, experiment.recording.strip)
    result, is_open = opened.result, experiment.is_open(mode, opened.hinge)
    return Trial(
        values=values,
        executed=result.success,
        opened=is_open,
        planning_time=result.planning_time,
        contact_error=result.contact_error,
        clearance=result.clearance,
        attempts=result.attempts,
        hinge=opened.hinge,
        reason=result.reason or ("" if is_open else "the door is not open in the physics"),
    )


def tally(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return the counts and figures of all trials as they are written to JSON."""
    planned = [trial for trial in trials if trial.planned]
    times = [trial.planning_time for trial in planned]
    return {
        "doors": len(trials),
        "planned": len(planned),
        "executed": sum(trial.executed for trial in trials),
        "opened": sum(trial.opened for trial in trials),
        "first_attempt": sum(trial.opened and trial.attempts == 1 for trial in trials),
        "planning_s": {
            "median": float(np.median(times)) if times else None,
            "p95": float(np.percentile(times, 95.0)) if times else None,
        },
        "contact_error_m": {"max": max((trial.contact_error for trial in planned), default=None)},
        "clearance_m": {"min": min((trial.clearance for trial in planned), default=None)},
        "failures": [
            {
                "door": number,
                "values": trial.values.tolist(),
                "hinge": trial.hinge,
                "attempts": trial.attempts,
                "reason": trial.reason,
            }
            for number, trial in enumerate(trials)
            if not (trial.executed and trial.opened)
        ],
    }


def table(result: dict[str, Any]) -> str:
    """Return the figures for people to read."""
    rows = [["", "", ""]]
    for name in ("planned", "executed", "opened", "first_attempt"):
        count, total = result[name], result["doors"]
        rows.append([name, f"{count} of {total}", f"{100 * count / total:.0f} %"])
    for name, unit, factor, keys in (
        ("planning_s", "s", 1.0, ("median", "p95")),
        ("contact_error_m", "mm", 1e3, ("max",)),
        ("clearance_m", "mm", 1e3, ("min",)),
    ):
        for key in keys:
            value = result[name][key]
            text = "-" if value is None else f"{factor * value:.2f} {unit}"
            rows.append([f"{name.rsplit('_', 1)[0]} {key}", text, ""])
    reasons = [f"door {f['door']}: {f['reason']}" for f in result["failures"]]
    return "\n".join([columns(rows), *reasons])


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog="evaluate", description=__doc__)
    parser.add_argument("--doors", type=whole_number(1), default=50, help="default 50")
    parser.add_argument("--mode", choices=tuple(MODES), default="pull")
    parser.add_argument(
        "--parameters",
        choices=tuple(SOURCES),
        default="perceived",
        help="what the robot knows of the door: its true parameters, what morph_node sees "
        "(default), or the prototype's, which shows what the transfer is worth",
    )
    parser.add_argument("--noise", choices=NOISES, default="none", help="default none")
    parser.add_argument(
        "--room",
        action="store_true",
        help="the doors stand in rooms, and are seen by depth and image",
    )
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of doors and noise")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    parser.add_argument("--strip", type=output_file, help="file for pictures of the first door")
    return parser.parse_args(argv)


def main() -> int:
    """Run the executable ``evaluate``."""
    options = arguments(own_arguments())
    with ros_session("evaluate"):
        result = tally(run(options, Experiment.load()))
    print(table(result))
    if options.json:
        named = {name: getattr(options, name) for name in NAMED}
        write_json(options.json, {**named, **result})
    return 0
