"""morph_node's parameters are described, and change together at run time or not at all."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from kmn_msgs.msg import MorphingParameters
from kmn_perception.configuration.node_parameters import ParameterError, load_node_parameters
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.network.weights import WeightsError
from kmn_perception.ros.messages import cloud_from_points
from kmn_perception.ros.morph_node import MorphNode

NAN = float("nan")
NAMES = list(load_node_parameters("morph_node"))
SECONDS = count(1)  # every frame its own stamp


def view_of(camera: Camera, cubes: NDArray[np.float64]) -> PointCloud2:
    header = Header(frame_id="camera_optical_frame")
    header.stamp.sec = next(SECONDS)
    camera = camera.resized(320, 240)
    return cloud_from_points(depth_to_points(render(cubes, camera), camera), header)


def view_of_door() -> PointCloud2:
    model = KinematicModel.load("door")
    return view_of(model.camera, model.unit_cubes(np.zeros(3), np.zeros(4)))


def view_of_box(table: bool) -> PointCloud2:
    """Show box A to a camera that stands elsewhere than the model's."""
    model = KinematicModel.load("box_a")
    cubes = model.unit_cubes(np.zeros(len(model.theta)), [])
    slab = np.diag([1.6, 1.6, 0.02, 1.0])
    slab[2, 3] = -0.01
    return view_of(Camera.load("kinect_v1"), np.array([*cubes, slab]) if table else cubes)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "tolerance out of range": ({"tolerance": 2.0}, "tolerance out of range"),
    "tolerance NaN": ({"tolerance": NAN}, "tolerance out of range"),
    "no iterations": ({"iterations": 0}, "iterations out of range"),
    "iterations of a wrong type": ({"iterations": 2.5}, "expected 'Type.INTEGER'"),
    "crop volume reversed": ({"crop_min": [9.0, 9.0, 9.0]}, "must be below 'crop_max'"),
    "crop volume flat": ({"crop_max": [1.0, 1.0]}, "'crop_max' must be 3 finite numbers"),
    "crop volume NaN": ({"crop_max": [1.0, 1.0, NAN]}, "'crop_max' must be 3 finite"),
    "unknown camera pose": ({"camera_pose": "sideways"}, "auto, tf, canonical, given"),
    "no rotation": ({"camera_quaternion": [0.0] * 4}, "'camera_quaternion' must be of length 1"),
    "read-only": ({"reliability": "best_effort"}, "read-only"),
    "no world": ({"world_frame": ""}, "'world_frame' is empty"),
    "unknown model": ({"model": "window"}, "'window' is neither a file nor one of the shipped"),
    "weights of another model": ({"weights": "box_a"}, "was trained for another model"),
    "missing weights": ({"weights": "none.safetensors"}, "no weights: 'none.safetensors'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_values_are_refused_with_the_reason(client: Any, node: MorphNode, case: str) -> None:
    values, text = REFUSED[case]
    before = node.get_parameters(NAMES)
    result = client.set(**values)
    assert not result.successful
    assert text in result.reason
    assert node.get_parameters(NAMES) == before
    assert client.ask(view_of_door()).points_used > 1000


def test_corrupt_weights_are_refused(client: Any, tmp_path: Path) -> None:
    file = tmp_path / "corrupt.safetensors"
    file.write_bytes(b"\x10\0\0\0\0\0\0\0not safetensors")
    result = client.set(weights=str(file))
    assert not result.successful
    assert "corrupt.safetensors is not a readable safetensors file" in result.reason


def test_values_that_are_wrong_together_change_nothing(client: Any, node: MorphNode) -> None:
    assert not client.set(iterations=7, crop_min=[9.0, 9.0, 9.0]).successful
    assert node.get_parameter("iterations").value != 7
    assert client.ask(view_of_door()).iterations != 7


@pytest.mark.parametrize(
    ("values", "status", "reason"),
    [
        ({"crop_min": [5.0, 5.0, 0.0], "crop_max": [6.0, 6.0, 1.0]}, "NO_OBJECT", "no points"),
        ({"cluster_min_points": 100_000}, "NO_OBJECT", "no points"),
        ({"plane_margin": 0.5, "crop_max": [1.5, 1.5, 0.4]}, "NO_OBJECT", "no points"),
        ({"max_range": 0.5}, "NO_OBJECT", "no point lies within 0.5 m"),
        ({"min_points": 100_000}, "TOO_FEW_POINTS", "at least 100000 are needed"),
        ({"max_residual": 0.0}, "NOT_CONVERGED", "from the model"),
        ({"max_deviation": 0.0, "deviation_share": 0.8}, "NOT_CONVERGED", "80 % of the points lie"),
        ({"camera_pose": "support_plane"}, "NO_OBJECT", "no support plane"),
    ],
)
def test_changed_values_take_effect(
    client: Any, restored: None, values: dict[str, Any], status: str, reason: str
) -> None:
    assert client.set(limit_margin=1.0, **values).successful
    answer = client.ask(view_of_door())
    assert answer.status == getattr(MorphingParameters, status)
    assert reason in answer.reason


def test_number_of_iterations_takes_effect(client: Any, restored: None) -> None:
    for iterations in (1, 3):
        assert client.set(iterations=iterations, tolerance=0.0).successful
        assert client.ask(view_of_door()).iterations == iterations


def test_world_frame_takes_effect(client: Any, restored: None) -> None:
    assert client.set(world_frame="map").successful
    assert client.ask(view_of_door()).header.frame_id == "map"


def test_model_changes_with_its_shipped_weights(client: Any, restored: None) -> None:
    assert client.set(model="box_a").successful
    answer = client.ask(view_of_box(table=False))
    assert (answer.model, answer.theta_names) == ("box_a", ["x", "y"])


def test_camera_pose_from_the_support_plane(client: Any, restored: None) -> None:
    """A box on a table that an unknown camera sees stands where it would without the table."""
    assert client.set(
        model="box_a",
        camera_pose="support_plane",
        cluster_step=0.02,
        cluster_min_points=50,
    ).successful
    answer = client.ask(view_of_box(table=True))
    camera = Camera.load("kinect_v1").resized(320, 240)
    assert client.set(camera_pose="given", **given(camera)).successful
    expected = client.ask(view_of_box(table=False))
    assert answer.points_used == pytest.approx(expected.points_used, rel=0.05)
    np.testing.assert_allclose(answer.theta, expected.theta, atol=0.05)


def given(camera: Camera) -> dict[str, list[float]]:
    """Return the parameters of a camera that is pitched only."""
    forward = camera.pose[:3, 2]
    tilt = np.pi / 2 - np.arcsin(forward[2])  # about x, from looking up to looking ahead and down
    assert forward[0] == 0.0
    return {
        "camera_position": camera.pose[:3, 3].tolist(),
        "camera_quaternion": [-float(np.sin(tilt / 2)), 0.0, 0.0, float(np.cos(tilt / 2))],
    }


@pytest.mark.parametrize(
    ("name", "value", "error", "text"),
    [
        ("tolerance", -1.0, ParameterException, "out of range"),
        ("tolerance", "small", ParameterException, "expecting type 'DOUBLE'"),
        ("camera_pose", "sideways", ParameterError, "must be one of auto"),
        ("model", "window", FileNotFoundError, "neither a file nor one of the shipped"),
        ("weights", "none.safetensors", WeightsError, "no weights"),
    ],
)
def test_node_does_not_start_with_wrong_values(
    graph: Any, name: str, value: Any, error: type[Exception], text: str
) -> None:
    with pytest.raises(error, match=text):
        MorphNode(context=graph.context, parameter_overrides=[Parameter(name, value=value)])


def test_node_does_not_start_with_the_weights_of_another_model(graph: Any) -> None:
    weights = Parameter("weights", value="box_a")
    with pytest.raises(WeightsError, match="was trained for another model"):
        MorphNode(context=graph.context, parameter_overrides=[weights])
