"""Nodes as programs: how the tests start them, and how these refuse a parameter file."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

import pytest

TIMEOUT = 120.0  # seconds
GREETING = "pybullet build time"  # which pybullet prints when it is imported
# How a program is ended, by a terminal and by others; the same code answers both.
INTERRUPTS = (signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow))
# Texts of parameter files that are refused; None: there is no file.
BROKEN_FILES = (None, "/**:\n  ros__parameters: {model: [1, door]}\n")


def start(
    command: Sequence[str],
    domain: int,
    *arguments: str,
    folder: Path | None = None,
    **environment: str,
) -> subprocess.Popen[str]:
    """Start a node with ROS arguments, in a folder and with further environment variables."""
    return subprocess.Popen(
        [*command, "--ros-args", *arguments],
        cwd=folder,
        env={**os.environ, "ROS_DOMAIN_ID": str(domain), **environment},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def read_until(text: str, process: subprocess.Popen[str]) -> str:
    """Return what a program prints, up to the first line with some text."""
    assert process.stdout is not None
    lines: list[str] = []
    while not lines or text not in lines[-1]:
        lines.append(process.stdout.readline())
        assert lines[-1], f"it ended: {''.join(lines)}"
    return "".join(lines)


def parameters(*assignments: str) -> list[str]:
    """Return the ROS arguments that set parameters, each of the form ``NAME:=VALUE``."""
    return [text for assignment in assignments for text in ("-p", assignment)]


def assert_file_is_refused(
    command: Sequence[str], domain: int, folder: Path, text: str | None
) -> None:
    """Assert that a node ends with one line that names its parameter file of this text."""
    file = folder / "parameters.yaml"
    if text is not None:
        file.write_text(text)
    process = start(command, domain, "--params-file", str(file))
    printed, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1, printed
    lines = [line for line in printed.splitlines() if not line.startswith(GREETING)]
    assert len(lines) == 1, printed
    assert "_node: " in lines[0]
    assert str(file) in lines[0]
