"""Reads states of robot and door; of a base without joints odometry or transforms tell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from sensor_msgs.msg import JointState

from kmn_perception.ros.messages import MessageError
from kmn_perception.transforms.transform import TransformError
from kmn_skill.execution.base_motion import EXTRAPOLATED, BaseOdometry
from kmn_skill.execution.states import BASE, DOOR, ROBOT, Sample
from kmn_skill.planning import layout
from kmn_skill.planning.robot import RobotModel
from kmn_skill.ros import messages
from kmn_skill.ros.split_states import SplitStates

Names = tuple[str, ...]


class StateReader:
    """Turns messages into the samples that are watched.

    Parameters
    ----------
    robot
        Whose states they are.
    door
        Names of the door's joints, if somebody measures them.
    base_pose
        Returns where a base that is fixed stands (4, 4); raises ``TransformError`` if that is not
        known.

    Attributes
    ----------
    joints
        Names of the joints of each topic's samples.
    odometry
        Of a base that takes velocities.
    """

    def __init__(
        self,
        robot: RobotModel,
        door: Names,
        base_pose: Callable[[], NDArray[np.float64]],
    ) -> None:
        self._split, self.odometry = SplitStates(robot.told_names), BaseOdometry()
        self._base_pose, self._is_fixed = base_pose, robot.is_fixed
        self.joints: dict[str, Names] = {}
        if robot.takes_velocities:  # first: without it the robot's state is not known either
            self.joints[BASE] = robot.joint_names[layout.BASE]
        self.joints[ROBOT] = robot.joint_names
        if door:
            self.joints[DOOR] = door

    def read(self, topic: str, message: JointState | Odometry) -> Sample | None:
        """Return the sample of a message; None if odometry of about its time is missing.

        Raises
        ------
        MessageError
            If a joint is missing, a number not finite, or not known where a fixed base stands.
        """
        if isinstance(message, Odometry):
            motion = messages.motion_from_odometry(message)
            self.odometry.put(motion)
            return Sample(motion.time, motion.pose)
        if topic != ROBOT:
            return messages.sample_from_state(message, self.joints[topic])
        sample, newest = self._split.join(message), self.odometry.newest
        if self._is_fixed:
            return sample._replace(positions=np.concatenate([self._standing(), sample.positions]))
        if BASE not in self.joints:
            return sample
        if newest is None or abs(sample.time - newest.time) > EXTRAPOLATED:
            return None
        return Sample(sample.time, np.concatenate([newest.at(sample.time), sample.positions]))

    def _standing(self) -> NDArray[np.float64]:
        """Return x, y and yaw (3,) of a base that is fixed."""
        try:
            pose = self._base_pose()
        except TransformError as error:
            raise MessageError(
                "base_pose", f"where the base stands is not known: {error}"
            ) from error
        return np.array([*pose[:2, 3], np.arctan2(pose[1, 0], pose[0, 0])])
