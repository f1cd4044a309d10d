"""sim_node as a program: how it starts, what it says when it cannot, and how it ends."""

from __future__ import annotations

import os
import re
import signal
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from rclpy.node import Node
from std_srvs.srv import Trigger

from kmn_perception.ros.shared_memory import lost_ports
from programs import BROKEN_FILES, INTERRUPTS, assert_file_is_refused, parameters, read_until, start

COMMAND = [sys.executable, "-m", "kmn_sim", "sim_node"]


@pytest.mark.parametrize("interrupt", INTERRUPTS)
def test_interrupted_it_ends_quietly(interrupt: signal.Signals, domain: int) -> None:
    process = start(COMMAND, domain)
    read_until("simulating model", process)
    time.sleep(0.5)  # the handlers are set up right after that line
    process.send_signal(interrupt)
    rest, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "Traceback" not in rest


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        ("model:=elephant", "'elephant' is neither a file nor"),
        ("placement:=somewhere", "'placement' must be one of"),
        ("values:=[1.0]", "has 7 parameters"),
        ("camera_rate:=0.0", "camera_rate"),
        ("record:=/nowhere/run.gif", "'record' must be a file"),
    ],
)
def test_a_wrong_parameter_ends_it_with_the_reason(domain: int, parameter: str, text: str) -> None:
    process = start(
        COMMAND,
        domain,
        *parameters(parameter, "placement:=given" if "values" in parameter else "seed:=1"),
    )
    printed, _ = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "Traceback" not in printed
    assert text in printed


def test_without_the_robots_package_it_says_what_to_install(domain: int, tmp_path: Path) -> None:
    (tmp_path / "robotic.py").write_text("raise ImportError('liblapack.so.3 is missing')")
    path = f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"
    process = start(COMMAND, domain, XDG_CACHE_HOME=str(tmp_path), PYTHONPATH=path)
    printed, _ = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "make setup-simulation" in printed
    assert "Traceback" not in printed


def test_where_egl_does_not_start_it_says_so_and_goes_on(domain: int) -> None:
    process = start(COMMAND, domain, __EGL_VENDOR_LIBRARY_DIRS="/nowhere")
    printed = read_until("simulating model", process)
    assert "renderer 'egl' does not start; rendering by 'software'" in printed
    assert "depth by 'software'" in printed.splitlines()[-1]
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 0


def test_it_starts_anew_where_its_shared_memory_is_removed(graph: Any, domain: int) -> None:
    """As Fast DDS may do at the start of another node, where nodes are killed."""
    process = start(COMMAND, domain)
    try:
        read_until("simulating model", process)
        tasks = Path(f"/proc/{process.pid}/task").glob("*/comm")
        names = [file.read_text().strip() for file in tasks]
        ports = [int(name[8:]) for name in names if re.fullmatch(r"dds\.shm\.\d+", name)]
        assert ports
        assert lost_ports(str(process.pid)) == []
        for port in ports:
            Path(f"/dev/shm/fastrtps_port{port}").unlink()
        assert lost_ports(str(process.pid)) == sorted(ports)
        read_until("starts anew", process)
        read_until("simulating model", process)
        assert lost_ports(str(process.pid)) == []  # it is the same process
        client = graph.start(lambda context: Node("client", context=context))
        reset = client.create_client(Trigger, "reset")
        assert reset.wait_for_service(30.0)
        answer = reset.call_async(Trigger.Request())
        graph.wait_for(answer.done)
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
        assert process.returncode == 0
    finally:
        process.kill()


@pytest.mark.parametrize("text", BROKEN_FILES)
def test_a_missing_or_broken_parameter_file_is_named_in_one_line(
    domain: int, tmp_path: Path, text: str | None
) -> None:
    assert_file_is_refused(COMMAND, domain, tmp_path, text)
