"""Programs that communicate by ROS: they end without a traceback, and say why in one line."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import rclpy
from rclpy.exceptions import ParameterException
from rclpy.executors import ExternalShutdownException
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.logging import get_logger_level, set_logger_level
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions, install_signal_handlers
from rclpy.utilities import try_shutdown

from kmn_perception.ros.node_process import ProcessError


def run_node(name: str, make_node: Callable[[], Node], has_last_words: bool = False) -> int:
    """Run a node until it is stopped, and return the exit status; being stopped is 0.

    Parameters
    ----------
    name
        Of the program, for the one line that says why it cannot start.
    make_node
        Makes the node; its errors are of `OSError`, `ValueError` or `ParameterException`.
    has_last_words
        The node publishes when it is destroyed. The handlers of rclpy, which are quicker, would
        end all communication before that.
    """
    try:
        if has_last_words:
            for number in (signal.SIGINT, signal.SIGTERM):  # a shell may have had them ignored
                signal.signal(number, signal.default_int_handler)
        try:
            _init()
            node = make_node()
        except (OSError, ValueError, ParameterException) as error:
            print(f"{name}: {error}", file=sys.stderr)
            return 1
        if not has_last_words:
            install_signal_handlers(SignalHandlerOptions.ALL)
        _spin(node)
    except KeyboardInterrupt:
        pass
    finally:
        try_shutdown()
    return 0


@contextmanager
def ros_session(name: str) -> Iterator[None]:
    """Communicate up to the end of a context; an expected error ends the program.

    Parameters
    ----------
    name
        Of the program, for the line that says what is wrong.
    """
    try:
        _init()
        yield
    except (OSError, ValueError, ProcessError) as error:
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(1)
    finally:
        try_shutdown()


def _init() -> None:
    """Begin to communicate, as the arguments of ROS have it, among them the parameter files.

    Raises
    ------
    ValueError
        If an argument or a file is not as ROS expects it.
    """
    level = get_logger_level("rcl")
    set_logger_level("rcl", LoggingSeverity.FATAL)  # it says that something is wrong, but not what
    try:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        reason, *_ = str(error).split(", at /")  # without the places in the sources of ROS
        reason = reason.removeprefix("failed to initialize rcl: ")
        raise ValueError(f"ROS cannot start: {' '.join(reason.split())}") from error
    finally:
        set_logger_level("rcl", level)


def _spin(node: Node) -> None:
    try:
        rclpy.spin(node)
    except (ExternalShutdownException, KeyboardInterrupt):
        pass
    finally:
        node.destroy_node()
