"""The demo on real Kinect frames, and that it leaves no process behind."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from kmn_perception.ros.node_process import NodeProcess, ProcessError
from programs import INTERRUPTS


def start_demo(domain: int, folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "kmn_perception", "demo_bag", "--out", str(folder)],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def left_behind(demo_process: int) -> list[Path]:
    """Return the processes that were started by the demo and are still there."""
    mark = f"__ns:=/demo_{demo_process}".encode()
    found = []
    for command in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if mark in command.read_bytes():
                found.append(command)
        except OSError:  # it has just ended
            continue
    return found


def test_it_finds_the_boxes_and_shows_them(domain: int, tmp_path: Path) -> None:
    process = start_demo(domain, tmp_path / "demo")
    printed, _ = process.communicate(timeout=200)
    assert process.returncode == 0, printed
    frames = [line for line in printed.splitlines() if line.startswith("frame")]
    assert len(frames) == 17
    assert sum(line.endswith("objects, OK") for line in frames) >= 15
    boxes = [line for line in printed.splitlines() if line.startswith("    object")]
    assert sum(line.split("mm")[-1].strip() == "OK" for line in boxes) >= 36
    pictures = sorted(path.name for path in (tmp_path / "demo").glob("*.png"))
    assert pictures == ["all_frames.png", *(f"frame_{number:02d}.png" for number in range(17))]
    assert not left_behind(process.pid)


@pytest.mark.parametrize("interrupt", INTERRUPTS)
def test_interrupted_it_ends_morph_node_too(
    interrupt: signal.Signals, domain: int, tmp_path: Path
) -> None:
    process = start_demo(domain, tmp_path / "demo")
    assert process.stdout is not None
    while not (line := process.stdout.readline()).startswith("frame  0"):
        assert line, "the demo ended before its first frame"
    assert left_behind(process.pid), "morph_node is not known by its namespace"
    process.send_signal(interrupt)
    rest, _ = process.communicate(timeout=60)
    assert process.returncode == 128 + interrupt
    assert "Traceback" not in rest
    assert not left_behind(process.pid)


def test_a_node_that_does_not_start_is_reported_with_its_reason(tmp_path: Path) -> None:
    arguments = ["-p", "weights:=nowhere"]
    started = NodeProcess("kmn_perception", "morph_node", arguments, tmp_path / "log")
    with started as process, pytest.raises(ProcessError) as error:
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline:
            process.check()
            time.sleep(0.1)
    assert "morph_node ended with exit code 1" in str(error.value)
    assert "no weights: 'nowhere' is neither a file nor" in str(error.value)
