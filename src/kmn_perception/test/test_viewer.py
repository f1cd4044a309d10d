"""The parts of the live view without a browser: shapes, robots, the server's check of origins."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Origin, Subprotocol

from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.stamps import duration_of

viser = pytest.importorskip("viser")
from kmn_perception.viewer.robot_description import (  # noqa: E402
    RobotDescription,
    RobotDescriptionError,
)
from kmn_perception.viewer.robot_view import Trajectory  # noqa: E402
from kmn_perception.viewer.shapes import corners, uncertain_shapes  # noqa: E402
from kmn_perception.viewer.web_server import WebServer, is_own_page  # noqa: E402

ARM = """<robot name="arm">
  <link name="foot"/>
  <link name="column"><visual><origin xyz="0 0 0.5"/><geometry><box size="0.2 0.2 1"/></geometry>
    <material name="red"><color rgba="1 0 0 1"/></material></visual></link>
  <link name="hand"><visual><geometry><mesh filename="file://{mesh}"/></geometry></visual></link>
  <link name="thumb"/>
  <joint name="turn" type="revolute"><parent link="foot"/><child link="column"/>
    <origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 1"/></joint>
  <joint name="lift" type="prismatic"><parent link="column"/><child link="hand"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 2"/></joint>
  <joint name="thumb" type="prismatic"><parent link="hand"/><child link="thumb"/>
    <axis xyz="1 0 0"/><mimic joint="lift" multiplier="-2" offset="0.1"/></joint>
</robot>"""


def test_a_robot_stands_as_its_joints_say_and_lacks_only_what_cannot_be_read() -> None:
    robot = RobotDescription.parse(ARM.format(mesh="/nowhere/hand.obj"))
    poses = robot.poses({"turn": np.pi / 2.0, "lift": 0.3})
    # By hand: two quarter turns make column and hand face backwards.
    np.testing.assert_allclose(poses["hand"][:3, 3], [0.5, 0.0, 0.3], atol=1e-12)
    np.testing.assert_allclose(poses["thumb"][:3, 3], [0.5 + 0.5, 0.0, 0.3], atol=1e-12)
    (column,) = robot.visuals
    assert (column.link, column.colour) == ("column", (255, 0, 0))
    np.testing.assert_allclose([column.vertices[:, 2].min(), column.vertices[:, 2].max()], [0, 1])
    (missing,) = robot.missing
    assert missing == "hand: there is no file /nowhere/hand.obj"


def test_a_mesh_is_read_from_its_file(tmp_path: Path) -> None:
    mesh = tmp_path / "a hand.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nf 1 2 3\n")
    robot = RobotDescription.parse(ARM.format(mesh=str(mesh).replace(" ", "%20")))
    hand = next(visual for visual in robot.visuals if visual.link == "hand")
    assert hand.vertices.max(axis=0).tolist() == [1.0, 2.0, 0.0]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("no xml", "is no XML"),
        ("<robot/>", "one root, found"),
        ("<robot><link name='a'/><joint name='j'><child link='b'/></joint></robot>", "no parent"),
        ("<robot><link name='a'/><link name='b'/></robot>", r"found \['a', 'b'\]"),
    ],
)
def test_what_is_no_robot_is_refused_with_its_reason(text: str, told: str) -> None:
    with pytest.raises(RobotDescriptionError, match=told):
        RobotDescription.parse(text)


def trajectory(*places: list[float]) -> JointTrajectory:
    points = [
        JointTrajectoryPoint(positions=each, time_from_start=duration_of(2.0 * number))
        for number, each in enumerate(places)
    ]
    return JointTrajectory(joint_names=["x", "y", "yaw", "arm"], points=points)


def test_a_plan_is_where_it_should_be_between_its_points() -> None:
    plan = Trajectory(trajectory([0.0, 0.0, 0.0, 1.0], [2.0, 1.0, np.pi, 3.0]))
    base, positions = plan.at(1.0)
    np.testing.assert_allclose(base[:3, 3], [1.0, 0.5, 0.0])
    np.testing.assert_allclose(base[:3, 0], [0.0, 1.0, 0.0], atol=1e-12)
    assert positions == {"arm": 2.0}
    assert plan.duration == 4.0 / 2.0
    for wrong in (trajectory(), trajectory([0.0]), trajectory([np.nan] * 4)):
        with pytest.raises(MessageError):
            Trajectory(wrong)


def test_uncertain_extents_are_those_of_drawn_parameters() -> None:
    """The spread of each corner, against samples of the parameters' distribution."""
    model, generator = KinematicModel.load("door"), np.random.default_rng(0)
    count = len(model.parameters)
    deviations = np.full(count, 1e-5)
    deviations[[0, 3]] = 0.05, 0.04  # x, and the height
    covariance = np.diag(deviations**2)

    def bodies(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return model.moved_cubes(values, {})

    found = uncertain_shapes(bodies, model.prototype, covariance, model.limits, 1.0, 0.02)
    assert len(found) == 4  # both ends of two directions
    middle = corners(bodies(model.prototype))
    spread = np.sqrt(sum((corners(each) - middle) ** 2 for each in found) / 2.0)
    drawn = generator.multivariate_normal(model.prototype, covariance, 4000)
    sampled = np.std([corners(bodies(each)) for each in drawn], axis=0)
    np.testing.assert_allclose(spread, sampled, atol=0.002)


def test_uncertain_extents_do_not_leave_the_limits_and_need_a_covariance() -> None:
    model = KinematicModel.load("door")
    count = len(model.parameters)

    def bodies(values: NDArray[np.float64]) -> NDArray[np.float64]:
        assert ((values >= model.limits[:, 0] - 1e-4) & (values <= model.limits[:, 1] + 1e-4)).all()
        return model.moved_cubes(values, {})

    wide = np.diag(np.full(count, 100.0))
    assert uncertain_shapes(bodies, model.prototype, wide, model.limits, 2.0, 0.02)
    unknown = np.full((count, count), np.nan)
    assert uncertain_shapes(bodies, model.prototype, unknown, model.limits, 2.0, 0.02) == []


@pytest.mark.parametrize(
    ("origin", "host", "own"),
    [
        ("http://127.0.0.1:8080", "127.0.0.1:8080", True),
        ("http://localhost:9000", "localhost:9000", True),  # a tunnel
        ("http://[::1]:8080", "[::1]:8080", True),
        ("https://robot:8080", "robot:8080", True),
        ("http://127.0.0.1:9999", "127.0.0.1:8080", False),  # of another server of this machine
        ("http://evil.example", "127.0.0.1:8080", False),
        ("http://evil.example:8080", "evil.example:8080", False),  # rebinding
        ("http://localhost.evil.example:8080", "localhost.evil.example:8080", False),
        ("null", "127.0.0.1:8080", False),
        ("", "127.0.0.1:8080", False),
        ("http://[", "[", False),
    ],
)
def test_only_pages_of_the_server_are_its_own(origin: str, host: str, own: bool) -> None:
    assert is_own_page(origin, host, ["robot"]) is own


@pytest.fixture(scope="module")
def server() -> Iterator[WebServer]:
    started = WebServer("127.0.0.1", 0)
    yield started
    started.stop()


def test_a_websocket_is_open_to_the_page_and_to_no_other(server: WebServer) -> None:
    address = server.address.replace("http", "ws")
    protocol = [Subprotocol(f"viser-v{viser.__version__}")]
    with connect(address, origin=Origin(server.address), subprotocols=protocol) as own:
        assert own.recv(timeout=10.0)
    for foreign in (Origin("http://evil.example"), None):
        with pytest.raises(InvalidStatus, match="403"):
            connect(address, origin=foreign, subprotocols=protocol)


def test_an_address_where_nobody_can_listen_is_refused(server: WebServer) -> None:
    for host, port in (("127.0.0.1", server.get_port()), ("192.0.2.1", 0)):
        with pytest.raises(OSError, match=f"cannot listen at {host}"):
            WebServer(host, port)
