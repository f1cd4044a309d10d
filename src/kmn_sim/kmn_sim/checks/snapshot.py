"""Save a picture of the robot and an object."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import cv2
import numpy as np

from kmn_perception.command_line.arguments import output_file, whole_number
from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_sim.sensors.settings import RecordingSettings
from kmn_sim.sensors.snapshot import snapshot
from kmn_sim.world.scenario import DIRECTIONS, Scenario, in_room
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="snapshot", description=__doc__)
    shipped = parameter_values("sim_node")["model"]
    parser.add_argument("--model", default=shipped, help="name or file (default %(default)s)")
    for name in ("theta", "gamma"):
        parser.add_argument(
            f"--{name}", type=float, nargs="*", help="parameters; the prototype's if not given"
        )
    parser.add_argument("--direction", choices=DIRECTIONS, default="pull")
    for option in ("frame", "wall", "table", "room"):
        parser.add_argument(f"--{option}", action="store_true")
    parser.add_argument("--out", type=output_file, default=Path("simulation.png"))
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the room")
    return parser.parse_args()


def scenario_of(options: argparse.Namespace) -> Scenario:
    """Return the scenario that was asked for."""
    model = KinematicModel.load(options.model)
    parts = [
        np.zeros(len(parameters)) if given is None else np.array(given)
        for given, parameters in ((options.theta, model.theta), (options.gamma, model.gamma))
    ]
    scenario = Scenario(
        model,
        np.concatenate(parts),
        options.direction,
        frame=options.frame,
        wall=options.wall,
        table=options.table,
    )
    return in_room(scenario, options.seed) if options.room else scenario


def main() -> int:
    """Run the executable ``snapshot``."""
    options = arguments()
    try:
        settings = RecordingSettings.load()
        simulation = Simulation(scenario_of(options), WorldSettings.load(), renderer="software")
        simulation.run(settings.settling)
        picture = snapshot(simulation, settings, settings.snapshot)
        simulation.close()
        if not cv2.imwrite(str(options.out), np.ascontiguousarray(picture[..., ::-1])):
            raise OSError(f"cannot write {options.out}")
    except (OSError, ValueError, cv2.error) as error:
        print(f"snapshot: {error}", file=sys.stderr)
        return 1
    print(f"The picture is {options.out}")
    return 0
