"""Open random objects in the simulator, and count how many are planned for and opened."""

from __future__ import annotations

import argparse
import tempfile
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.command_line.arguments import output_file, whole_number
from kmn_perception.configuration.hashes import short_hash
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.ros.program import EXPECTED, own_arguments, ros_session
from kmn_perception.sharing.experiment import ExperimentCommand, SharedExperiment
from kmn_skill.experiments.beside import add_beside_option, model_names
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
    "beside",
)  # options that are kept with the result


def random_rooms(options: argparse.Namespace, count: int) -> list[Room] | list[None]:
    """Return the rooms of so many doors, or none of them if they stand alone."""
    if not options.room:
        return [None] * count
    recesses = random_recesses(options.mode, count, options.seed)
    return [Room(options.seed + number, recess) for number, recess in enumerate(recesses)]


class DoorTrials:
    """Opens one door after the other; to be used as a context, which owns the nodes.

    Parameters
    ----------
    options
        Of the program, with a mode.
    model
        Of what is opened.
    doors
        (N, n + m) morphing parameters.
    """

    def __init__(
        self, options: argparse.Namespace, model: KinematicModel, doors: NDArray[np.float64]
    ) -> None:
        self._options, self._experiment = options, Experiment.load()
        self._task, self._doors = (model.actions[0], options.mode), doors
        self._rooms = random_rooms(options, len(doors))
        self._stack = ExitStack()

    def __enter__(self) -> DoorTrials:
        options, experiment = self._options, self._experiment
        pace = experiment.real_time if options.real_time else experiment.evaluation
        sim = {**pace._asdict(), "noise": options.noise, "seed": options.seed}
        sim["camera_mount"] = CAMERAS[options.camera]
        if options.faults:
            sim |= experiment.faults
        with ExitStack() as stack:
            stack.enter_context(ros_session("evaluate"))
            self._system = stack.enter_context(DoorSystem(sim, options, experiment))
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def __call__(self, number: int) -> Trial:
        """Return what became of a door; save a strip of pictures of the first if asked for."""
        values, strip = self._doors[number], None if number else self._options.strip
        options = self._options
        seed = options.seed + number if options.beside else None
        self._system.show(values, options.mode, self._rooms[number], seed)
        with tempfile.TemporaryDirectory() as folder:
            recording = Path(folder) / "recording.gif"
            rate = self._experiment.recording.rate
            if strip:
                self._system.record(recording, rate)
            opened = self._system.open(self._experiment.goal(*self._task), lambda feedback: None)
            if strip:
                self._system.record(None, rate)
                save_strip(recording, strip, self._experiment.recording.strip)
        result = opened.result
        is_open = self._experiment.is_open(*self._task, opened.hinge)
        wrong = "" if is_open or result.reason else "the door is not open in the physics"
        return Trial(
            values=values,
            executed=result.success,
            opened=is_open and not opened.moved,
            planning_time=result.planning_time,
            contact_error=result.contact_error,
            clearance=result.clearance,
            attempts=result.attempts,
            hinge=opened.hinge,
            told=result.position,
            reason="; ".join(filter(None, (result.reason, wrong, opened.moved))),
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


def parser() -> argparse.ArgumentParser:
    """Return the parser of what is to be evaluated."""
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
    parser.add_argument("--strip", type=output_file, help="file for pictures of the first door")
    add_robot_option(parser)
    add_object_option(parser)
    add_beside_option(parser)
    return parser


def prepare(options: argparse.Namespace) -> SharedExperiment[Trial]:
    """Return the experiment that the options tell."""
    experiment = Experiment.load()
    options.room = experiment.stands_in_room(options)
    model = experiment.kinematic_model(options.object, options.room)
    options.mode = chosen_mode(model.actions[0], options.mode)
    beside, count = model_names(options.beside), options.doors
    doors = experiment.random_objects(model, options.room, count, options.seed, bool(beside))
    files = [
        experiment.model_file(options.object, options.room),
        *map(experiment.model_file, beside),
    ]

    def conclude(trials: list[Trial]) -> tuple[str, Any]:
        result = tally(trials)
        return table(result), {**{name: getattr(options, name) for name in NAMED}, **result}

    return SharedExperiment(
        title="evaluate",
        unit="doors",
        items=options.doors,
        kind=Trial,
        make=partial(DoorTrials, options, model, doors),
        conclude=conclude,
        depends_on={"model file": " ".join(map(short_hash, files))},
    )


COMMAND = ExperimentCommand(
    package="kmn_skill",
    name="evaluate",
    parser=parser,
    prepare=prepare,
    expected=EXPECTED,
    outputs=("strip",),
)


def main() -> None:
    """Run the executable ``evaluate``."""
    COMMAND.start(own_arguments())
