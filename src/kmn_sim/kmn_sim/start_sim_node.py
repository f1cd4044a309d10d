"""The executable ``sim_node``: ends without a traceback, whenever it is stopped."""

from __future__ import annotations

import sys

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions, install_signal_handlers
from rclpy.utilities import try_shutdown

from kmn_sim.sim_node import SimNode


def main() -> int:
    """Run the executable ``sim_node``; being interrupted is its normal end."""
    try:
        return _run()
    except KeyboardInterrupt:
        return 0


def _run() -> int:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = SimNode()
    except (OSError, ValueError, ParameterException) as error:
        print(f"sim_node: {error}", file=sys.stderr)
        return 1
    install_signal_handlers(SignalHandlerOptions.ALL)
    try:
        rclpy.spin(node)
    except ExternalShutdownException:
        pass
    finally:
        node.destroy_node()
        try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
