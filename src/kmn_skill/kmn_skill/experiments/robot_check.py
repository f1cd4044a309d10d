"""What there is of all that skill_node needs from a robot, and what is missing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kmn_msgs.msg import MorphingParameters
from kmn_perception.configuration import resources
from kmn_perception.configuration.robot_parts import ControllerSettings
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.configuration.settings import NonNegative, Positive, load_settings
from kmn_perception.ros.messages import MessageError
from kmn_skill.planning.layout import BASE
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.urdf_limits import JointLimits, differences, limits_of_urdf
from kmn_skill.planning.world import World
from kmn_skill.ros.robot_listener import Received, RobotListener
from kmn_skill.ros.skill_node_parameters import TOPIC as BY_TOPIC
from kmn_skill.ros.split_states import SplitStates
from kmn_skill.ros.topic_control import TOPIC

ACTIONS = {
    "follow_joint_trajectory": "control_msgs/action/FollowJointTrajectory",
    "gripper_command": "control_msgs/action/GripperCommand",
}
CAMERA = ("depth/image", "points")  # either of them serves


class Expected(NamedTuple):
    """What is expected of a running robot; see ``config/skill/check_robot.yaml``."""

    discovery: NonNegative
    listen: Positive
    max_age: Positive
    min_rate: NonNegative
    limit_slack: NonNegative
    velocity_slack: NonNegative

    @classmethod
    def load(cls) -> Expected:
        """Read the shipped file."""
        return load_settings(cls, resources.find("config/skill", "check_robot"))


class Finding(NamedTuple):
    """What was found about a subject, and what to do where something is missing."""

    subject: str
    text: str
    remedy: str = ""

    @property
    def is_missing(self) -> bool:
        """Whether something is missing."""
        return bool(self.remedy)


class Frames(NamedTuple):
    """Frames of the robot; empty: what its messages tell."""

    world: str
    base: str
    camera: str


class RobotCheck:
    """Judges what a robot tells.

    Parameters
    ----------
    setup
        Door and robot.
    control
        How skill_node is to move it, ``topic`` or ``action``.
    """

    def __init__(
        self,
        robot: RobotListener,
        setup: PlanningSetup,
        control: str,
        frames: Frames,
        expected: Expected,
    ) -> None:
        self._heard, self._setup, self._control = robot, setup, control
        self._robot, self._expected = setup.robot, expected
        told = robot.odometry.messages
        base = frames.base or (told[-1].child_frame_id if told else "base_footprint")
        cameras = robot.cameras.messages
        camera = frames.camera or (cameras[-1].header.frame_id if cameras else "")
        self._frames = Frames(frames.world, base, camera)

    def findings(self) -> Iterator[Finding]:
        """Return what was found, subject by subject."""
        yield self._joint_states()
        yield self._odometry()
        yield self._transform("base", self._frames.base)
        yield self._transform("camera", self._frames.camera)
        yield from self._controllers()
        yield from self._model()
        yield self._camera()
        yield self._door()

    def _joint_states(self) -> Finding:
        subject, received = "joint_states", self._heard.joints
        if not received.messages:
            return Finding(subject, "nothing came", "start the robot's joint_state_broadcaster")
        names = self._robot.told_names
        states, problem = SplitStates(names), ""
        for message in received.messages:
            try:
                states.join(message)
                problem = ""
            except MessageError as error:
                problem = str(error)
        if problem:
            return Finding(subject, problem, "publish all of them, under these names")
        return self._pace(subject, f"all {len(names)} joints", received)

    def _odometry(self) -> Finding:
        subject, received = "odom", self._heard.odometry
        if not self._robot.takes_velocities:
            told = "the base stands" if self._robot.is_fixed else "joint_states tell of the base"
            return Finding(subject, f"is not needed: {told}")
        if not received.messages:
            return Finding(
                subject, "nothing came", "publish nav_msgs/Odometry of the base on 'odom'"
            )
        frame = received.messages[-1].header.frame_id
        if frame != self._frames.world and (
            why := self._heard.missing_transform(self._frames.world, frame, self._expected.max_age)
        ):
            return Finding(
                subject,
                f"is in frame '{frame}', the world is '{self._frames.world}': {why}",
                f"set world_frame of skill_node to '{frame}'",
            )
        return self._pace(subject, f"in frame '{frame}'", received)

    def _pace(self, subject: str, what: str, received: Received) -> Finding:
        """Tell how often and how late something comes."""
        age, rate = max(received.ages, key=abs), received.rate()
        text = f"{what}, {rate:.0f} a second, at most {max(age, 0.0):.2f} s old"
        if abs(age) > self._expected.max_age:
            return Finding(
                subject,
                f"{what}, {age:.2f} s old by their stamps, expected at most "
                f"{self._expected.max_age:g} s",
                "let all share a clock, and set use_sim_time everywhere or nowhere",
            )
        if rate < self._expected.min_rate:
            return Finding(
                subject, text, f"publish {self._expected.min_rate:g} or more of them a second"
            )
        return Finding(subject, text)

    def _transform(self, what: str, frame: str) -> Finding:
        subject, world = f"transform to the {what}", self._frames.world
        if not frame:
            return Finding(
                subject,
                "the camera's frame is not known: depth/camera_info did not come",
                "start the camera, or give --camera-frame",
            )
        if why := self._heard.missing_transform(world, frame, self._expected.max_age):
            return Finding(
                subject, why, f"let somebody publish the transforms from '{world}' to '{frame}'"
            )
        return Finding(
            subject,
            f"'{frame}' in '{world}' is known, at most {self._expected.max_age:g} s old",
        )

    def _controllers(self) -> Iterator[Finding]:
        if self._control == BY_TOPIC:
            yield self._listened("controllers", TOPIC, "trajectory_msgs/msg/JointTrajectory")
            return
        for name, controller in self._robot.controllers.items():
            subject = f"controller '{name}'"
            if controller.type in ACTIONS:
                yield self._served(subject, controller)
            elif controller.type == "topic":
                kind = "trajectory_msgs/msg/JointTrajectory"
                yield self._listened(subject, controller.name, kind)
            else:
                kind = "geometry_msgs/msg/Twist" + ("Stamped" if controller.stamped else "")
                yield self._listened(subject, controller.name, kind)

    def _served(self, subject: str, controller: ControllerSettings) -> Finding:
        action, expected = controller.name, ACTIONS[controller.type]
        found = self._heard.action_types(action)
        remedy = "start it, or give its name and type under 'controllers' in the robot's file"
        if not found:
            return Finding(subject, f"nobody serves the action '{action}'", remedy)
        if expected not in found:
            kinds = ", ".join(found)
            return Finding(subject, f"'{action}' is {kinds}, expected {expected}", remedy)
        return Finding(subject, f"serves '{action}'")

    def _listened(self, subject: str, topic: str, kind: str) -> Finding:
        count, kinds = self._heard.listeners(topic), self._heard.types(topic)
        remedy = "start it, or give its name and type under 'controllers' in the robot's file"
        if not count:
            return Finding(subject, f"nobody listens to '{topic}'", remedy)
        if kind not in kinds:
            return Finding(subject, f"'{topic}' is {', '.join(kinds)}, expected {kind}", remedy)
        return Finding(subject, f"listens to '{topic}'")

    def _model(self) -> Iterator[Finding]:
        """Check what the planner's model has against the robot's URDF, and the pads."""
        model, names = self._setup.model, self._robot.joint_names
        try:
            world = World(self._setup, *model.split(model.prototype))
        except ConfigurationError as error:
            yield Finding("pads", str(error), "correct the robot's file")
            return
        yield Finding(
            "pads",
            f"take the handle where {names[-1]} is at {world.touching:.3f}, open at "
            f"{self._robot.planning.grip.open:g}",
        )
        low, high = world.limits()[:, : len(names)]
        planned = zip(names, low, high, self._robot.limits[:, 0], strict=True)
        limits = {name: JointLimits(*map(float, each)) for name, *each in planned}
        for name in names[BASE]:
            del limits[name]
        yield self._limits(limits)

    def _limits(self, planned: dict[str, JointLimits]) -> Finding:
        subject = "robot_description"
        if not self._heard.description:
            return Finding(subject, "did not come", "start robot_state_publisher with the URDF")
        try:
            urdf = limits_of_urdf(self._heard.description[-1].data)
        except ValueError as error:
            return Finding(subject, str(error), "publish the robot's URDF")
        expected = self._expected
        found = differences(planned, urdf, expected.limit_slack, expected.velocity_slack)
        if found:
            return Finding(subject, "; ".join(found), "correct the robot's file, or its model")
        return Finding(subject, "plans keep its limits of positions and velocities")

    def _camera(self) -> Finding:
        found = [topic for topic in CAMERA if self._heard.talkers(topic)]
        if not found:
            return Finding(
                "camera",
                f"nobody publishes {' or '.join(CAMERA)}",
                "start the camera, or remap morph_node's topics to its",
            )
        return Finding("camera", f"publishes {', '.join(found)}")

    def _door(self) -> Finding:
        subject, doors = "morphing_parameters", self._heard.doors.messages
        if not doors:
            return Finding(
                subject,
                "nothing came",
                "start morph_node where the camera is, and wait until it says that it estimates: "
                "its first start compiles",
            )
        last, world = doors[-1], self._frames.world
        frame = last.header.frame_id
        if last.model != self._setup.model.name:
            return Finding(
                subject,
                f"are of the model '{last.model}', expected '{self._setup.model.name}'",
                "set parameter 'model' of both nodes, or give --model",
            )
        if frame != world and (
            why := self._heard.missing_transform(world, frame, self._expected.max_age)
        ):
            return Finding(subject, why, f"let somebody tell where '{frame}' is in '{world}'")
        usable = last.status == MorphingParameters.OK
        state = "the door is seen" if usable else f"the door cannot be relied upon: {last.reason}"
        return Finding(subject, f"come in frame '{frame}'; {state}")
