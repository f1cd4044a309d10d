"""A base that takes velocities: in the simulator, and under a robot that opens a door."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rclpy.parameter import Parameter

from kmn_perception.configuration import resources
from kmn_perception.configuration.node_parameters import ParameterError
from kmn_perception.ros.stamps import seconds

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import PATIENT, SPEED, TrueDoorClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402
from sim_client import STILL  # noqa: E402

BASE = ["base_x", "base_y", "base_yaw"]
RELAYED = "relayed_odom"  # which a test may hold back
# Who misses odometry first: what drives the base, or what watches the states.
STOPPED = ("the controller 'base' was stopped: odometry is", "odom stopped", "odom is")
CALM = 1.0  # a slow pace: where odometry comes late on a busy machine, it is off by its delay


def write_robot(folder: Path, robot: str = "pr2", **changes: Any) -> Path:
    """Write a robot's file whose base takes velocities, and its motions beside it."""
    values = yaml.safe_load(resources.find("config/robots", robot).read_text())
    values["controllers"]["base"].update(type="velocity", name="cmd_vel", **changes)
    file = folder / "robot.yaml"
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    motions = resources.find("config/skill/prototypes", f"{robot}/door", ".json")
    file.with_suffix("").mkdir()
    shutil.copy(motions, file.with_suffix(""))
    return file


class BaseClient(TrueDoorClient):
    """Drives the base, and passes odometry on as long as it should."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        self.velocity = self.create_publisher(Twist, "cmd_vel", 10)
        self.odometry: list[Odometry] = []
        self.tells_odometry = True
        self._odometry = self.create_publisher(Odometry, RELAYED, 1)
        self.create_subscription(Odometry, "odom", self._on_odometry, 1)  # the newest

    def _on_odometry(self, message: Odometry) -> None:
        self.odometry.append(message)
        if self.tells_odometry:
            self._odometry.publish(message)

    def base(self) -> np.ndarray[Any, Any]:
        """Wait for odometry; return time, x, y and yaw, and the speeds ahead, left, of the turn."""
        self.odometry.clear()
        message = self.graph.wait_for(lambda: self.odometry)[-1]
        pose, twist = message.pose.pose, message.twist.twist
        yaw = 2.0 * math.atan2(pose.orientation.z, pose.orientation.w)
        where = (seconds(message.header.stamp), pose.position.x, pose.position.y, yaw)
        return np.array([*where, twist.linear.x, twist.linear.y, twist.angular.z])

    def drive(self, x: float = 0.0, y: float = 0.0, turn: float = 0.0) -> None:
        twist = Twist()
        twist.linear.x, twist.linear.y, twist.angular.z = x, y, turn
        self.velocity.publish(twist)


@pytest.fixture(scope="module")
def system(graph: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[BaseClient]:
    robot = str(write_robot(tmp_path_factory.mktemp("robot")))
    made = graph.start(lambda **_: BaseClient(graph))
    made.start_simulator(robot=robot)
    given = {
        **PATIENT,
        "odometry_timeout": 0.5 * SPEED,
        "control": "action",
        "use_sim_time": True,
        "robot": robot,
    }
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    arguments = ["--ros-args", "-r", f"odom:={RELAYED}"]
    graph.start(SkillNode, parameter_overrides=overrides, cli_args=arguments)
    try:
        assert made.action.wait_for_server(30.0)
        made.graph.wait_for(lambda: made.perceived)
        yield made
    finally:
        made.stop_simulator()


def test_joint_states_have_no_joints_of_such_a_base(system: BaseClient) -> None:
    assert not set(BASE) & set(system.joints[-1].name)
    assert len(system.joints[-1].name) == 8


def test_a_simulated_base_drives_as_it_is_told_and_stops_when_nothing_comes(
    system: BaseClient,
) -> None:
    system.start_anew()
    with system.pace(0.5):
        since = system.base()
        system.drive(0.3, -0.2, 0.4)
        system.graph.wait_for(lambda: abs(system.base()[4:] - [0.3, -0.2, 0.4]).max() < STILL)
        system.drive(9.0)
        system.graph.wait_for(lambda: system.base()[4] > 0.95)
        assert system.base()[4] == pytest.approx(1.0, abs=STILL)
        system.graph.wait_for(lambda: abs(system.base()[4:]).max() < STILL)
        assert system.base()[0] - since[0] < 4.0
        driven = system.base()[1:3] - since[1:3]
        assert driven[0] > 0.3


def test_a_velocity_that_is_not_finite_is_refused_and_counted(system: BaseClient) -> None:
    before = system.base()
    system.log.clear()
    system.drive(math.nan)
    system.graph.wait_for(lambda: [text for text in system.log if "velocity refused" in text])
    assert "not_finite" in next(text for text in system.log if "velocity refused" in text)
    assert system.base()[1:4] == pytest.approx(before[1:4], abs=0.01)


def test_a_door_is_opened_by_a_base_that_takes_velocities(system: BaseClient) -> None:
    with system.pace(CALM):
        system.assert_it_opens()
    assert not system.sent


def test_a_goal_that_is_cancelled_stops_the_base(system: BaseClient) -> None:
    system.start_anew()
    with system.pace(CALM):
        handle = system.send()
        system.wait_for_phase("reach", 0.2)
    with system.pace(0.3):
        since = system.base()
        assert abs(since[4:6]).max() > 5.0 * STILL
        system.wait(handle.cancel_goal_async())
        system.graph.wait_for(lambda: abs(system.base()[4:]).max() < STILL)
        assert system.base()[0] - since[0] < 0.4
    assert system.result(handle)[0] == GoalStatus.STATUS_CANCELED


def test_odometry_that_stops_ends_the_goal_and_the_next_one_is_served(system: BaseClient) -> None:
    system.start_anew()
    with system.pace(CALM):
        handle = system.send()
        system.wait_for_phase("reach", 0.2)
        system.tells_odometry = False
        status, result = system.result(handle)
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert result.reason.startswith(STOPPED)
    system.graph.wait_for(lambda: abs(system.base()[4:]).max() < STILL)
    assert system.fail().startswith(STOPPED)
    system.tells_odometry = True
    with system.pace(CALM):
        system.assert_it_opens()


def test_a_robot_whose_base_takes_velocities_has_no_trajectory_of_all_joints(
    graph: Any, tmp_path: Path
) -> None:
    overrides = [Parameter("robot", value=str(write_robot(tmp_path)))]
    with pytest.raises(ParameterError, match="'control' must be action for a robot whose base"):
        SkillNode(context=graph.context, parameter_overrides=overrides)
