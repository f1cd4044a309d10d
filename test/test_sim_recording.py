"""Recordings of sim_node are complete and play, or are refused or lost with the reason."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
from rclpy.parameter import Parameter

from recordings import duration
from sim_client import SimClient

pytest.importorskip("pybullet")
from kmn_sim.ros.sim_node import SimNode  # noqa: E402

ENDINGS = ("gif", "mp4")


@pytest.fixture(scope="module")
def client(graph: Any) -> SimClient:
    overrides = {"real_time_factor": 0.0, "publish_clock": True, "record_rate": 5.0}
    graph.start(
        SimNode,
        parameter_overrides=[Parameter(name, value=value) for name, value in overrides.items()],
    )
    made = graph.start(lambda **_: SimClient(graph))
    made.setting.wait_for_service()
    return made


def begin(client: SimClient, file: Path) -> int:
    """Begin a recording, wait for some pictures, and return how many were lost before."""
    lost = recordings_lost(client)
    assert client.set(record=str(file)).successful
    client.wait_until(client.now() + 2.0)
    return lost


def recordings_lost(client: SimClient) -> int:
    return int(client.report()["recordings_lost"])


def assert_lost(client: SimClient, file: Path, reason: str, before: int) -> None:
    """End a recording that is lost, and assert that this is told and the simulation goes on."""
    assert client.set(record="").successful
    client.graph.wait_for(
        lambda: [text for text in client.log if f"'{file}' is lost: {reason}" in text]
    )
    assert recordings_lost(client) == before + 1
    client.wait_until(client.now() + 0.5)


@pytest.mark.parametrize("ending", ENDINGS)
def test_parts_of_a_run_are_recorded(client: SimClient, tmp_path: Path, ending: str) -> None:
    files = [tmp_path / f"{name}.{ending}" for name in ("first", "second")]
    for file in files:
        begin(client, file)
        assert not file.exists()  # before it is complete
        assert client.set(record="").successful
        assert duration(file) >= 1.0
    assert sorted(tmp_path.iterdir()) == files


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_shortest_recording_has_a_picture(
    client: SimClient, tmp_path: Path, ending: str
) -> None:
    file = tmp_path / f"short.{ending}"
    assert client.set(record=str(file)).successful
    assert client.set(record="").successful
    assert duration(file) > 0.0


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_cannot_be_written_is_refused_with_the_reason(
    client: SimClient, tmp_path: Path, ending: str
) -> None:
    folder = tmp_path / f"folder.{ending}"
    folder.mkdir()
    for file, reason in ((folder, "it is a folder"), (Path(f"/proc/file.{ending}"), "No such")):
        result = client.set(record=str(file))
        assert not result.successful
        assert f"cannot record to '{file}': {reason}" in result.reason
    assert list(tmp_path.iterdir()) == [folder]
    client.wait_until(client.now() + 0.5)


def test_a_refused_recording_does_not_end_the_one_that_is_made(
    client: SimClient, tmp_path: Path
) -> None:
    file = tmp_path / "first.mp4"
    begin(client, file)
    assert not client.set(record="/proc/second.mp4", seed=7).successful
    client.wait_until(client.now() + 2.0)
    assert client.set(record="").successful
    assert duration(file) >= 3.0


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_removed_folder_does_not_end_the_simulation(
    client: SimClient, tmp_path: Path, ending: str
) -> None:
    file = tmp_path / "folder" / f"lost.{ending}"
    file.parent.mkdir()
    before = begin(client, file)
    shutil.rmtree(file.parent)
    assert_lost(client, file, "No such file or directory", before)


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_folder_of_its_name_does_not_end_the_simulation(
    client: SimClient, tmp_path: Path, ending: str
) -> None:
    file = tmp_path / f"lost.{ending}"
    before = begin(client, file)
    file.mkdir()
    assert_lost(client, file, "Is a directory", before)
    assert list(tmp_path.iterdir()) == [file]
