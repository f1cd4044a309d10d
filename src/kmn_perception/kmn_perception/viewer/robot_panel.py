"""The robot in the view, its plan as a ghost, and the slider of the plan's time."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import viser
from numpy.typing import NDArray
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from kmn_perception.ros.messages import MessageError
from kmn_perception.transforms.transform import TransformError
from kmn_perception.viewer.controls import move
from kmn_perception.viewer.drawing import Drawing, colour
from kmn_perception.viewer.objects_view import Models, Perceived
from kmn_perception.viewer.robot_description import RobotDescription
from kmn_perception.viewer.robot_view import RobotView, Trajectory
from kmn_perception.viewer.viewer_parameters import ViewerSettings
from kmn_perception.visualization.overlay import OBJECT

GHOST = 0.35  # opacity
STEP = 0.05  # seconds of the slider


class RobotPanel:
    """Keeps what is told of the robot, and draws it.

    Parameters
    ----------
    find_pose
        Returns the latest pose (4, 4) of a frame in the world.
    models
        Of the objects that a plan moves.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        settings: ViewerSettings,
        find_pose: Callable[[str], NDArray[np.float64]],
        models: Models,
    ) -> None:
        self._settings, self._find_pose, self._models = settings, find_pose, models
        self._view = RobotView(server.scene, "/robot")
        self._ghost = RobotView(server.scene, "/plan/robot", colour(OBJECT), GHOST)
        self._ghost_object = Drawing(server.scene, "/plan/object")
        self._robot: RobotDescription | None = None
        self._positions: dict[str, float] = {}
        self._plan: Trajectory | None = None
        self._planned_for: Perceived | None = None
        self._shows_plan = server.gui.add_checkbox("show the plan", initial_value=True)
        self._time = server.gui.add_slider(
            "time of the plan [s]", min=0.0, max=1.0, step=STEP, initial_value=0.0, disabled=True
        )

    def on_description(self, message: String) -> None:
        """Take another robot; raises ``RobotDescriptionError`` if it is none."""
        robot = RobotDescription.parse(message.data)
        self._view.build(robot)
        self._ghost.build(robot)
        self._ghost.hide()
        self._robot = robot

    def on_states(self, message: JointState) -> None:
        """Take where joints are; raises `MessageError` if that is not told of each."""
        if len(message.name) != len(message.position) or not np.isfinite(message.position).all():
            raise MessageError("lengths", "joint_states has not a finite position of each joint")
        self._positions.update(zip(message.name, message.position, strict=True))

    def on_plan(self, message: JointTrajectory) -> None:
        """Take a plan; raises `MessageError` if it is none."""
        self._plan, self._planned_for = Trajectory(message), None
        self._time.max = max(STEP, self._plan.duration)
        self._time.disabled = False
        move(self._time, self._plan.duration)

    def draw(self) -> None:
        """Draw the robot where it is.

        Raises
        ------
        TransformError
            If nobody tells where; it stands in the origin then.
        MessageError
            If parts of it cannot be drawn.
        """
        if self._robot is None:
            return
        poses = self._robot.poses(self._positions)
        try:
            self._view.place(poses, self._find_pose(self._robot.root))
        except TransformError:
            self._view.place(poses, np.eye(4))
            raise
        if self._robot.missing:
            raise MessageError("robot", f"not drawn: {'; '.join(self._robot.missing)}")

    def draw_plan(self, objects: Sequence[Perceived]) -> None:
        """Draw robot and object at the slider's time of the plan.

        Parameters
        ----------
        objects
            What is perceived at present: of it, the object that a new plan is for.
        """
        if self._plan is None or self._robot is None or not self._shows_plan.value:
            self._ghost.hide()
            self._ghost_object.keep(set())
            return
        base, positions = self._plan.at(self._time.value)
        poses = self._robot.poses({**self._positions, **positions})
        if self._settings.base_frame not in poses:
            raise MessageError("plan", f"the robot has no link '{self._settings.base_frame}'")
        self._ghost.place(poses, base @ np.linalg.inv(poses[self._settings.base_frame]))
        if self._planned_for is None:
            self._planned_for = next((o for o in objects if o.holds and len(o.cubes)), None)
        if self._planned_for is not None:
            found = self._planned_for
            model = self._models.load(found.message.model)
            cubes = model.moved_cubes(found.values, positions)
            axes = model.cylinder_axes
            self._ghost_object.bodies("door", cubes, axes, colour(OBJECT), GHOST)
