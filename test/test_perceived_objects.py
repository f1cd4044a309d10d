"""What morph_node publishes for programs that know no morphing parameters is the same object."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Pose, PoseStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from vision_msgs.msg import Detection3DArray

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.object_urdf import object_urdf
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.model.room_model import RoomModel
from kmn_perception.model.rotation import matrix_from_quaternion
from kmn_perception.ros.messages import cloud_from_points

pybullet = pytest.importorskip("pybullet")
DOOR, ROOM_DOOR = KinematicModel.load("door"), RoomModel.load("room_door")
VALUES = np.array([0.1, -0.2, 0.3, -0.1, 0.1, 0.02, -0.05])
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2.0


@pytest.fixture
def engine() -> Any:
    number = pybullet.connect(pybullet.DIRECT)
    yield number
    pybullet.disconnect(number)


def links_in_pybullet(
    engine: int, urdf: str, folder: Path, angles: dict[str, float]
) -> dict[str, NDArray[np.float64]]:
    """Return low and high corners (2, 3) around each link with its joints at some angles."""
    file = folder / "object.urdf"
    file.write_text(urdf)
    body = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=engine)
    found = {}
    for number in range(pybullet.getNumJoints(body, physicsClientId=engine)):
        info = pybullet.getJointInfo(body, number, physicsClientId=engine)
        angle = angles.get(info[1].decode(), 0.0)
        pybullet.resetJointState(body, number, angle, physicsClientId=engine)
        found[info[12].decode()] = number
    boxes = {}
    for name, number in found.items():
        shapes = pybullet.getCollisionShapeData(body, number, physicsClientId=engine)
        state = pybullet.getLinkState(body, number, 0, True, physicsClientId=engine)
        if shapes:
            _, _, kind, size, _, place, turn = shapes[0]
            assert kind == pybullet.GEOM_BOX
            at, turned = pybullet.multiplyTransforms(state[0], state[1], place, turn)
            points = (CORNERS * size) @ matrix_from_quaternion(turned).T + at
            boxes[name] = np.array([points.min(axis=0), points.max(axis=0)])
    return boxes


def around(cube: NDArray[np.float64]) -> NDArray[np.float64]:
    points = CORNERS @ cube[:3, :3].T + cube[:3, 3]
    return np.array([points.min(axis=0), points.max(axis=0)])


@pytest.mark.parametrize("side", ["right", "left"])
@pytest.mark.parametrize("opening", [0.0, -0.4, 0.7])
def test_the_description_is_the_object_in_another_programs_eyes(
    engine: int, tmp_path: Path, side: str, opening: float
) -> None:
    """Its joints turn it to where the model of rooms has it, also where it is mirrored."""
    urdf = object_urdf(ROOM_DOOR.model, ROOM_DOOR.pose(VALUES, side), VALUES[3:], "map")
    found = links_in_pybullet(engine, urdf, tmp_path, {"hinge": opening})
    nuisances = ROOM_DOOR.nuisances(opening=opening)
    names, cubes = ROOM_DOOR.cubes(VALUES, nuisances, "lever", side)
    assert found["panel"] == pytest.approx(around(cubes[names.index("panel")]), abs=1e-5)


def test_a_box_is_scaled(engine: int, tmp_path: Path) -> None:
    model = KinematicModel.load("box_c")
    values = 0.5 * model.limits[:, 1]
    theta, gamma = model.split(values)
    urdf = object_urdf(model, model.transformation.matrix(theta), gamma, "map")
    [(name, found)] = links_in_pybullet(engine, urdf, tmp_path, {}).items()
    assert name == model.name
    assert found == pytest.approx(around(model.unit_cubes(theta, gamma)[0]), abs=1e-5)


class Program(Node):
    """Knows standard messages only."""

    def __init__(self, **options: Any) -> None:
        super().__init__("program", **options)
        self.received: dict[str, list[Any]] = {}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, topic, profile in (
            (Detection3DArray, "detections", 10),
            (PoseStamped, "handle_pose", 10),
            (JointState, "object_joint_states", 10),
            (String, "object_description", latched),
        ):
            kept = self.received.setdefault(topic, [])
            self.create_subscription(kind, topic, kept.append, profile)


def matrix(pose: Pose) -> NDArray[np.float64]:
    place, turn = pose.position, pose.orientation
    found = np.eye(4)
    found[:3, :3] = matrix_from_quaternion([turn.x, turn.y, turn.z, turn.w])
    found[:3, 3] = place.x, place.y, place.z
    return found


def test_a_door_is_detected_described_and_its_handle_is_where_it_is(
    graph: Any, client: Any, tmp_path: Path, engine: int
) -> None:
    program = graph.start(Program)
    theta, gamma = DOOR.split(VALUES)
    cubes = DOOR.unit_cubes(theta, gamma)
    depth = render(cubes, DOOR.camera)
    points = depth_to_points(depth, DOOR.camera)
    for second in (1, 2):
        header = Header(frame_id="camera_optical_frame")
        header.stamp.sec = second
        assert client.ask(cloud_from_points(points, header)).reason == ""
    for topic in ("detections", "handle_pose", "object_joint_states"):
        graph.wait_for(lambda: len(program.received[topic]) == 2)  # noqa: B023
    [detection] = program.received["detections"][-1].detections
    [result] = detection.results
    assert (result.hypothesis.class_id, result.hypothesis.score) == ("door", 1.0)
    truth = DOOR.transformation.matrix(theta)
    assert matrix(result.pose.pose) == pytest.approx(truth, abs=0.005)
    deviations = np.sqrt(np.diag(np.reshape(result.pose.covariance, (6, 6))))
    assert (deviations[[0, 1, 5]] > 0.0).all()
    assert deviations[2:5] == pytest.approx(0.0, abs=1e-9)  # a door stands upright on the floor
    ends = [b.centre(gamma) + side * b.size(gamma) for b in DOOR.bodies for side in (-0.5, 0.5)]
    low, high = np.min(ends, axis=0), np.max(ends, axis=0)
    box = detection.bbox
    assert (box.size.x, box.size.y, box.size.z) == pytest.approx(tuple(high - low), abs=0.01)
    middle = np.linalg.inv(truth) @ matrix(box.center)
    assert middle[:3, 3] == pytest.approx((low + high) / 2.0, abs=0.01)
    assert middle[:3, :3] == pytest.approx(np.eye(3), abs=0.005)
    handle = matrix(program.received["handle_pose"][-1].pose)
    assert handle[:3, 3] == pytest.approx(cubes[1][:3, 3], abs=0.005)
    assert handle[:3, :3] == pytest.approx(truth[:3, :3], abs=0.005)
    state = program.received["object_joint_states"][-1]
    assert (list(state.name), list(state.position)) == (["hinge", "handle"], [0.0, 0.0])
    [description] = program.received["object_description"]  # the same for both frames
    found = links_in_pybullet(engine, description.data, tmp_path, {})
    for name, cube in zip(("panel", "handle"), cubes, strict=True):
        assert found[name] == pytest.approx(around(cube), abs=0.01)
