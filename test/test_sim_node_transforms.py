"""What sim_node tells of frames: the robot's links, its camera, and doors seen from it."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from scipy.spatial.transform import Rotation
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.camera import Camera
from kmn_perception.ros.morph_node import MorphNode
from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.ros.stamps import NANOSECONDS, seconds
from kmn_perception.ros.transforms import TransformListener
from kmn_perception.transforms.transform import TransformError
from sim_client import SimClient

pybullet = pytest.importorskip("pybullet")
from kmn_sim.ros.sim_node import SimNode  # noqa: E402

HEAD = Camera.load("pr2_head")
OPTICAL = "camera_depth_optical_frame"


class Observer(SimClient):
    """Listens to transforms, the robot's description and what morph_node finds."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.descriptions: list[String] = []
        self.found: list[MorphingParameters] = []
        self.create_subscription(String, "robot_description", self.descriptions.append, latched)
        self.create_subscription(MorphingParameters, "morphing_parameters", self.found.append, 100)
        self.transforms = TransformListener(self, ThrottledWarnings(self))
        self.transforms.listen(True)

    def hears_of_motion(self) -> bool:
        with suppress(TransformError):
            self.transforms.lookup("odom", "base_footprint", 0)
            return True
        return False

    def pose(self, target: str, source: str, stamp: Any) -> NDArray[np.float64]:
        nanoseconds = stamp.sec * NANOSECONDS + stamp.nanosec
        return self.transforms.lookup(target, source, nanoseconds, patience=20.0)


@pytest.fixture(scope="module")
def sim(graph: Any) -> SimNode:
    values = {"camera": "pr2_head", "camera_mount": "base", "placement": "random", "seed": 2}
    values |= {"allow_partial_joints_goal": True}
    overrides = [Parameter(name, value=value) for name, value in values.items()]
    return graph.start(SimNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def client(graph: Any, sim: SimNode) -> Observer:
    made = graph.start(lambda **_: Observer(graph))
    made.graph.wait_for(made.trajectory.get_subscription_count)
    made.setting.wait_for_service()
    made.graph.wait_for(lambda: made.joints and made.truths and made.descriptions)
    made.graph.wait_for(made.hears_of_motion)
    made.joints.clear()
    made.graph.wait_for(lambda: made.joints)
    return made


def drive(client: Observer, **positions: float) -> None:
    point = JointTrajectoryPoint(positions=list(positions.values()))
    point.time_from_start.sec = 3
    client.trajectory.publish(JointTrajectory(joint_names=list(positions), points=[point]))


def links(description: str, folder: Any, positions: dict[str, float]) -> dict[str, Any]:
    """Return the poses (4, 4) of all links below the first one, as pybullet has them."""
    file = folder / "robot.urdf"
    file.write_text(description.replace("file://", ""))
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=client)
        poses = {}
        infos = [
            pybullet.getJointInfo(body, joint, physicsClientId=client)
            for joint in range(pybullet.getNumJoints(body, physicsClientId=client))
        ]
        for info in infos:
            name = info[1].decode()
            gripper = "_finger_" in name
            at = positions.get("l_gripper_l_finger_joint" if gripper else name, 0.0)
            pybullet.resetJointState(body, info[0], at, physicsClientId=client)
        for info in infos:
            state = pybullet.getLinkState(body, info[0], 0, 1, physicsClientId=client)
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = Rotation.from_quat(state[5]).as_matrix(), state[4]
            poses[info[12].decode()] = pose
    finally:
        pybullet.disconnect(client)
    return poses


def test_every_link_is_where_the_description_and_the_joints_have_it(
    client: Observer, tmp_path: Any
) -> None:
    state = client.joints[-1]
    positions = dict(zip(state.name, state.position, strict=True))
    poses = links(client.descriptions[0].data, tmp_path, positions)
    assert len(poses) == 12  # base, seven of the arm, four of the gripper
    for link, expected in poses.items():
        found = client.pose("base_footprint", link, state.header.stamp)
        np.testing.assert_allclose(found, expected, atol=1e-6, err_msg=link)
    x, y, yaw = (positions[name] for name in ("base_x", "base_y", "base_yaw"))
    base = client.pose("odom", "base_footprint", state.header.stamp)
    np.testing.assert_allclose(base[:3, 3], [x, y, 0.0], atol=1e-9)
    assert np.arctan2(base[1, 0], base[0, 0]) == pytest.approx(yaw)
    np.testing.assert_allclose(client.pose("world", "odom", state.header.stamp), np.eye(4))


def test_the_camera_is_an_optical_frame_where_it_is_mounted(client: Observer) -> None:
    stamp = client.joints[-1].header.stamp
    optical = client.pose("base_footprint", OPTICAL, stamp)
    np.testing.assert_allclose(optical, HEAD.pose, atol=1e-9)
    body = client.pose("camera_link", OPTICAL, stamp)  # x forward, y left (REP-103)
    np.testing.assert_allclose(body[:3, 2], [1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(body[:3, 0], [0.0, -1.0, 0.0], atol=1e-9)


def test_a_door_stays_where_it_is_while_the_camera_on_the_robot_moves(
    client: Observer, graph: Any
) -> None:
    overrides = [Parameter("reliability", value="reliable")]
    with graph.running(MorphNode, parameter_overrides=overrides):
        graph.wait_for(lambda: client.found)
        client.found.clear()
        drive(client, base_x=-2.7, base_y=0.3, base_yaw=-0.2)
        client.wait_until_at("base_x", -2.7)
        found = [each for each in client.found if each.status == MorphingParameters.OK]
        assert len(found) > 5
        assert len(found) > 0.8 * len(client.found), client.found[-1].reason
    truth = client.truths[-1]
    true = np.array([*truth.theta, *truth.gamma])
    for each in found:
        errors = np.array([*each.theta, *each.gamma]) - true
        assert np.abs(errors[:3]).max() < 0.02
    places = [client.pose("world", "base_footprint", each.header.stamp)[:2, 3] for each in found]
    assert np.ptp(places, axis=0).max() > 0.3  # of the robot


def test_a_camera_that_is_put_elsewhere_is_told_anew(client: Observer) -> None:
    assert client.set(camera_mount="world", camera="d455").successful

    def told() -> bool:
        stamp = client.joints[-1].header.stamp
        pose = client.pose("world", OPTICAL, stamp)
        return bool(np.allclose(pose, Camera.load("d455").pose, atol=1e-9))

    client.graph.wait_for(told)
    assert seconds(client.joints[-1].header.stamp) > 0.0
    refused = client.set(camera_frame="odom")
    assert not refused.successful
    assert "'camera_frame' must differ from the other frames" in refused.reason
