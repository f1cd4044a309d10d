"""An object that no one measured is seen by a depth camera, morphed, planned for and opened."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from kmn_perception.command_line.arguments import output_folder, whole_number
from kmn_perception.command_line.columns import columns
from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.experiments.beside import add_beside_option
from kmn_skill.experiments.door_system import DoorSystem
from kmn_skill.experiments.evaluate import NOISES, add_control, random_rooms
from kmn_skill.experiments.film_strip import save_strip
from kmn_skill.experiments.narrator import Narrator
from kmn_skill.experiments.settings import (
    Experiment,
    add_mode_option,
    add_object_option,
    add_robot_option,
    chosen_mode,
)
from kmn_skill.experiments.trials import Opened


def run(options: argparse.Namespace, experiment: Experiment) -> bool:
    """Open one random door and tell how it went; return whether it is open."""
    options.room = experiment.stands_in_room(options)
    model = experiment.kinematic_model(options.object, options.room)
    in_row = bool(options.beside)
    values = experiment.random_objects(model, options.room, 1, options.seed, in_row)[0]
    options.mode = chosen_mode(model.actions[0], options.mode)
    task, pace = (model.actions[0], options.mode), experiment.demo
    sim = {**pace._asdict(), "noise": options.noise, "seed": options.seed}
    sim["renderer"] = "software"  # whose light is ours
    if options.view:
        stated = load_node_parameters("viewer")
        address = {name: stated[name].default for name in ("host", "port")}
        options.viewer = {**address, "target": experiment.goal(*task).target}
    options.out.mkdir(parents=True, exist_ok=True)
    recording = options.out / f"{model.name}_{options.mode}_{options.seed}.gif"
    strip = recording.with_suffix(".png")
    nodes = "sim_node, morph_node" if options.parameters == "perceived" else "sim_node"
    print(f"starting {nodes} and skill_node (20 seconds)", flush=True)
    with DoorSystem(sim, options, experiment) as system:
        system.show(values, options.mode, random_rooms(options, 1)[0])
        if options.viewer is not None:
            host, port = options.viewer["host"], options.viewer["port"]
            print(f"see http://{host}:{port} and open it there; Ctrl-C ends it", flush=True)
            system.stay()
        system.record(recording, experiment.recording.rate)
        print(f"opening a {model.name} (seed {options.seed}, {options.mode}):", flush=True)
        narrator = Narrator()
        opened = system.open(
            experiment.goal(*task),
            lambda now: narrator.tell(now.phase, now.progress, now.position),
        )
        system.record(None, experiment.recording.rate)
    save_strip(recording, strip, experiment.recording.strip)
    print(comparison(model, values, opened.perceived))
    print(summary(opened))
    print(f"recording {recording}, pictures {strip}")
    is_open = bool(opened.result.success) and experiment.is_open(*task, opened.hinge)
    return is_open and not opened.moved


def comparison(
    model: KinematicModel, true: NDArray[np.float64], perceived: NDArray[np.float64]
) -> str:
    """Return a table of the true and the perceived parameters."""
    rows = [["parameter", "true", "perceived", "error"]]
    for parameter, *numbers in zip(
        model.parameters, true, perceived, perceived - true, strict=True
    ):
        rows.append([parameter.name, *(f"{number:.4f}" for number in numbers)])
    return columns(rows)


def summary(opened: Opened) -> str:
    """Return how the goal ended."""
    result = opened.result
    text = (
        f"planned within {result.planning_time:.2f} s, clearance {1e3 * result.clearance:.1f} mm, "
        f"contact error {1e3 * result.contact_error:.2f} mm, attempts {result.attempts}\n"
        f"opened to {opened.hinge:.2f}, told as {result.position:.2f} [m, rad]"
    )
    if opened.moved:
        text += f"\n{opened.moved}"
    return text if result.success else f"{text}\nit was not opened: {result.reason}"


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog="demo", description=__doc__)
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of door and noise")
    add_mode_option(parser)
    parser.add_argument(
        "--parameters",
        choices=("perceived", "true"),
        default="perceived",
        help="what the robot knows of the door (default perceived)",
    )
    parser.add_argument(
        "--room",
        action="store_true",
        help="the door stands in a room, and is seen by depth and image",
    )
    parser.add_argument(
        "--view", action="store_true", help="show it in a browser, whose page opens the object"
    )
    parser.set_defaults(viewer=None)
    add_control(parser)
    parser.add_argument("--noise", choices=NOISES, default="kinect", help="default kinect")
    parser.add_argument(
        "--out",
        type=output_folder,
        default=Path("outputs/door_demo"),
        help="folder of recording and pictures",
    )
    add_robot_option(parser)
    add_object_option(parser)
    add_beside_option(parser)
    return parser.parse_args(argv)


def main() -> int:
    """Run the executable ``demo``."""
    options = arguments(own_arguments())
    with ros_session("demo"):
        is_open = run(options, Experiment.load())
    print("it is open" if is_open else "it is NOT open")
    return 0 if is_open else 1
