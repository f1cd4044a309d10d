"""Open random objects in the simulator, and count how many are planned for and opened."""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.model.actions import Action
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.experiments.door_system import ON_ROBOT, SOURCES, DoorSystem, Room
from kmn_skill.experiments.film_strip import save_strip
from kmn_skill.experiments.settings import (
    Experiment,
    add_mode_option,
    add_object_option,
    add_robot_option,
    chosen_mode,
    random_recesses,
)
from kmn_skill.experiments.trials import Trial, table, tally

NOISES = ("none", *SENSORS)
CONTROLS = ("topic", "action")
CAMERAS = {"world": "world", "robot": ON_ROBOT}  # where it is, and where sim_node has it
NAMED = (
    "robot",
    "object",
    "mode",
    "parameters",
    "noise",
    "seed",
    "room",
    "real_time",
    "control",
    "camera",
    "faults",
)  # options that are kept with the result


def random_rooms(options: argparse.Namespace, count: int) -> list[Room] | list[None]:
    """Return the rooms of so many doors, or none of them if they stand alone."""
    if not options.room:
        return [None] * count
    recesses = random_recesses(options.mode, count, options.seed)
    return [Room(options.seed + number, recess) for number, recess in enumerate(recesses)]


def run(options: argparse.Namespace, experiment: Experiment) -> list[Trial]:
    """Open all doors, one after the other."""
    model = experiment.kinematic_model(options.object, options.room)
    options.mode = chosen_mode(model.actions[0], options.mode)
    doors = experiment.random_objects(model, options.room, options.doors, options.seed)
    rooms = random_rooms(options, options.doors)
    pace = experiment.real_time if options.real_time else experiment.evaluation
    sim = {**pace._asdict(), "noise": options.noise, "seed": options.seed}
    sim["camera_mount"] = CAMERAS[options.camera]
    if options.faults:
        sim |= experiment.faults
    trials: list[Trial] = []
    with (
        DoorSystem(sim, options, experiment) as system,
        tqdm(doors, unit="door") as bar,
    ):
        for values, room in zip(bar, rooms, strict=True):
            strip = options.strip if not trials else None
            system.show(values, options.mode, room)
            trials.append(
                _open(system, values, (model.actions[0], options.mode), experiment, strip)
            )
            bar.set_postfix_str(f"{sum(trial.opened for trial in trials)} open")
    return trials


def _open(
    system: DoorSystem,
    values: NDArray[np.float64],
    task: tuple[Action, str],
    experiment: Experiment,
    strip: Path | None,
) -> Trial:
    """Open the door that is shown; save a strip of pictures of it if that is asked for."""
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "recording.gif"
        if strip:
            system.record(recording, experiment.recording.rate)
        opened = system.open(experiment.goal(*task), lambda feedback: None)
        if strip:
            system.record(None, experiment.recording.rate)
            save_strip(recording, strip, experiment.recording.strip)
    result, is_open = opened.result, experiment.is_open(*task, opened.hinge)
    return Trial(
        values=values,
        executed=result.success,
        opened=is_open,
        planning_time=result.planning_time,
        contact_error=result.contact_error,
        clearance=result.clearance,
        attempts=result.attempts,
        hinge=opened.hinge,
        told=result.position,
        reason=result.reason or ("" if is_open else "the door is not open in the physics"),
        measured=opened.measured,
    )


def add_control(parser: argparse.ArgumentParser) -> None:
    """Add the option that tells how the robot is moved."""
    parser.add_argument(
        "--control",
        choices=CONTROLS,
        default=CONTROLS[0],
        help="the robot is moved by a topic (default), or by the actions of its controllers",
    )


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog="evaluate", description=__doc__)
    parser.add_argument("--doors", type=whole_number(1), default=50, help="default 50")
    add_mode_option(parser)
    parser.add_argument(
        "--parameters",
        choices=tuple(SOURCES),
        default="perceived",
        help="what the robot knows of the door: its true parameters, what morph_node sees "
        "(default), or the prototype's, which shows what the transfer is worth",
    )
    add_control(parser)
    parser.add_argument(
        "--camera",
        choices=tuple(CAMERAS),
        default="world",
        help="the camera stands in the world (default), or moves with the robot",
    )
    parser.add_argument(
        "--faults",
        action="store_true",
        help="depth, mount of the camera and odometry are off as config/skill/experiment.yaml says",
    )
    parser.add_argument("--noise", choices=NOISES, default="none", help="default none")
    parser.add_argument(
        "--room",
        action="store_true",
        help="the doors stand in rooms, and are seen by depth and image",
    )
    parser.add_argument(
        "--real-time",
        action="store_true",
        help="the simulation runs no faster than reality, so that all seconds are alike",
    )
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of doors and noise")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    parser.add_argument("--strip", type=output_file, help="file for pictures of the first door")
    add_robot_option(parser)
    add_object_option(parser)
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
