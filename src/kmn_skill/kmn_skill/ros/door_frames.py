"""Takes doors that are given in other frames into the robot's, as soon as transforms tell how."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from numpy.typing import NDArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node

from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.ros.stamps import NANOSECONDS
from kmn_perception.ros.transforms import TransformListener
from kmn_perception.transforms.transform import TransformError
from kmn_skill.execution.door_in_frame import FrameSettings, door_in_frame
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.errors import DoorError
from kmn_skill.ros.skill_node_parameters import SkillNodeSettings

RETRY_PERIOD = 0.02  # seconds
MAX_WAITING = 100


class _Waiting(NamedTuple):
    observation: DoorObservation
    stamp: int  # of it, nanoseconds: as seconds it would not be that of any transform
    since: float  # seconds of the monotonic clock


class DoorFrames:
    """Hands observations on in their order, in the robot's frame.

    One whose transform does not come in time is handed on with that problem.

    Parameters
    ----------
    node, warnings
        Who listens to transforms, which is begun where a door needs one.
    settings
        Of skill_node; may be replaced.
    use
        Takes the observations.
    """

    def __init__(
        self,
        node: Node,
        warnings: ThrottledWarnings,
        settings: SkillNodeSettings,
        use: Callable[[DoorObservation], None],
    ) -> None:
        self.settings, self._use, self._limits = settings, use, FrameSettings.load()
        self._frame = settings.world_frame  # which does not change
        self._listener = TransformListener(node, warnings)
        self._waiting: deque[_Waiting] = deque(maxlen=MAX_WAITING)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = node.create_timer(RETRY_PERIOD, self._hand_on, clock=steady)
        self._timer.cancel()

    def take(self, observation: DoorObservation, stamp: Time) -> None:
        """Take an observation of a stamp in any frame."""
        if self._is_elsewhere(observation):
            self._listener.listen(True)
        elif not self._waiting:
            self._use(observation)
            return
        nanoseconds = stamp.sec * NANOSECONDS + stamp.nanosec
        self._waiting.append(_Waiting(observation, nanoseconds, time.monotonic()))
        self._hand_on()

    def base_pose(self) -> NDArray[np.float64]:
        """Return the pose (4, 4) of a base that stands; raise ``TransformError`` if unknown."""
        self._listener.listen(True)
        return self._listener.lookup(self._frame, self.settings.base_frame, 0)

    def turned(self, force: NDArray[np.float64], frame: str) -> NDArray[np.float64]:
        """Return a force (3,) of any frame in the robot's; raise ``MessageError`` if unknown."""
        if frame.lstrip("/") == self._frame:
            return force
        self._listener.listen(True)
        try:
            turn = self._listener.lookup(self._frame, frame.lstrip("/"), 0)[:3, :3]
        except TransformError as error:
            raise MessageError(
                "force_frame",
                f"the force is given in '{frame}', and where that is in '{self._frame}' is not "
                f"known: {error}",
            ) from error
        turned: NDArray[np.float64] = turn @ force
        return turned

    def _is_elsewhere(self, observation: DoorObservation) -> bool:
        """Tell whether an observation is of use, but in another frame."""
        is_of_use = not observation.problem or observation.lacks_handle
        return is_of_use and observation.frame != self._frame

    def _hand_on(self) -> None:
        while self._waiting:
            observation, stamp, since = self._waiting[0]
            if self._is_elsewhere(observation):
                try:
                    observation = self._in_robots_frame(observation, stamp)
                except (DoorError, TransformError) as error:
                    is_late = time.monotonic() - since >= self.settings.transform_delay
                    if isinstance(error, TransformError) and not is_late:
                        break
                    problem = (
                        f"the door is given in '{observation.frame}', and where that is in "
                        f"'{self._frame}' is not known: {error}"
                    )
                    observation = observation._replace(problem=problem, lacks_handle=False)
            self._waiting.popleft()
            self._use(observation)
        if self._waiting:
            self._timer.reset()
        else:
            self._timer.cancel()

    def _in_robots_frame(self, observation: DoorObservation, stamp: int) -> DoorObservation:
        pose = self._listener.lookup(self._frame, observation.frame.lstrip("/"), stamp)
        return door_in_frame(self.settings.model, observation, self._frame, pose, self._limits)
