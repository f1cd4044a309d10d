"""The installed executable morph_node: from any folder, ends quietly, says why it cannot start."""

from __future__ import annotations

import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from programs import BROKEN_FILES, INTERRUPTS, TIMEOUT, assert_file_is_refused, parameters, start

COMMAND = [f"{get_package_prefix('kmn_perception')}/lib/kmn_perception/morph_node"]


def run_until_it_reports(
    graph: Any, process: subprocess.Popen[str], stop: signal.Signals = signal.SIGINT
) -> str:
    """Stop a node when it is at work, which must end well, and return what it printed."""
    watcher = graph.start(lambda context: Node("watcher", context=context))
    reports: list[DiagnosticArray] = []
    watcher.create_subscription(DiagnosticArray, "/diagnostics", reports.append, 10)
    try:
        graph.wait_for(lambda: reports or process.poll() is not None)
        process.send_signal(stop)
        output, _ = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    assert (process.returncode, "Traceback" in output) == (0, False), output
    return output


@pytest.mark.parametrize("stop", INTERRUPTS)
def test_node_ends_quietly_when_it_is_stopped(
    graph: Any,
    domain: int,
    tmp_path: Path,
    stop: signal.Signals,
) -> None:
    run_until_it_reports(graph, start(COMMAND, domain, folder=tmp_path), stop)


def test_what_parameter_files_hold_in_vain_is_told(graph: Any, domain: int, tmp_path: Path) -> None:
    (tmp_path / "misspelt.yaml").write_text("/**: {ros__parameters: {obects: all}}")
    (tmp_path / "others.yaml").write_text("sim_node: {ros__parameters: {model: box}}")
    files = ["--params-file", "misspelt.yaml", "--params-file", "others.yaml"]
    output = run_until_it_reports(graph, start(COMMAND, domain, *files, folder=tmp_path))
    assert "there is no parameter 'obects', its value is ignored; did you mean 'obj" in output
    assert "others.yaml holds no parameters for /morph_node, but for /sim_node" in output


def test_node_that_is_interrupted_while_it_starts_ends_quietly(domain: int, tmp_path: Path) -> None:
    process = start(COMMAND, domain, folder=tmp_path)
    try:
        with pytest.raises(subprocess.TimeoutExpired):
            process.communicate(timeout=1.0)  # it imports
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    # 130: interrupted while it loads; 0: while it starts.
    assert process.returncode in (0, 130), output
    assert "Traceback" not in output


def test_node_that_cannot_start_says_why_in_one_line(domain: int, tmp_path: Path) -> None:
    (tmp_path / "weights.safetensors").write_bytes(b"\x10\0\0\0\0\0\0\0not safetensors")
    process = start(COMMAND, domain, *parameters("weights:=weights.safetensors"), folder=tmp_path)
    output, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert "weights.safetensors is not a readable safetensors file" in output
    assert len(output.splitlines()) == 1


@pytest.mark.parametrize("text", BROKEN_FILES)
def test_a_missing_or_broken_parameter_file_is_named_in_one_line(
    domain: int, tmp_path: Path, text: str | None
) -> None:
    assert_file_is_refused(COMMAND, domain, tmp_path, text)
