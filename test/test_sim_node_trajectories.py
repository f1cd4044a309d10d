"""sim_node follows joint_trajectory as strictly as the stock controller does."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.ros.stamps import seconds, stamp_of
from sim_client import ARM, SimClient, time_to_rest, trajectory

pytest.importorskip("pybullet")
from kmn_sim.ros.sim_node import SimNode  # noqa: E402
from kmn_skill.ros.messages import hold_trajectory  # noqa: E402

HOLD_DURATION = load_node_parameters("skill_node")["hold_duration"].default
# Of all joints, in m and rad a second; nearly as fast as plans are.
FAST = np.array([0.5, 0.5, 0.8, -1.0, 0.8, 1.5, 1.5, 2.0, -1.5, 2.0, 0.3])


@pytest.fixture(scope="module")
def client(graph: Any) -> SimClient:
    slow = [Parameter("publish_clock", value=True), Parameter("camera_rate", value=0.1)]
    graph.start(SimNode, parameter_overrides=[*slow, Parameter("real_time_factor", value=0.3)])
    made = graph.start(lambda **_: SimClient(graph))
    made.graph.wait_for(made.trajectory.get_subscription_count)
    made.graph.wait_for(lambda: made.joints and made.reports)
    return made


def wait_until(client: SimClient, time: float) -> None:
    client.graph.wait_for(lambda: seconds(client.joints[-1].header.stamp) > time)


def moving(client: SimClient, duration: float, **changes: float) -> JointTrajectory:
    """Return a trajectory of all joints of which some are to be elsewhere after some time."""
    newest = client.joints[-1]
    target = dict(zip(newest.name, newest.position, strict=True)) | changes
    return trajectory((duration, *target.values()), names=list(target))


def test_a_start_in_the_future_replaces_what_runs_at_once(client: SimClient) -> None:
    """It leads to its first point from where the robot is, 1 rad in 2 s."""
    begin = client.position(ARM[0])
    client.trajectory.publish(moving(client, 1.0, l_elbow_flex_joint=-1.0))
    now = seconds(client.joints[-1].header.stamp)
    message = moving(client, 0.5, l_shoulder_pan_joint=begin - 1.0)
    message.header.stamp = stamp_of(now + 1.5)
    client.trajectory.publish(message)
    client.wait_until_at(ARM[0], begin - 1.0)
    at = client.joints[-1].name.index(ARM[0])
    halfway = next(s for s in client.joints if s.position[at] < begin - 0.5)
    assert seconds(halfway.header.stamp) == pytest.approx(now + 1.0, abs=0.3)
    assert client.position(ARM[1]) < -1.8


def test_odometry_tells_where_the_base_is_and_how_fast_it_drives(client: SimClient) -> None:
    odometry: list[Odometry] = []
    client.create_subscription(Odometry, "odom", odometry.append, 100)
    client.trajectory.publish(moving(client, 1.0, base_yaw=1.0))
    client.wait_until_at("base_yaw", 1.0)
    before = client.position("base_y")
    client.trajectory.publish(moving(client, 1.0, base_y=before + 0.5))
    client.wait_until_at("base_y", before + 0.5)
    frames = {(message.header.frame_id, message.child_frame_id) for message in odometry}
    assert frames == {("odom", "base_footprint")}
    on_its_way = next(m for m in odometry if m.pose.pose.position.y > before + 0.25)
    speed = on_its_way.twist.twist.linear  # along y of the world, which is turned by 1 rad
    np.testing.assert_allclose([speed.x, speed.y], 0.5 * np.array([np.sin(1), np.cos(1)]), atol=0.1)
    newest = odometry[-1].pose.pose
    assert 2.0 * np.arctan2(newest.orientation.z, newest.orientation.w) == pytest.approx(
        1, abs=0.02
    )
    assert newest.position.y == pytest.approx(before + 0.5, abs=0.02)


def test_a_running_trajectory_is_not_stopped_by_an_empty_one(client: SimClient) -> None:
    client.trajectory.publish(moving(client, 0.5, l_shoulder_pan_joint=0.5))
    client.trajectory.publish(JointTrajectory())
    client.wait_until_at(ARM[0], 0.5)


def test_joints_must_all_be_named_unless_that_is_allowed(client: SimClient) -> None:
    before = client.position(ARM[0])
    client.trajectory.publish(trajectory((0.1, 0.0, -1.0)))
    report = client.graph.wait_for(
        lambda: next((r for r in client.reports if "refused_partial" in r), None)
    )
    assert "joints are missing, base_x, base_y" in report["last"]
    assert client.position(ARM[0]) == pytest.approx(before, abs=0.05)


def test_one_point_where_the_robot_is_stops_all_joints_within_0_2_s(client: SimClient) -> None:
    names, begin = list(client.joints[-1].name), seconds(client.joints[-1].header.stamp)
    target = np.array(client.joints[-1].position) + FAST
    client.trajectory.publish(trajectory((1.0, *target), names=names))
    wait_until(client, begin + 0.5)
    newest = client.joints[-1]
    assert np.abs(newest.velocity).max() > 0.5
    ahead = 0.5 * HOLD_DURATION * np.array(newest.velocity)  # at a constant deceleration
    positions, held = np.array(newest.position) + ahead, seconds(newest.header.stamp)
    client.trajectory.publish(hold_trajectory(positions, names, HOLD_DURATION))
    wait_until(client, held + 0.5)
    assert time_to_rest(client.joints, held) < 0.2
    np.testing.assert_allclose(client.joints[-1].position, positions, atol=5e-3)
