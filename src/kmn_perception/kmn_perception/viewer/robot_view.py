"""The robot as it stands, and where a plan will take it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser
from numpy.typing import NDArray
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.model.transformation import rotation_z
from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.stamps import seconds
from kmn_perception.viewer.drawing import Rgb, wxyz
from kmn_perception.viewer.robot_description import RobotDescription

BASE = 3  # the first joints of a plan: x, y and yaw of the base


class RobotView:
    """Draws one robot.

    Parameters
    ----------
    root
        Name of its node in the scene.
    tint, opacity
        In the place of its own colours.
    """

    def __init__(
        self,
        scene: viser.SceneApi,
        root: str,
        tint: Rgb | None = None,
        opacity: float | None = None,
    ) -> None:
        self._scene, self._root, self._tint, self._opacity = scene, root, tint, opacity
        self._frames: dict[str, Any] = {}

    def build(self, robot: RobotDescription) -> None:
        """Make its parts, in the place of another robot's."""
        self._scene.add_frame(self._root, show_axes=False)
        for frame in self._frames.values():
            frame.remove()
        self._frames = {
            link: self._scene.add_frame(f"{self._root}/{link}", show_axes=False)
            for link in {visual.link for visual in robot.visuals}
        }
        for number, visual in enumerate(robot.visuals):
            self._scene.add_mesh_simple(
                f"{self._root}/{visual.link}/{number}",
                visual.vertices,
                visual.faces,
                color=self._tint or visual.colour,
                opacity=self._opacity,
                side="double",
                cast_shadow=False,
            )

    def place(self, poses: Mapping[str, NDArray[np.float64]], base: NDArray[np.float64]) -> None:
        """Move its links to poses (4, 4) in a frame that is at a pose (4, 4) in the world."""
        for link, frame in self._frames.items():
            pose = base @ poses[link]
            frame.wxyz, frame.position = wxyz(pose[:3, :3]), pose[:3, 3]
            frame.visible = True

    def hide(self) -> None:
        """Show it no more."""
        for frame in self._frames.values():
            frame.visible = False


class Trajectory:
    """A plan: where robot and object are at each time.

    Attributes
    ----------
    duration
        Of the motion, seconds.

    Raises
    ------
    MessageError
        If the message's numbers are not those of its joints, or not in the order of time.
    """

    def __init__(self, message: JointTrajectory) -> None:
        self._names = tuple(message.joint_names)
        self._times = np.array([seconds(point.time_from_start) for point in message.points])
        places = [tuple(point.positions) for point in message.points]
        if not places or {len(place) for place in places} != {len(self._names)}:
            raise MessageError("plan", "the plan has no points, or not a position of each joint")
        self._places = np.array(places, dtype=np.float64)
        if len(self._names) <= BASE or not np.isfinite(self._places).all():
            raise MessageError("plan", "the plan has no base, or positions that are not finite")
        if (np.diff(self._times) <= 0.0).any():
            raise MessageError("plan", "the times of the plan are not in order")
        self.duration = float(self._times[-1])

    def at(self, time: float) -> tuple[NDArray[np.float64], dict[str, float]]:
        """Return the pose (4, 4) of the base, and the other joints' positions, at a time (s)."""
        places = [float(np.interp(time, self._times, column)) for column in self._places.T]
        x, y, yaw = places[:BASE]
        base = np.eye(4)
        base[:3, :3], base[:2, 3] = rotation_z(np.array(yaw)), (x, y)
        return base, dict(zip(self._names[BASE:], places[BASE:], strict=True))
