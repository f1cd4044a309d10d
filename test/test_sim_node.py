"""sim_node moves the robot, refuses bad trajectories, shows depth, and changes its world."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.ros.messages import camera_from_info, depth_from_image, points_from_cloud
from kmn_perception.ros.stamps import seconds
from sim_client import ARM, SimClient, trajectory

pytest.importorskip("pybullet")
from kmn_sim.ros.sim_node import SimNode  # noqa: E402


@pytest.fixture(scope="module")
def sim(graph: Any) -> SimNode:
    overrides = [
        Parameter("real_time_factor", value=0.0),
        Parameter("publish_clock", value=True),
        Parameter("placement", value="random"),
        Parameter("allow_partial_joints_goal", value=True),
    ]
    return graph.start(SimNode, parameter_overrides=overrides)


@pytest.fixture(scope="module")
def connected(graph: Any, sim: SimNode) -> SimClient:
    made = graph.start(lambda **_: SimClient(graph))
    made.graph.wait_for(made.trajectory.get_subscription_count)
    made.setting.wait_for_service()
    made.graph.wait_for(lambda: made.joints and made.reports and made.truths)
    return made


@pytest.fixture
def client(connected: SimClient) -> Iterator[SimClient]:
    """Return the client of a world in which all is where it started."""
    assert connected.call(connected.reset, Trigger.Request()).success
    time.sleep(0.1)
    for kept in (connected.joints, connected.reports):
        kept.clear()
    connected.graph.wait_for(lambda: connected.joints)
    yield connected


def test_a_trajectory_moves_the_robot(client: SimClient) -> None:
    client.trajectory.publish(trajectory((1.0, 0.5, -1.0), (2.0, 0.2, -0.8)))
    client.wait_until_at(ARM[0], 0.2)
    client.wait_until_at(ARM[1], -0.8)
    state = client.joints[-1]
    assert len(state.name) == len(state.position) == len(state.velocity) == len(state.effort) == 11
    report = client.report()
    assert float(report["progress"]) > 0.5
    assert float(report["error_l_elbow_flex_joint"]) < 0.02


def in_the_past(message: JointTrajectory) -> JointTrajectory:
    """Return the trajectory with a stamp of long ago."""
    message.header.stamp.nanosec = 1
    return message


BAD = {
    "unknown_joint": trajectory((1.0, 0.0, -1.0), names=["l_shoulder_pan_joint", "nose"]),
    "lengths": trajectory((1.0, 0.0)),
    "times": trajectory((1.0, 0.0, -1.0), (1.0, 0.1, -1.0)),
    "not_finite": trajectory((1.0, math.nan, -1.0)),
    "out_of_limits": trajectory((1.0, 0.0, 0.5)),
    "joint_names": trajectory((1.0, 0.0, -1.0), names=[ARM[0], ARM[0]]),
    "empty": JointTrajectory(),
    "in_the_past": in_the_past(trajectory((0.1, 0.0, -1.0))),
}


@pytest.mark.parametrize("reason", BAD)
def test_a_bad_trajectory_is_refused_whole_and_nothing_moves(
    client: SimClient, reason: str
) -> None:
    before = client.position(ARM[0])
    client.trajectory.publish(BAD[reason])
    report = client.graph.wait_for(
        lambda: next((r for r in client.reports if f"refused_{reason}" in r), None)
    )
    assert report["last"].startswith(f"refused, {reason}: ")
    assert client.position(ARM[0]) == pytest.approx(before, abs=1e-3)


def test_a_flood_of_messages_does_not_stop_the_physics(client: SimClient) -> None:
    start = seconds(client.joints[-1].header.stamp)
    for _ in range(500):
        client.trajectory.publish(BAD["not_finite"])
    client.graph.wait_for(lambda: seconds(client.joints[-1].header.stamp) > start + 2.0)
    client.trajectory.publish(trajectory((0.5, 0.3, -1.0)))
    client.wait_until_at(ARM[0], 0.3)


def test_depth_image_and_cloud_show_the_true_door(client: SimClient) -> None:
    subscriptions = [
        client.create_subscription(kind, name, kept.append, 10)
        for kind, name, kept in (
            (Image, "depth/image", client.images),
            (CameraInfo, "depth/camera_info", client.infos),
            (PointCloud2, "points", client.clouds),
        )
    ]
    client.graph.wait_for(lambda: len(client.images) > 2 and len(client.clouds) > 2)
    for subscription in subscriptions:
        client.destroy_subscription(subscription)
    stamps = {cloud.header.stamp.nanosec: cloud for cloud in client.clouds}
    image = next(i for i in client.images if i.header.stamp.nanosec in stamps)
    cloud = stamps[image.header.stamp.nanosec]
    assert image.header.frame_id == cloud.header.frame_id == "camera_depth_optical_frame"
    assert image.encoding == "32FC1"
    depth = depth_from_image(image, 100.0)
    camera = camera_from_info(client.infos[-1])
    points = points_from_cloud(cloud, 100.0)
    np.testing.assert_allclose(points, depth_to_points(depth, camera), rtol=1e-6, equal_nan=True)
    truth = client.truths[-1]
    model = KinematicModel.load(truth.model)
    door = render(model.unit_cubes(truth.theta, truth.gamma), model.camera)
    seen = np.isfinite(door)
    assert np.median(np.abs(depth - door)[seen]) < 1e-3


@pytest.mark.parametrize(("encoding", "channels"), [("rgb8", 3), ("mono8", 1)])
def test_the_image_has_the_pixels_stamp_and_frame_of_the_depth(
    client: SimClient, encoding: str, channels: int
) -> None:
    colours: list[Image] = []
    client.images.clear()
    subscriptions = [
        client.create_subscription(Image, name, kept.append, 10)
        for name, kept in (("depth/image", client.images), ("image", colours))
    ]
    client.graph.wait_for(lambda: client.images)
    assert not colours  # as long as nobody asks for it
    assert client.set(image=True, image_encoding=encoding, room=True).successful

    def both() -> tuple[Image, Image] | None:
        depths = {seconds(image.header.stamp): image for image in client.images}
        stamps = [seconds(image.header.stamp) for image in colours]
        return next(
            ((depths[t], image) for t, image in zip(stamps, colours, strict=True) if t in depths),
            None,
        )

    depth, image = client.graph.wait_for(both)
    for subscription in subscriptions:
        client.destroy_subscription(subscription)
    assert client.set(image=False, image_encoding="rgb8", room=False).successful
    assert (image.encoding, image.header.frame_id) == (encoding, depth.header.frame_id)
    assert (image.width, image.height) == (depth.width, depth.height)
    assert image.step == channels * image.width
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, -1)
    assert len(np.unique(pixels)) > 5


def test_the_world_changes_by_parameters_while_a_trajectory_runs(client: SimClient) -> None:
    client.trajectory.publish(trajectory((20.0, 0.0, -1.0)))
    values = [0.1, 0.2, 0.3, 0.1, 0.0, 0.01, 0.02]
    assert client.set(placement="given", values=values, direction="push").successful
    client.graph.wait_for(
        lambda: [*client.truths[-1].theta, *client.truths[-1].gamma] == pytest.approx(values)
    )
    # Back where it starts.
    client.graph.wait_for(lambda: client.position(ARM[0]) == pytest.approx(1.0, abs=0.01))
    assert client.set(placement="random", direction="pull").successful


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"placement": "given", "values": [5.0] + [0.0] * 6}, "x = 5 is outside"),
        ({"placement": "given", "values": [0.0]}, "has 7 parameters"),
        ({"placement": "somewhere"}, "'placement' must be one of"),
        ({"model": "elephant"}, "elephant"),
        ({"noise": "loud"}, "'noise' must be one of"),
        ({"model": "box_a", "room": True}, "'room' is for doors"),
        ({"room": True, "wall": True}, "a 'room' has its own frame and wall"),
        ({"recess": 0.5}, "recess"),
        ({"image_encoding": "bgr8"}, "'image_encoding' must be one of"),
        ({"camera": "nowhere"}, "nowhere"),
        ({"camera_rate": 1000.0}, "camera_rate"),
        ({"renderer": "software"}, "renderer"),
    ],
)
def test_a_wrong_parameter_is_refused_with_the_reason(
    client: SimClient, values: dict[str, Any], text: str
) -> None:
    result = client.set(**values)
    assert not result.successful
    assert text in result.reason


def test_boxes_have_no_door_state(client: SimClient) -> None:
    assert client.set(model="box_c", table=True).successful
    client.graph.wait_for(lambda: client.truths[-1].model == "box_c")

    def no_door_is_told() -> bool:
        client.doors.clear()
        time.sleep(0.5)
        return not client.doors

    client.graph.wait_for(no_door_is_told)  # what was on its way has come
    assert client.set(model="door", table=False).successful


def test_the_clock_is_that_of_the_stamps(client: SimClient) -> None:
    client.graph.wait_for(lambda: client.clocks and client.joints)
    clock, stamp = seconds(client.clocks[-1].clock), seconds(client.joints[-1].header.stamp)
    assert clock == pytest.approx(stamp, abs=1.0)


def test_a_clock_is_published_only_where_it_is_asked_for(graph: Any, sim: SimNode) -> None:
    silent = graph.start(SimNode, namespace="silent")

    def published(namespace: str) -> list[str]:
        topics = silent.get_publisher_names_and_types_by_node("sim_node", namespace)
        return [name for name, _ in topics]

    assert "/silent/joint_states" in published("/silent")
    assert "/clock" not in published("/silent")
    assert [end.node_namespace for end in sim.get_publishers_info_by_topic("/clock")] == ["/"]


def test_the_real_time_factor_is_kept(client: SimClient) -> None:
    assert client.set(real_time_factor=0.1).successful
    try:
        client.graph.wait_for(lambda: abs(float(client.report()["real_time_factor"]) - 0.1) < 0.01)
    finally:
        assert client.set(real_time_factor=0.0).successful
