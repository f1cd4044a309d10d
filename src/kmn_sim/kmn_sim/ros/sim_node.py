"""The node of the simulated world: robot, door or box, and depth camera behind topics."""

from __future__ import annotations

import time
import traceback
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import SENSORS, NoisySensor
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import cloud_from_points, image_from_depth, info_from_camera
from kmn_perception.ros.node_program import run_node
from kmn_perception.ros.parameters import declare_parameters, read_parameters
from kmn_perception.ros.reports import ThrottledWarnings, report_periodically
from kmn_perception.ros.stamps import stamp_of
from kmn_sim.control.trajectory import TrajectoryError
from kmn_sim.ros import messages
from kmn_sim.ros.sim_node_parameters import RECORDING, SENSOR, WORLD, SimNodeSettings
from kmn_sim.ros.simulation_statistics import SimulationStatistics
from kmn_sim.sensors.depth_camera import DepthCamera
from kmn_sim.sensors.recording import RecordingError
from kmn_sim.sensors.recordings import Recordings
from kmn_sim.sensors.settings import RecordingSettings
from kmn_sim.world.runner import Runner
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation

CLOCK_PERIOD = 0.01  # simulated seconds between two messages on /clock
QUEUE_DEPTH = 10


class SimNode(Node):
    """Runs the simulation in a thread of its own; the executor only takes messages.

    Raises
    ------
    ParameterException, ParameterError, ScenarioError
        If a parameter is wrong.
    OSError, ConfigurationError
        If the robot's model or a configuration cannot be loaded.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("sim_node", **options)
        self._settings = settings = SimNodeSettings.check(declare_parameters(self, "sim_node"))
        self._world = WorldSettings.load()
        self._depth_camera = self._make_camera(settings)
        self._statistics = SimulationStatistics(self._world.robot.names)
        self._warnings = ThrottledWarnings(self)
        self._connect()
        self._runner = Runner(self._make_simulation, self._on_failure)
        self._runner.real_time_factor = settings["real_time_factor"]
        if settings["publish_clock"]:
            self._runner.every(CLOCK_PERIOD, self._publish_clock)
        self._states_task = self._runner.every(
            1.0 / settings["joint_state_rate"], self._publish_states
        )
        self._camera_task = self._runner.every(1.0 / settings["camera_rate"], self._publish_camera)
        self._recordings = Recordings(
            self._runner, RecordingSettings.load(), self._on_lost_recording
        )
        self._runner.start()
        try:
            recorder = self._recordings.prepare(settings["record"], settings["record_rate"])
            self._recordings.exchange(recorder, settings["record_rate"])
        except RecordingError:
            self._runner.close()
            raise
        self._renderer = renderer = self._runner.call(lambda simulation: simulation.renderer.name)
        if renderer != settings["renderer"]:
            self.get_logger().warning(
                f"renderer '{settings['renderer']}' does not start; rendering by '{renderer}'"
            )
        self.create_subscription(
            JointTrajectory, "joint_trajectory", self._on_trajectory, QUEUE_DEPTH
        )
        self.create_service(Trigger, "reset", self._on_reset)
        self.add_on_set_parameters_callback(self._on_parameters)
        report_periodically(self, self._report)
        self.get_logger().info(f"simulating model '{settings['model']}', depth by '{renderer}'")

    def destroy_node(self) -> None:
        """End the simulation's thread and the node."""
        self._runner.close()
        self._recordings.close()
        super().destroy_node()

    def _connect(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        if self._settings["publish_clock"]:  # /clock is one for all nodes
            self._clock_publisher = self.create_publisher(ClockMessage, "/clock", QUEUE_DEPTH)
        self._joint_publisher = self.create_publisher(JointState, "joint_states", QUEUE_DEPTH)
        self._door_publisher = self.create_publisher(JointState, "door_state", QUEUE_DEPTH)
        self._truth_publisher = self.create_publisher(MorphingParameters, "ground_truth", latched)
        self._image_publisher = self.create_publisher(Image, "depth/image", QUEUE_DEPTH)
        self._info_publisher = self.create_publisher(CameraInfo, "depth/camera_info", QUEUE_DEPTH)
        self._points_publisher = self.create_publisher(PointCloud2, "points", QUEUE_DEPTH)
        self._colour_publisher = self.create_publisher(Image, "image", QUEUE_DEPTH)

    def _make_simulation(self) -> Simulation:
        settings = self._settings
        return Simulation(
            settings.scenario,
            self._world,
            settings["gui"],
            settings["renderer"],
            settings["interpolate_from_desired_state"],
        )

    @staticmethod
    def _make_camera(settings: SimNodeSettings) -> DepthCamera:
        kind = SENSORS.get(settings["noise"])
        sensor = NoisySensor(DepthSensor.load(kind), settings["seed"]) if kind else None
        return DepthCamera(settings.camera, settings["camera_mount"], sensor)

    def _header(self, simulation: Simulation, frame: str) -> Header:
        """Return a header of the present, in simulated time if that is published."""
        now = simulation.time if self._settings["publish_clock"] else time.time()
        return Header(stamp=stamp_of(now), frame_id=frame)

    def _publish_clock(self, simulation: Simulation) -> None:
        self._clock_publisher.publish(ClockMessage(clock=stamp_of(simulation.time)))

    def _publish_states(self, simulation: Simulation) -> None:
        header, robot = self._header(simulation, ""), simulation.robot
        state, names = robot.state(), list(robot.limits)
        self._joint_publisher.publish(
            messages.joint_state(names, state.positions, state.velocities, robot.efforts(), header)
        )
        if simulation.door is not None:
            door = simulation.door.state()
            self._door_publisher.publish(
                messages.joint_state(simulation.door.joint_names, door[:2], door[2:], (), header)
            )
        self._statistics.track(
            simulation.desired.positions - state.positions,
            simulation.controller.progress(simulation.time),
        )

    def _publish_camera(self, simulation: Simulation) -> None:
        """Publish the ground truth, and what the camera sees to those who listen."""
        settings = self._settings
        header = self._header(simulation, settings["camera_frame"])
        world = Header(stamp=header.stamp, frame_id=settings["world_frame"])
        self._truth_publisher.publish(
            messages.ground_truth(simulation.scenario, simulation.values(), world)
        )
        camera = self._depth_camera.camera(simulation)
        if self._info_publisher.get_subscription_count():
            self._info_publisher.publish(info_from_camera(camera, header))
        image = self._image_publisher.get_subscription_count()
        points = self._points_publisher.get_subscription_count()
        colour = settings["image"] and self._colour_publisher.get_subscription_count()
        if not (image or points or colour):
            return
        picture = self._depth_camera.expose(simulation)
        depth = picture.depth
        if colour:
            self._colour_publisher.publish(
                messages.image_from_colour(picture.colour, settings["image_encoding"], header)
            )
        if image:
            self._image_publisher.publish(
                image_from_depth(depth, settings["depth_encoding"], header)
            )
        if points:
            self._points_publisher.publish(
                cloud_from_points(depth_to_points(depth, camera), header)
            )

    def _on_trajectory(self, message: JointTrajectory) -> None:
        try:
            self._runner.call(lambda simulation: self._accept(simulation, message))
        except TrajectoryError as error:
            self._statistics.refuse(error.reason, str(error))
            self._warnings.warn(error.reason, f"trajectory refused, {error.reason}: {error}")
        else:
            self._statistics.accept()

    def _accept(self, simulation: Simulation, message: JointTrajectory) -> None:
        offset = 0.0 if self._settings["publish_clock"] else simulation.time - time.time()
        command = messages.command_from_message(message, lambda stamp: stamp + offset)
        simulation.controller.accept(command, simulation.time)

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._rebuild(self._settings)
        response.success, response.message = True, "all is where it started"
        return response

    def _rebuild(self, settings: SimNodeSettings) -> None:
        """Build the world anew, with a camera whose noise begins anew."""
        camera = self._make_camera(settings)

        def build(simulation: Simulation) -> None:
            simulation.build(settings.scenario)
            self._depth_camera, self._settings = camera, settings

        self._runner.call(build)

    def _on_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Take over changed parameters together, or refuse them with the reason."""
        try:
            settings = SimNodeSettings.check(read_parameters(self, "sim_node", parameters))
            records_anew = settings.differs(self._settings, RECORDING)
            name = settings["record"] if records_anew else ""
            recorder = self._recordings.prepare(name, settings["record_rate"])
        except (OSError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        if settings.differs(self._settings, WORLD):
            self._rebuild(settings)
        elif settings.differs(self._settings, SENSOR):
            self._depth_camera = self._make_camera(settings)
        if records_anew:
            self._recordings.exchange(recorder, settings["record_rate"])
        self._settings = settings
        self._runner.real_time_factor = settings["real_time_factor"]
        self._states_task.period = 1.0 / settings["joint_state_rate"]
        self._camera_task.period = 1.0 / settings["camera_rate"]
        return SetParametersResult(successful=True)

    def _on_lost_recording(self, error: RecordingError) -> None:
        self._statistics.lose_recording()
        self.get_logger().warning(str(error))

    def _on_failure(self, error: Exception) -> None:
        """Tell of an error of a task; after a signal nothing can be published, which is none."""
        if not self.context.ok():
            return
        self._statistics.fail()
        self._warnings.warn("internal_error", "".join(traceback.format_exception(error)))

    def _report(self) -> list[DiagnosticStatus]:
        name = self.get_fully_qualified_name()
        simulated = self._runner.call(lambda simulation: simulation.time)
        return self._statistics.report(name, self._runner.achieved, simulated, self._renderer)


def main() -> int:
    """Run the executable ``sim_node``; being stopped is its normal end."""
    return run_node("sim_node", __doc__, SimNode)
