"""The viewer: a web page that shows what is perceived, planned and done, and lets it be done."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectory

from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.node_program import run_node
from kmn_perception.ros.overridable_node import OverridableNode
from kmn_perception.ros.parameters import declare_parameters
from kmn_perception.ros.reports import ThrottledWarnings
from kmn_perception.ros.stamps import NANOSECONDS
from kmn_perception.ros.transforms import TransformListener
from kmn_perception.transforms.transform import TransformError
from kmn_perception.viewer.camera_view import CameraInput, CameraView
from kmn_perception.viewer.controls import write
from kmn_perception.viewer.inputs import Inputs
from kmn_perception.viewer.morphing_panel import MorphingPanel
from kmn_perception.viewer.objects_view import Models, ObjectsView, Perceived, read_object
from kmn_perception.viewer.robot_panel import RobotPanel
from kmn_perception.viewer.skill_panel import SkillPanel
from kmn_perception.viewer.viewer_parameters import ViewerSettings
from kmn_perception.viewer.web_server import WebServer

QUEUE_DEPTH = 10
WATCH_PERIOD = 1.0  # seconds between two looks at who publishes and who looks on
LATEST = 0  # stamp of a look-up


class Viewer(OverridableNode):
    """Takes messages, and draws them as long as a browser looks on.

    Raises
    ------
    ParameterException, ParameterError, ConfigurationError, FileNotFoundError
        If a parameter is wrong.
    OSError
        If the page cannot be served at its address.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("viewer", **options)
        self.settings = settings = ViewerSettings.check(declare_parameters(self, "viewer"))
        page = settings.page
        names = [name.strip() for name in page.server_names.split(",") if name.strip()]
        self._inputs = Inputs(self)
        self._transforms = TransformListener(self, ThrottledWarnings(self))
        self._transforms.listen(True)
        self._models = Models(settings.models)
        self._frame: dict[int, MorphingParameters] = {}
        self._objects: list[Perceived] = []
        self._server = server = WebServer(page.host, page.port, names)
        self.address = server.address
        server.initial_camera.position, server.initial_camera.look_at = page.eye, page.look_at
        server.scene.add_grid("/floor", width=20.0, height=20.0, cell_size=1.0)
        tabs = server.gui.add_tab_group()
        with tabs.add_tab("skill"):
            self._skill = SkillPanel(self, server.gui, settings, self._inputs)
            self._robot = RobotPanel(server, settings, self._find_pose, self._models)
            self._camera_view = CameraView(server, settings, self._find_pose)
        with tabs.add_tab("objects"):
            self._objects_view = ObjectsView(server.scene, server.gui.add_markdown(""))
        with tabs.add_tab("morphing"):
            self._morphing = MorphingPanel(
                server, self._models, list(settings.models), page.morphing_place
            )
        with tabs.add_tab("topics"):
            self._topics = server.gui.add_markdown("")
        self._connect()
        self.get_logger().info(f"the view is at {self.address}")

    def destroy_node(self) -> None:
        """End the page and the node."""
        self._transforms.close()
        self._server.stop()
        super().destroy_node()

    def _connect(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        for kind, topic, take, profile in (
            (MorphingParameters, "morphing_parameters", self._on_parameters, QUEUE_DEPTH),
            (JointState, "joint_states", self._robot.on_states, QUEUE_DEPTH),
            (String, "robot_description", self._robot.on_description, latched),
            (JointTrajectory, "planned_trajectory", self._robot.on_plan, latched),
        ):
            self._listen(kind, topic, take, profile)
        self._camera = CameraInput(self, self._inputs, self.settings)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        drawing = self.settings.drawing
        for period, work in (
            (WATCH_PERIOD, self._watch),
            (1.0 / drawing.rate, self._draw),
            (1.0 / drawing.camera_rate, self._draw_camera),
        ):
            self.create_timer(period, work, clock=steady)

    def _listen(self, kind: Any, topic: str, take: Any, profile: QoSProfile | int) -> None:
        name = self.resolve_topic_name(topic)
        self._inputs.expect(name)

        def on_message(message: Any) -> None:
            self._inputs.hear(name)
            with self._inputs.part(name):
                take(message)

        self.create_subscription(kind, topic, on_message, profile)

    def _on_parameters(self, message: MorphingParameters) -> None:
        """Keep the objects of the newest frame, each of which has a message."""
        others = [each.header.stamp for each in self._frame.values()]
        if any(stamp != message.header.stamp for stamp in others):
            self._frame = {}
        self._frame = {**self._frame, message.id: message}

    def _find_pose(self, frame: str, stamp: int = LATEST) -> NDArray[np.float64]:
        """Return the pose (4, 4) of a frame in the world, at its stamp (ns) or else the latest."""
        world, name = self.settings.world_frame, frame.lstrip("/")
        if name == world:
            return np.eye(4)
        try:
            return self._transforms.lookup(world, name, stamp)
        except TransformError:
            if stamp == LATEST:
                raise
            return self._transforms.lookup(world, name, LATEST)

    @property
    def _is_watched(self) -> bool:
        return bool(self._server.get_clients())

    def _watch(self) -> None:
        """Listen to the camera only as long as somebody looks on, and tell what comes."""
        self._camera.listen(self._is_watched)
        write(self._topics, self._inputs.table())

    def _draw(self) -> None:
        self._skill.update()
        if not self._is_watched:
            return
        with self._inputs.part("objects"):
            self._objects = [self._read(message) for message in self._frame.values()]
            self._objects_view.draw(self._objects)
        with self._inputs.part("robot"):
            self._robot.draw()
        with self._inputs.part("plan"):
            self._robot.draw_plan(self._objects)
        with self._inputs.part("morphing"):
            self._morphing.update(self._objects)

    def _read(self, message: MorphingParameters) -> Perceived:
        stamp = message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec
        pose = self._find_pose(message.header.frame_id, stamp)
        return read_object(message, self._models, pose, self.settings.drawing)

    def _draw_camera(self) -> None:
        if not self._is_watched:
            return
        with self._inputs.part("camera"):
            taken = self._camera.take()
            if taken is not None:
                self._camera_view.draw(*taken, self._objects)


def stand_back(niceness: int) -> None:
    """Let all threads of this process wait for those of others where the processor is busy."""
    for task in Path("/proc/self/task").iterdir():
        os.setpriority(os.PRIO_PROCESS, int(task.name), niceness)


def make_viewer() -> Viewer:
    """Make the node of a process of its own."""
    node = Viewer()
    stand_back(node.settings.niceness)
    return node


def main() -> int:
    """Run the executable ``viewer``; being stopped is its normal end."""
    return run_node("viewer", __doc__, make_viewer)
