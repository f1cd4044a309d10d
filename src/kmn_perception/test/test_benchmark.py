"""The benchmark: its scene is what it says, and a short run of it in processes of its own."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import domain_coordinator
import numpy as np
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from kmn_perception.benchmark import arguments, benchmark
from kmn_perception.benchmark.callbacks import CASES
from kmn_perception.benchmark.scene import PLACES, WALL_DISTANCE, boxes_on_a_table, full_cloud
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_cloud, render
from kmn_perception.model.transformation import transform_points
from kmn_perception.network import weights
from kmn_perception.network.cascade import Cascade
from kmn_perception.network.cascade_settings import CascadeSettings
from kmn_perception.ros.messages import points_from_cloud

COMMAND = [sys.executable, "-m", "kmn_perception", "benchmark"]
FRAMES = 5


@pytest.fixture
def environment() -> Iterator[dict[str, str]]:
    """Return the environment of a process in a ROS domain of its own."""
    with domain_coordinator.domain_id() as domain:
        yield {**os.environ, "ROS_DOMAIN_ID": str(domain)}


@pytest.fixture
def parameters(tmp_path: Path) -> list[str]:
    """Return ROS arguments that name weights of the door with an untrained network."""
    path, door = tmp_path / "door.safetensors", KinematicModel.load("door")
    untrained = Cascade(door, CascadeSettings.load(), stages=2)
    weights.save(path, weights.Weights(untrained, None, weights.describe(door)))
    return ["--ros-args", "-p", f"weights:={path}"]


@pytest.mark.parametrize("name", ["door", "box"])
def test_the_scene_shows_the_prototype_on_a_floor_before_a_wall(name: str) -> None:
    model = KinematicModel.load(name)
    points = points_from_cloud(full_cloud(model), max_range=100.0)
    assert points.shape == (480, 640, 3)
    assert np.isfinite(points).all()
    zero = np.zeros(len(model.parameters))
    alone = render(model.unit_cubes(*model.split(zero)), model.camera)
    seen = ~np.isnan(alone)
    np.testing.assert_array_equal(points[..., 2][seen], alone[seen])
    world = transform_points(model.camera.pose, points)[~seen]
    forward = model.camera.pose[:2, 2] / np.linalg.norm(model.camera.pose[:2, 2])
    on_floor = np.abs(world[:, 2]) < 1e-4
    on_wall = np.abs(world[:, :2] @ forward - WALL_DISTANCE) < 0.02
    assert (on_floor | on_wall).all()
    assert on_floor.any()


def test_every_box_on_the_table_stands_by_itself() -> None:
    model = KinematicModel.load("box")
    points = depth_to_cloud(boxes_on_a_table(model), model.camera)
    for x, y in PLACES:
        above = points[np.hypot(points[:, 0] - x, points[:, 1] - y) < 0.05, 2]
        assert above.max() == pytest.approx(0.2, abs=1e-4)


def test_the_result_holds_every_stage_and_the_transport(
    tmp_path: Path, environment: dict[str, str], parameters: list[str]
) -> None:
    out = tmp_path / "result.json"
    command = [*COMMAND, "--frames", str(FRAMES), "--json", str(out), *parameters]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
    result = json.loads(out.read_text())
    assert set(result) == {"stages", "callbacks", "latency", "transport"}
    assert tuple(result["callbacks"]) == CASES
    assert list(result["stages"]) == [
        "message_to_view", "background_removal", "splat", "network", "predictions",
        "refinement", "refined_estimate", "callback",
    ]  # fmt: skip
    for times in (*result["stages"].values(), *result["callbacks"].values()):
        assert set(times) == {"median_ms", "p95_ms"}
        assert 0.0 < times["median_ms"] <= times["p95_ms"]
    assert list(result["transport"]) == ["with_our_profile", "foreign"]
    for sender, transport in result["transport"].items():
        assert set(transport) == {"sent", "received", "lost", "median_ms"}
        assert transport["sent"] == FRAMES
        assert transport["received"] + transport["lost"] <= FRAMES
        assert sender == "foreign" or transport["received"] > 0
    ((case, latency),) = result["latency"].items()
    assert 0 < latency["answered"] <= latency["sent"] == FRAMES
    assert 0.0 < latency["median_ms"] <= latency["p95_ms"]
    for row in (*result["stages"], *result["callbacks"], case, *result["transport"]):
        assert f"\n{row} " in ended.stdout


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (["--frames", "0"], "0 is not a whole number from 1"),
        (["--json", "nowhere/result.json"], "is not a file in a folder that exists"),
    ],
)
def test_bad_arguments_end_with_a_message(
    line: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        arguments(line)
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("parameter", "message"),
    [
        ("model:=boat", "'boat' is neither a file nor one of the shipped"),
        ("crop_min:=[9.0, 9.0, 9.0]", "'crop_min' must be below 'crop_max'"),
        ("crop_max:=[-1.0, 1.5, 3.0]", "the node's parameters leave nothing of a 'door'"),
    ],
)
def test_parameters_that_cannot_be_measured_are_refused(
    parameter: str, message: str, parameters: list[str]
) -> None:
    context = Context()
    with domain_coordinator.domain_id() as domain:
        rclpy.init(context=context, domain_id=domain)
        node = Node("benchmark", context=context, cli_args=[*parameters, "-p", parameter])
        with pytest.raises((OSError, ValueError), match=message):
            benchmark(node, FRAMES)
        node.destroy_node()
        rclpy.shutdown(context=context)


@pytest.mark.slow
def test_ctrl_c_ends_both_processes_without_a_traceback(
    environment: dict[str, str], parameters: list[str]
) -> None:
    with subprocess.Popen(
        [*COMMAND, "--frames", "8", *parameters],
        env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stderr is not None
        assert any("transport:" in line for line in process.stderr)
        os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to both
        _, rest = process.communicate(timeout=60)  # returns when none of them holds the pipe
    assert process.returncode == 128 + signal.SIGINT
    assert "Traceback" not in rest
