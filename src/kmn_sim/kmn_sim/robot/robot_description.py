"""Print the URDF of the simulated PR2, for robot_state_publisher and RViz."""

from __future__ import annotations

import sys

from kmn_perception.configuration.section import ConfigurationError
from kmn_sim.robot.pr2_model import RobotModelError, pr2_urdf
from kmn_sim.robot.settings import RobotSettings


def main() -> int:
    """Run the executable ``robot_description``."""
    try:
        file = pr2_urdf(RobotSettings.load())
    except (RobotModelError, ConfigurationError) as error:
        print(f"robot_description: {error}", file=sys.stderr)
        return 1
    # Its meshes lie beside it, which only those can know who read it from there.
    print(
        file.read_text(encoding="utf-8").replace('filename="', f'filename="file://{file.parent}/')
    )
    return 0
