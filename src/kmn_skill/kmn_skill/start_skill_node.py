"""The executable ``skill_node``: holds the robot and ends quietly, whenever it is stopped."""

from __future__ import annotations

import signal
import sys

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from kmn_skill.skill_node import SkillNode


def main() -> int:
    """Run the executable ``skill_node``; being interrupted is its normal end."""
    # The handlers of rclpy would end all communication before the robot is told to hold.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    for number in (signal.SIGINT, signal.SIGTERM):  # a shell may have had them ignored
        signal.signal(number, signal.default_int_handler)
    try:
        return _run()
    except KeyboardInterrupt:
        return 0
    finally:
        try_shutdown()


def _run() -> int:
    try:
        node = SkillNode()
    except (OSError, ValueError, ParameterException) as error:
        print(f"skill_node: {error}", file=sys.stderr)
        return 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        executor.spin()
    except KeyboardInterrupt:
        pass
    finally:
        node.destroy_node()
        executor.shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
