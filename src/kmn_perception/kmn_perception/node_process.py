"""Nodes that run in other processes, up to the end of a context."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

STOP_TIMEOUT = 10.0  # seconds for a node to end
LOG_LINES = 5  # of a node's, shown if it ends


class ProcessError(RuntimeError):
    """A node ended or does not answer; the text says what it wrote last."""


class NodeProcess:
    """Runs the module of a node with ROS arguments; it writes to ``log``."""

    def __init__(self, module: str, arguments: Sequence[str], log: Path) -> None:
        self._module, self._arguments, self._log = module, list(arguments), log

    def __enter__(self) -> NodeProcess:
        command = [sys.executable, "-m", self._module, "--ros-args", *self._arguments]
        with self._log.open("wb") as output:
            self._process = subprocess.Popen(command, stdout=output, stderr=output)
        return self

    def __exit__(self, *exception: object) -> None:
        self._process.send_signal(signal.SIGINT)
        try:
            self._process.wait(STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def check(self) -> None:
        """Raise a `ProcessError` with the end of its output if the process has ended."""
        if self._process.poll() is not None:
            last = "\n".join(self._log.read_text(errors="replace").splitlines()[-LOG_LINES:])
            raise ProcessError(
                f"{self._module} ended with exit code {self._process.returncode}:\n{last}"
            )
