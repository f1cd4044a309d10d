"""Nodes that run in other processes, up to the end of a context, and a client of them."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from rclpy.client import Client
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from kmn_perception.ros.parameters import request_to_set

STOP_TIMEOUT = 10.0  # seconds for a node to end
LOG_LINES = 5  # of a node's, shown if it ends
POLL_PERIOD = 0.02  # seconds
PRINT_TIME = 0.5  # seconds for a program to print where it is

Found = TypeVar("Found")


class ProcessError(RuntimeError):
    """A node ended, or does not do what it is asked for; the text says why."""


class NoAnswerError(ProcessError):
    """A node runs, but did not answer in time."""


class NodeProcess:
    """Runs the executable of a node with ROS arguments; it writes to ``log``."""

    def __init__(self, package: str, executable: str, arguments: Sequence[str], log: Path) -> None:
        self._executable, self._log = executable, log
        self._command = [sys.executable, "-m", package, executable, "--ros-args", *arguments]

    def __enter__(self) -> NodeProcess:
        self.start()
        return self

    def start(self) -> None:
        """Start it, also once more after it was killed."""
        with self._log.open("ab") as output:
            self._process = subprocess.Popen(self._command, stdout=output, stderr=output)

    @property
    def pid(self) -> int:
        """Of the process that was started last."""
        return self._process.pid

    def is_running(self) -> bool:
        """Tell whether it has not ended."""
        return self._process.poll() is None

    def output(self) -> str:
        """Return all that it has printed."""
        return self._log.read_text(errors="replace")

    def where(self) -> str:
        """Return where each of its threads is, as it prints upon SIGUSR1 (`ros_session`)."""
        before = len(self.output())
        self._process.send_signal(signal.SIGUSR1)
        time.sleep(PRINT_TIME)
        return self.output()[before:]

    def kill(self) -> None:
        """End it without a chance to tidy up, as ``kill -9``."""
        self._process.kill()
        self._process.wait()

    def __exit__(self, *exception: object) -> None:
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def check(self) -> None:
        """Raise a `ProcessError` with the end of its output if the process has ended."""
        if not self.is_running():
            last = "\n".join(self.output().splitlines()[-LOG_LINES:])
            raise ProcessError(
                f"{self._executable} ended with exit code {self._process.returncode}:\n{last}"
            )


class ProcessClient:
    """Waits for what nodes in other processes do, as long as they run.

    Parameters
    ----------
    node
        Of this process, which is spun while the client waits.
    processes
        The others.
    """

    def __init__(self, node: Node, processes: Sequence[NodeProcess]) -> None:
        self._processes = processes
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)

    def wait(self, find: Callable[[], Found | None], timeout: float, whom: str) -> Found:
        """Wait so many seconds until a function finds what ``whom`` shall do, and return it.

        Raises
        ------
        NoAnswerError
            If it finds nothing.
        ProcessError
            If a process ends.
        """
        deadline = time.monotonic() + timeout
        while not (found := find()):
            for process in self._processes:
                process.check()
            if time.monotonic() > deadline:
                raise NoAnswerError(f"{whom} did not answer within {timeout:g} s")
            self._executor.spin_once(timeout_sec=POLL_PERIOD)
        return found

    def pause(self, seconds: float) -> None:
        """Let so many seconds pass, while messages are taken."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def set_parameters(self, service: Client, values: Mapping[str, Any], timeout: float) -> None:
        """Set parameters of another node, all or none, by its service for that.

        Raises
        ------
        ProcessError
            If it refuses them, or as `wait` does.
        """
        future = service.call_async(request_to_set(values))
        self.wait(future.done, timeout, service.srv_name)
        result = future.result().result
        if not result.successful:
            raise ProcessError(f"{service.srv_name} refused {dict(values)}: {result.reason}")


def namespace_arguments(namespace: str) -> list[str]:
    """Return the ROS arguments of a node in a namespace, with a clock and transforms of its own."""
    remaps = [f"__ns:={namespace}"]
    remaps += [f"{topic}:={namespace}{topic}" for topic in ("/clock", "/tf", "/tf_static")]
    return [text for remap in remaps for text in ("-r", remap)]


def parameter_arguments(values: Mapping[str, Any]) -> list[str]:
    """Return the ROS arguments that set parameters of a node."""
    return [text for name, value in values.items() for text in ("-p", f"{name}:={value}")]
