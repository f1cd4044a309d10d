"""Recordings of sim_node as a program: when it is interrupted, and on a disk that is full."""

from __future__ import annotations

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from test_sim_node_process import COMMAND

from graph import GraphClient
from programs import INTERRUPTS, TIMEOUT, parameters, start
from recordings import duration

ENDINGS = ("gif", "mp4")


@pytest.fixture(scope="module")
def client(graph: Any) -> GraphClient:
    return graph.start(lambda **_: GraphClient(graph, "sim_node"))


@contextmanager
def recording(client: GraphClient, domain: int, file: Path) -> Iterator[Any]:
    """Start a sim_node that records to a file, and wait until it has run for a while."""
    settings = parameters(f"record:={file}", "real_time_factor:=0.0", "record_rate:=5.0")
    process = start(COMMAND, domain, *settings)
    client.reports.clear()
    try:
        client.graph.wait_for(
            lambda: (
                process.poll() is not None
                or [report for report in client.reports if float(report["time_s"]) > 2.0]
            )
        )
        yield process
    finally:
        process.kill()


def stop(process: Any, interrupt: signal.Signals) -> str:
    """Stop a node, which must end well, and return what it printed."""
    process.send_signal(interrupt)
    printed, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, printed
    assert "Traceback" not in printed
    return str(printed)


@pytest.mark.parametrize("interrupt", INTERRUPTS)
@pytest.mark.parametrize("ending", ENDINGS)
def test_interrupted_it_completes_the_recording(
    client: GraphClient, domain: int, tmp_path: Path, ending: str, interrupt: signal.Signals
) -> None:
    file = tmp_path / f"run.{ending}"
    with recording(client, domain, file) as process:
        stop(process, interrupt)
    assert duration(file) >= 1.0
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_full_disk_costs_the_recording_only(
    client: GraphClient, domain: int, tmp_path: Path, ending: str
) -> None:
    """A limit to the size of files stands for it: one may be set for a process that runs."""
    file = tmp_path / f"run.{ending}"
    with recording(client, domain, file) as process:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (2048, 2048))
        client.reports.clear()
        if ending == "mp4":  # which is written all the time, a GIF at the end
            client.graph.wait_for(
                lambda: [report for report in client.reports if report["recordings_lost"] == "1"]
            )
            client.graph.wait_for(lambda: len(client.reports) > 3)
        printed = stop(process, signal.SIGINT)
    assert f"the recording '{file}' is lost: File too large" in printed
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_folder_in_place_of_the_file_ends_the_start_with_one_line(
    client: GraphClient, domain: int, tmp_path: Path, ending: str
) -> None:
    file = tmp_path / f"run.{ending}"
    file.mkdir()
    with recording(client, domain, file) as process:
        printed, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert printed.splitlines()[-1] == (
        f"sim_node: cannot record to '{file}': it is a folder, expected a file"
    )
    assert "Traceback" not in printed
