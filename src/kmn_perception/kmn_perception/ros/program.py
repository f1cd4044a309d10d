"""Programs that communicate by ROS: they end without a traceback, and say why in one line.

The only place that initialises rclpy.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.logging import get_logger_level, set_logger_level
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import try_shutdown

from kmn_perception.ros.node_process import ProcessError

EXPECTED = (OSError, ValueError, ParameterException, NameValidationException, ProcessError)
ROS_ARGUMENTS, END_OF_ROS_ARGUMENTS = "--ros-args", "--"


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Split a command line into a program's own arguments and those of ROS.

    Those of ROS stand between ``--ros-args`` and ``--`` or the end. rclpy would also take any own
    argument of the form ``A:=B`` for a remapping.
    """
    own: list[str] = []
    ros: list[str] = []
    inside = False
    for argument in arguments:
        if argument == ROS_ARGUMENTS:
            inside = True
        elif inside and argument == END_OF_ROS_ARGUMENTS:
            inside = False
        else:
            (ros if inside else own).append(argument)
    return own, [ROS_ARGUMENTS, *ros] if ros else []


def own_arguments() -> list[str]:
    """Return the arguments of the running program without those of ROS."""
    return split_arguments(sys.argv[1:])[0]


@contextmanager
def ros_session(name: str) -> Iterator[None]:
    """Communicate up to the end of a context; an expected error ends the program.

    Being terminated ends the context, too, and with it the nodes that were started in it. Upon
    SIGUSR1 the program prints where each of its threads is, and goes on.

    Parameters
    ----------
    name
        Of the program, for the line that says what is wrong.
    """
    signal.signal(signal.SIGTERM, _exit)
    signal.signal(signal.SIGUSR1, _tell)
    try:
        initialise(split_arguments(sys.argv[1:])[1])
        yield
    except EXPECTED as error:
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(1)
    finally:
        try_shutdown()


def _exit(number: int, frame: FrameType | None) -> None:
    sys.exit(128 + number)


def _tell(number: int, frame: FrameType | None) -> None:
    """Print where each thread is, the main one last.

    In Python, between two of its instructions: `faulthandler` reads the frames of threads that run
    meanwhile, which ended a node by a segmentation fault.
    """
    signal.signal(number, signal.SIG_IGN)  # until it is told
    main = threading.main_thread().ident
    names = {thread.ident: thread.name for thread in threading.enumerate()}
    frames = sys._current_frames()
    lines = []
    for ident in sorted(frames, key=lambda ident: ident == main):
        lines += [f"Thread {names.get(ident, ident)} (most recent call last):\n"]
        lines += traceback.format_stack(frames[ident])
    os.write(sys.stderr.fileno(), "".join(lines).encode(errors="replace"))
    signal.signal(number, _tell)


def initialise(arguments: list[str]) -> None:
    """Begin to communicate, as the arguments of ROS have it, among them the parameter files.

    Raises
    ------
    ValueError
        If an argument, a file or the environment is not as ROS expects it.
    """
    if not any(os.environ.get(name) for name in ("HOME", "ROS_HOME", "ROS_LOG_DIR")):
        raise ValueError("ROS has no folder to log to; set HOME or ROS_LOG_DIR")
    level = get_logger_level("rcl")
    set_logger_level("rcl", LoggingSeverity.FATAL)  # it says that something is wrong, but not what
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        raise ValueError(f"ROS cannot start: {_explain(str(error))}") from error
    finally:
        set_logger_level("rcl", level)


def _explain(error: str) -> str:
    """Return an error of rcl in one line, without places in its sources, and a remedy for some."""
    reason, *_ = error.split(", at /")
    reason = " ".join(reason.removeprefix("failed to initialize rcl: ").split())
    if "log directory" in reason:
        reason += "; set ROS_LOG_DIR to a folder that can be written"
    if reason.startswith("["):  # UnknownROSArgsError has nothing but a list
        reason = f"unknown arguments after {ROS_ARGUMENTS}: {reason.strip('[]')}"
    return reason
