"""The node of the simulated world: robot, objects, and depth camera behind topics."""

from __future__ import annotations

import traceback
from collections.abc import Sequence
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import CameraInfo, Image, JointState, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import SENSORS, NoisySensor
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.ros.messages import cloud_from_points, image_from_depth, info_from_camera
from kmn_perception.ros.node_program import run_node
from kmn_perception.ros.overridable_node import OverridableNode
from kmn_perception.ros.parameters import declare_parameters, read_parameters
from kmn_perception.ros.reports import ThrottledWarnings, report_periodically
from kmn_perception.ros.stamps import seconds, stamp_of
from kmn_sim.robot.description import RobotDescription
from kmn_sim.robot.robot_model import robot_urdf
from kmn_sim.ros import messages
from kmn_sim.ros.controller_servers import ControllerServers
from kmn_sim.ros.sim_node_parameters import ODOM, RECORDING, SENSOR, WORLD, SimNodeSettings
from kmn_sim.ros.simulation_statistics import SimulationStatistics
from kmn_sim.ros.trajectory_input import TrajectoryInput
from kmn_sim.ros.transforms import TransformPublisher
from kmn_sim.sensors.depth_camera import DepthCamera, mount_error
from kmn_sim.sensors.recording import RecordingError
from kmn_sim.sensors.recordings import Recordings
from kmn_sim.sensors.settings import RecordingSettings
from kmn_sim.world.runner import Runner
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation

CLOCK_PERIOD = 0.01  # simulated seconds between two messages on /clock
QUEUE_DEPTH = 10


class SimNode(OverridableNode):
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
        self._world = WorldSettings.load(settings["robot"])
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
        trajectories = TrajectoryInput(
            self._runner, self._statistics, self._warnings, self._to_simulated
        )
        self._servers = ControllerServers(self, trajectories, self._world.robot.controllers)
        self.create_service(Trigger, "reset", self._on_reset)
        self.add_on_set_parameters_callback(self._on_parameters)
        report_periodically(self, self._report)
        self.get_logger().info(f"simulating model '{settings['model']}', depth by '{renderer}'")

    def destroy_node(self) -> None:
        """End the simulation's thread and the node."""
        self._runner.close()
        self._recordings.close()
        self._servers.destroy()
        super().destroy_node()

    def _connect(self) -> None:
        count = 1 + len(self._settings.scenario.beside)
        latched = QoSProfile(depth=count, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        if self._settings["publish_clock"]:  # /clock is one for all nodes
            self._clock_publisher = self.create_publisher(ClockMessage, "/clock", QUEUE_DEPTH)
        self._joint_publisher = self.create_publisher(JointState, "joint_states", QUEUE_DEPTH)
        self._odometry_publisher = self.create_publisher(Odometry, "odom", QUEUE_DEPTH)
        self._door_publisher = self.create_publisher(JointState, "door_state", QUEUE_DEPTH)
        self._beside_publisher = self.create_publisher(JointState, "beside_state", QUEUE_DEPTH)
        self._force_publisher = self.create_publisher(WrenchStamped, "handle_force", QUEUE_DEPTH)
        self._truth_publisher = self.create_publisher(MorphingParameters, "ground_truth", latched)
        self._image_publisher = self.create_publisher(Image, "depth/image", QUEUE_DEPTH)
        self._info_publisher = self.create_publisher(CameraInfo, "depth/camera_info", QUEUE_DEPTH)
        self._points_publisher = self.create_publisher(PointCloud2, "points", QUEUE_DEPTH)
        self._colour_publisher = self.create_publisher(Image, "image", QUEUE_DEPTH)
        robot = self._world.robot
        self._transforms = TransformPublisher(self, RobotDescription(robot_urdf(robot), robot))

    def _make_simulation(self) -> Simulation:
        settings = self._settings
        return Simulation(
            settings.scenario,
            self._world,
            settings["gui"],
            settings["renderer"],
            settings["interpolate_from_desired_state"],
            settings["allow_partial_joints_goal"],
            settings["odometry_drift"],
        )

    @staticmethod
    def _make_camera(settings: SimNodeSettings) -> DepthCamera:
        kind = SENSORS.get(settings["noise"])
        sensor = NoisySensor(DepthSensor.load(kind), settings["seed"]) if kind else None
        mounted = mount_error(settings["mount_offset"], settings["mount_tilt"], settings["seed"])
        camera, mount = settings.camera, settings["camera_mount"]
        return DepthCamera(camera, mount, sensor, settings["depth_scale"], mounted)

    def _header(self, simulation: Simulation, frame: str) -> Header:
        """Return a header of the present, in simulated time if that is published."""
        now = simulation.time if self._settings["publish_clock"] else self._now()
        return Header(stamp=stamp_of(now), frame_id=frame)

    def _now(self) -> float:
        """Return the time of the node's clock, seconds."""
        return seconds(self.get_clock().now().to_msg())

    def _publish_clock(self, simulation: Simulation) -> None:
        self._clock_publisher.publish(ClockMessage(clock=stamp_of(simulation.time)))

    def _publish_states(self, simulation: Simulation) -> None:
        header, robot = self._header(simulation, ""), simulation.robot
        self._transforms.publish(simulation, self._settings, header.stamp)
        state = robot.state()
        self._joint_publisher.publish(messages.robot_state(robot, state, header))
        odom = Header(stamp=header.stamp, frame_id=ODOM)
        self._odometry_publisher.publish(messages.odometry(robot, odom))
        if (mechanism := simulation.mechanism) is not None:
            places, rates = mechanism.positions().values(), mechanism.velocities().values()
            self._door_publisher.publish(
                messages.joint_state(mechanism.joint_names, [*places], [*rates], (), header)
            )
            world = Header(stamp=header.stamp, frame_id=self._settings["world_frame"])
            force = mechanism.grasp_force()
            self._force_publisher.publish(messages.force_on(force, world))
        if simulation.beside:
            self._beside_publisher.publish(messages.beside_state(simulation, header))
        self._statistics.track(
            robot.error(simulation.desired, state),
            simulation.controllers.progress(simulation.time),
        )

    def _publish_camera(self, simulation: Simulation) -> None:
        """Publish the ground truth, and what the camera sees to those who listen."""
        settings = self._settings
        header = self._header(simulation, settings["camera_frame"])
        # Of the very exposure, and first: whoever needs its pose need not wait or interpolate.
        self._transforms.publish(simulation, settings, header.stamp)
        world = Header(stamp=header.stamp, frame_id=settings["world_frame"])
        for truth in messages.ground_truths(simulation, world):
            self._truth_publisher.publish(truth)
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

    def _to_simulated(self, simulation: Simulation) -> float:
        """Return what stamps lack to be simulated time, seconds."""
        return 0.0 if self._settings["publish_clock"] else simulation.time - self._now()

    def _on_reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._rebuild(self._settings)
        response.success, response.message = True, "all is where it started"
        return response

    def _rebuild(self, settings: SimNodeSettings) -> None:
        """Build the world anew, with a camera whose noise begins anew."""
        camera = self._make_camera(settings)

        def build(simulation: Simulation) -> None:
            self._servers.end_goals("the world was set up anew")
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
