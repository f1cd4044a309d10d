"""morph_node with several models: each object is of one of them, of several, or of none."""

from __future__ import annotations

from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from std_msgs.msg import Header, String
from vision_msgs.msg import Detection3DArray

from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.network import weights
from kmn_perception.ros.messages import cloud_from_points, image_from_depth, info_from_camera
from kmn_perception.ros.morph_node import MorphNode
from talk import listen

CAMERA = Camera.load("furniture")
DRAWER, LID = KinematicModel.load("drawer"), KinematicModel.load("lid")
AT_LEFT = np.array([0.1, 0.5, 0.1, 0.05, -0.05, 0.02, 0.01, 0.01])
AT_RIGHT = np.array([0.0, -0.5, -0.1, 0.05, -0.1, 0.03])
SECONDS = count(1)  # every frame its own stamp


def cuboid(size: tuple[float, ...], centre: tuple[float, ...]) -> NDArray[np.float64]:
    cube = np.diag([*size, 1.0])
    cube[:3, 3] = centre
    return cube


FLOOR, WALL = cuboid((9.0, 9.0, 0.1), (0.0, 0.0, -0.05)), cuboid((0.1, 9.0, 9.0), (3.0, 0.0, 0.0))
CRATE = cuboid((0.5, 0.6, 0.9), (0.25, -0.5, 0.45))


def bodies(model: KinematicModel, values: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    return list(model.unit_cubes(*model.split(values)))


@pytest.fixture(scope="module")
def node(graph: Any) -> MorphNode:
    given = {"model": "lid, drawer", "objects": "all", "reliability": "reliable", "max_time": 60.0}
    return graph.start(
        MorphNode, parameter_overrides=[Parameter(name, value=v) for name, v in given.items()]
    )


def see(client: Any, number: int, *cubes: NDArray[np.float64]) -> list[MorphingParameters]:
    """Return the answers to a frame that shows some bodies, of which there are so many."""
    header = Header(frame_id="camera_optical_frame")
    header.stamp.sec = next(SECONDS)
    depth = render(np.array([FLOOR, WALL, *cubes]), CAMERA)
    depth += 0.001 * np.random.default_rng(header.stamp.sec).standard_normal(depth.shape)
    client.info.publish(info_from_camera(CAMERA, header))
    client.info.wait_for_all_acked()
    client.image.publish(image_from_depth(depth.astype(np.float32), "32FC1", header))
    client.overlay(header.stamp)  # comes after all answers

    def answers() -> list[MorphingParameters]:
        return [answer for answer in client.answers if answer.header.stamp == header.stamp]

    client.graph.wait_for(lambda: len(answers()) >= number)
    assert len(answers()) == number
    return answers()


def values(answer: MorphingParameters) -> NDArray[np.float64]:
    return np.array([*answer.theta, *answer.gamma])


def test_two_objects_are_of_two_models_and_keep_their_numbers(graph: Any, client: Any) -> None:
    detections = listen(client, Detection3DArray, "detections")
    graph.wait_for(lambda: client.count_publishers("detections"))
    numbers = []
    for _ in range(3):
        found = see(client, 2, *bodies(DRAWER, AT_LEFT), *bodies(LID, AT_RIGHT))
        assert {answer.reason for answer in found} == {""}
        by_model = {answer.model: answer for answer in found}
        np.testing.assert_allclose(values(by_model["drawer"]), AT_LEFT, atol=0.01)
        np.testing.assert_allclose(values(by_model["lid"]), AT_RIGHT, atol=0.01)
        assert by_model["drawer"].gamma_names == [parameter.name for parameter in DRAWER.gamma]
        numbers.append({name: answer.id for name, answer in by_model.items()})
        markers = client.overlay(found[0].header.stamp)
        assert {marker.ns for marker in markers[1:]} == {"drawer", "lid"}
    assert numbers[0] == numbers[1] == numbers[2]
    assert numbers[0]["drawer"] != numbers[0]["lid"]
    graph.wait_for(lambda: len(detections) >= 3)
    told = {int(d.id): d.results[0].hypothesis.class_id for d in detections[-1].detections}
    assert told == {number: name for name, number in numbers[-1].items()}


def test_the_description_is_of_the_first_object_s_model(graph: Any, client: Any) -> None:
    descriptions = listen(client, String, "object_description")
    see(client, 1, *bodies(LID, AT_RIGHT))
    graph.wait_for(lambda: any('robot name="lid"' in said.data for said in descriptions))
    see(client, 1, *bodies(DRAWER, AT_LEFT))
    graph.wait_for(lambda: any('robot name="drawer"' in said.data for said in descriptions))


def test_a_thing_of_no_model_is_refused_beside_an_object(client: Any) -> None:
    found = see(client, 2, *bodies(DRAWER, AT_LEFT), CRATE)
    (drawer,) = (answer for answer in found if answer.status == MorphingParameters.OK)
    assert drawer.model == "drawer"
    (crate,) = (answer for answer in found if answer is not drawer)
    assert f"'{crate.model}' explains it best, and not well enough: " in crate.reason


def test_the_service_tells_the_model_of_the_nearest(client: Any) -> None:
    header = Header(frame_id="camera_optical_frame")
    depth = render(np.array([FLOOR, WALL, *bodies(LID, AT_RIGHT)]), CAMERA)
    cloud = cloud_from_points(depth_to_points(depth, CAMERA), header)
    answer = client.call(client.estimation, EstimateMorphing.Request(points=cloud)).parameters
    assert (answer.model, answer.status, answer.id) == ("lid", MorphingParameters.OK, 0)


def write_twin(model: KinematicModel, name: str, folder: Path) -> Path:
    """Write a model's file under another name, with its weights; return the file."""
    content = yaml.safe_load(model.file.read_text(encoding="utf-8"))
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump({**content, "name": name}, sort_keys=False), encoding="utf-8")
    trained = weights.load(model.name, model)
    renamed = replace(trained, metadata={**trained.metadata, "model": name})
    weights.save(file.with_suffix(".safetensors"), renamed)
    return file


def test_two_models_that_cannot_be_told_apart_are_both_named(
    client: Any, restored: None, tmp_path: Path
) -> None:
    commode = write_twin(DRAWER, "commode", tmp_path)
    assert client.set(model=f"drawer,{commode},lid").successful
    (answer,) = see(client, 1, *bodies(DRAWER, AT_LEFT))
    assert answer.status == MorphingParameters.AMBIGUOUS
    assert "'drawer'" in answer.reason and "'commode'" in answer.reason
    assert "'lid'" not in answer.reason


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"model": "drawer,room_door"}, "'model' must be 'room_door' alone"),
        ({"model": "drawer,lid,drawer"}, "names of models must differ, found drawer, lid, drawer"),
        ({"model": "drawer,window"}, "'window' is neither a file nor one of the shipped"),
        ({"weights": "drawer"}, "'weights' must be empty or 2 names, one for each of lid, drawer"),
        ({"weights": "drawer,lid"}, "was trained for another model"),
    ],
)
def test_what_does_not_go_together_is_refused(
    client: Any, node: MorphNode, given: dict[str, str], reason: str
) -> None:
    result = client.set(**given)
    assert not result.successful
    assert reason in result.reason
    assert node.get_parameter("model").value == "lid, drawer"
