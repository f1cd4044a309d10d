"""States of the robot as robots tell them: in any order, of more joints, of wheels by odometry."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from kmn_perception.model.transformation import rotation_z
from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.stamps import stamp_of
from kmn_perception.transforms.transform import TransformError
from kmn_skill.execution.states import BASE, DOOR, ROBOT
from kmn_skill.planning.robot import RobotModel
from kmn_skill.ros.state_reading import StateReader

PR2 = RobotModel.load("pr2")
WHEELS = PR2.controllers["base"]._replace(type="velocity", name="cmd_vel")
ON_WHEELS = replace(PR2, controllers={**PR2.controllers, "base": WHEELS})
ON_PEDESTAL = replace(
    PR2,
    base=PR2.base._replace(kind="fixed"),
    controllers={name: each for name, each in PR2.controllers.items() if name != "base"},
)
NAMES, HOME = PR2.joint_names, PR2.home.tolist()


def reader_of(
    robot: RobotModel, door: tuple[str, ...] = (), base: NDArray[np.float64] | None = None
) -> StateReader:
    """Return the reader of a robot whose base stands at a pose, or nobody knows where."""

    def pose() -> NDArray[np.float64]:
        if base is None:
            raise TransformError("unknown_frame", "nobody knows 'base_footprint'")
        return base

    return StateReader(robot, door, pose)


def told(positions: dict[str, float], time: float = 5.0) -> JointState:
    message = JointState(name=list(positions), position=list(positions.values()))
    message.header.stamp = stamp_of(time)
    return message


def odometry(x: float, y: float, yaw: float, speed: float = 0.0, time: float = 5.0) -> Odometry:
    message = Odometry(child_frame_id="base_link")
    message.header.stamp = stamp_of(time)
    message.pose.pose.position.x, message.pose.pose.position.y = x, y
    turn = message.pose.pose.orientation
    turn.z, turn.w = math.sin(yaw / 2.0), math.cos(yaw / 2.0)
    message.twist.twist.linear.x = speed
    return message


def test_joints_may_come_in_any_order_and_with_foreign_ones() -> None:
    positions = dict(zip(NAMES, HOME, strict=True))
    shuffled = {"head": math.nan, **dict(reversed(positions.items())), "torso": 0.2}
    sample = reader_of(PR2).read(ROBOT, told(shuffled))
    assert sample is not None
    assert sample.time == 5.0
    assert sample.positions == pytest.approx(PR2.home)


def test_a_state_may_come_in_messages_of_several_publishers() -> None:
    """Its time is that of the oldest; what is older than that is not of this state any more."""
    reader = reader_of(PR2)
    base = dict(zip(NAMES[:3], HOME[:3], strict=True))
    arm = dict(zip(NAMES[3:], HOME[3:], strict=True))
    with pytest.raises(MessageError, match="the state lacks the joints base_x, base_y, base_yaw"):
        reader.read(ROBOT, told(arm, 5.0))
    for number in range(3):
        sample = reader.read(ROBOT, told({**base, "base_x": 0.1 * number}, 5.02 + 0.02 * number))
        assert sample is not None
        assert sample.time == 5.0
        assert sample.positions == pytest.approx([0.1 * number, *HOME[1:]])
    with pytest.raises(MessageError, match="the state lacks the joints l_"):
        reader.read(ROBOT, told(base, 5.2))
    sample = reader.read(ROBOT, told(arm, 5.21))
    assert sample is not None
    assert sample.time == 5.2


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"l_elbow_flex_joint": math.nan}, "positions are not finite"),
        ({"base_x": math.inf}, "positions are not finite"),
        ({"l_elbow_flex_joint": None}, "the state lacks the joints l_elbow_flex_joint"),
    ],
)
def test_a_state_that_is_not_whole_is_refused(changes: dict[str, Any], text: str) -> None:
    positions = {**dict(zip(NAMES, HOME, strict=True)), **changes}
    message = told({name: value for name, value in positions.items() if value is not None})
    with pytest.raises(MessageError, match=text):
        reader_of(PR2).read(ROBOT, message)


def test_as_many_positions_as_names_are_expected() -> None:
    message = told(dict(zip(NAMES, HOME, strict=True)))
    message.position = HOME[:-1]
    with pytest.raises(MessageError, match="found 10 positions of 11 joints"):
        reader_of(PR2).read(ROBOT, message)


def test_where_a_base_on_wheels_is_odometry_tells() -> None:
    reader = reader_of(ON_WHEELS, ("hinge", "handle"))
    assert list(reader.joints) == [BASE, ROBOT, DOOR]
    joints = dict(zip(NAMES[3:], HOME[3:], strict=True))
    assert reader.read(ROBOT, told(joints)) is None  # nobody told where it is
    base = reader.read(BASE, odometry(1.0, 2.0, math.pi / 2.0, speed=0.5))
    assert base is not None
    assert base.positions == pytest.approx([1.0, 2.0, math.pi / 2.0])
    sample = reader.read(ROBOT, told({**joints, "base_x": 9.0}, 5.04))
    assert sample is not None
    assert sample.positions == pytest.approx([1.0, 2.02, math.pi / 2.0, *HOME[3:]])
    assert reader.read(ROBOT, told(joints, 5.2)) is None  # where the base is now is not known


def test_odometry_that_is_not_finite_is_refused_and_the_one_before_remains() -> None:
    reader = reader_of(ON_WHEELS)
    reader.read(BASE, odometry(1.0, 2.0, 0.5))
    with pytest.raises(MessageError, match="numbers are not finite"):
        reader.read(BASE, odometry(math.nan, 2.0, 0.5))
    newest = reader.odometry.newest
    assert newest is not None
    np.testing.assert_allclose(newest.pose, [1.0, 2.0, 0.5])


def test_where_a_base_stands_that_is_fixed_transforms_tell() -> None:
    joints = told(dict(zip(NAMES[3:], HOME[3:], strict=True)))
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_z(np.array(0.4)), (1.0, 2.0, 0.3)
    sample = reader_of(ON_PEDESTAL, base=pose).read(ROBOT, joints)
    assert sample is not None
    assert sample.positions == pytest.approx([1.0, 2.0, 0.4, *HOME[3:]])
    with pytest.raises(MessageError, match="where the base stands is not known: nobody knows"):
        reader_of(ON_PEDESTAL).read(ROBOT, joints)
