"""Look at a running robot for some seconds, and say what skill_node would miss.

The exit status is 0 only if nothing is missing.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Sequence

from rclpy.node import Node

from kmn_perception.command_line.arguments import output_file, write_json
from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.experiments.robot_check import Expected, Finding, Frames, RobotCheck
from kmn_skill.experiments.settings import add_robot_option
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.ros.robot_listener import RobotListener

NAME = "check_robot"
WIDTH = 100  # columns
OK, MISSING, REMEDY = "ok", "missing", "to do"


def told(findings: Sequence[Finding]) -> str:
    """Return the findings for people to read, and what to do below what is missing."""
    lines = []
    for finding in findings:
        lines.append(_line(MISSING if finding.is_missing else OK, finding.subject, finding.text))
        if finding.is_missing:
            lines.append(_line("", REMEDY, finding.remedy))
    missing = sum(finding.is_missing for finding in findings)
    lines.append(f"{missing} of {len(findings)} missing" if missing else "nothing is missing")
    return "\n".join(lines)


def _line(verdict: str, subject: str, text: str) -> str:
    return textwrap.fill(
        f"{verdict:8}{subject}: {text}",
        WIDTH,
        subsequent_indent=" " * 10,
        break_on_hyphens=False,
        drop_whitespace=True,
    )


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    stated = load_node_parameters("skill_node")
    parser = argparse.ArgumentParser(prog=NAME, description=__doc__)
    add_robot_option(parser)
    parser.add_argument("--namespace", default="", help="of the robot's topics and actions")
    for name, meaning in (("model", "of the door"), ("control", "how the robot is to be moved")):
        default, choices = stated[name].default, stated[name].choices or None
        parser.add_argument(
            f"--{name}", default=default, choices=choices, help=f"{meaning}, default {default}"
        )
    world = stated["world_frame"].default
    parser.add_argument("--world-frame", default=world, help=f"of skill_node, default {world}")
    parser.add_argument("--base-frame", default="", help="default: what odometry tells")
    parser.add_argument("--camera-frame", default="", help="default: that of depth/camera_info")
    parser.add_argument("--json", type=output_file, help="file to write the findings to")
    return parser.parse_args(argv)


def main() -> int:
    """Run the executable ``check_robot``."""
    options, expected = arguments(own_arguments()), Expected.load()
    frames = Frames(options.world_frame, options.base_frame, options.camera_frame)
    with ros_session(NAME):
        setup = PlanningSetup.load(KinematicModel.load(options.model), options.robot)
        node = Node(NAME, namespace=options.namespace)
        try:
            robot = RobotListener(node)
            robot.listen(expected.discovery, expected.listen)
            check = RobotCheck(robot, setup, options.control, frames, expected)
            findings = list(check.findings())
        finally:
            node.destroy_node()
    print(told(findings))
    missing = [finding for finding in findings if finding.is_missing]
    if options.json:
        found = [{**each._asdict(), "missing": each.is_missing} for each in findings]
        write_json(options.json, {"missing": len(missing), "findings": found})
    return 1 if missing else 0
