"""Print the URDF of a simulated robot, for RViz and MoveIt."""

from __future__ import annotations

import argparse
import sys

from kmn_perception.configuration.section import ConfigurationError
from kmn_sim.robot.description import RobotDescription
from kmn_sim.robot.robot_model import robot_urdf
from kmn_sim.robot.settings import RobotSettings


def main() -> int:
    """Run the executable ``robot_description``."""
    parser = argparse.ArgumentParser(prog="robot_description", description=__doc__)
    parser.add_argument("--robot", default="", help="name in config/robots, or file; as sim_node's")
    try:
        settings = RobotSettings.load(parser.parse_args().robot)
        description = RobotDescription(robot_urdf(settings), settings)
    except (OSError, ConfigurationError) as error:
        print(f"robot_description: {error}", file=sys.stderr)
        return 1
    print(description.text)
    return 0
