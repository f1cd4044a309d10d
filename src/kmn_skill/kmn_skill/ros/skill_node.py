"""The node that opens objects: actions in, joint trajectories out."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import WrenchStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.node_program import run_node
from kmn_perception.ros.overridable_node import OverridableNode
from kmn_perception.ros.parameters import declare_parameters, read_parameters
from kmn_perception.ros.reports import ChangeWarnings, ThrottledWarnings, report_periodically
from kmn_perception.ros.stamps import seconds
from kmn_skill.execution.door_memory import DoorMemory
from kmn_skill.execution.door_observation import DoorObservation
from kmn_skill.execution.errors import DoorError
from kmn_skill.execution.goal import Goal, Result
from kmn_skill.execution.opening import DoorOpening
from kmn_skill.execution.other_objects import OtherObjects, UnknownModelError
from kmn_skill.execution.plan_execution import Part
from kmn_skill.execution.states import BASE, StateWatch
from kmn_skill.planning.plan import Plan
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.ros import messages
from kmn_skill.ros.action_skill import ActionSkill
from kmn_skill.ros.controls import make_control
from kmn_skill.ros.door_frames import DoorFrames
from kmn_skill.ros.goal_client import GoalClient
from kmn_skill.ros.goal_interfaces import OpenDoorInterface, OperateJointInterface
from kmn_skill.ros.goal_server import GoalServer
from kmn_skill.ros.skill_node_parameters import ENCODERS, SkillNodeSettings
from kmn_skill.ros.skill_statistics import SkillStatistics
from kmn_skill.ros.state_reading import StateReader

QUEUE_DEPTH = 10


class SkillNode(OverridableNode):
    """Opens one object at a time, in a thread of its own; the executor only takes messages.

    Raises
    ------
    ParameterException, ParameterError
        If a parameter is wrong.
    OSError, ConfigurationError
        If the model or a configuration cannot be loaded.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("skill_node", **options)
        self._settings = settings = SkillNodeSettings.check(declare_parameters(self, "skill_node"))
        numbers = range(len(settings.model.actions))
        setups = [PlanningSetup.load(settings.model.doing(n), settings.robot) for n in numbers]
        setup = setups[0]
        door_joints = tuple(joint.name for joint in setup.action.joints)
        measured = door_joints if settings.door_angles == ENCODERS else ()
        self._warnings, self._refusals = ThrottledWarnings(self), ChangeWarnings(self)
        self._frames = [
            DoorFrames(self, self._warnings, settings, partial(self._use, number))
            for number in numbers
        ]
        self._states = StateReader(setup.robot, measured, self._frames[0].base_pose)
        self._control = make_control(
            self, setup.robot, self._states.odometry, lambda: self._settings, self.now
        )
        self._ending = ExitStack()
        self._watch = StateWatch(
            settings.states, self._states.joints, continuous=setup.robot.continuous
        )
        self._others = OtherObjects(
            settings.model, settings.world_frame, settings.door.limit_margin
        )
        self._skills = [self._make_skill(each) for each in setups]
        self._skill = self._skills[0]  # of the goal that is pursued
        self._statistics = SkillStatistics()
        self._connect()
        self.add_on_set_parameters_callback(self._on_parameters)
        self.get_logger().info(f"opening '{settings.model.name}' with {setup.robot.name}")

    def close(self) -> None:
        """Let the robot hold and the clients of goals get their results.

        Meanwhile the executor must go on.
        """
        self._server.close()

    def destroy_node(self) -> None:
        """Let the robot hold, and end the planner and the node."""
        self._server.destroy()
        self._ending.close()
        self._control.destroy()
        super().destroy_node()

    def now(self) -> float:
        """Return the present time of the node's clock, seconds."""
        return seconds(self.get_clock().now().to_msg())

    def show(self, plan: Plan, values: NDArray[np.float64]) -> None:
        """Publish a plan as markers."""
        report, setup = plan.report, self._skill.setup
        model = setup.model
        self._statistics.plan(report.planning_time)
        door = ", ".join(
            f"{parameter.name} {value:.3f}"
            for parameter, value in zip(model.parameters, values, strict=True)
        )
        self.get_logger().info(
            f"plan of {report.duration:.1f} s for the door {door}: found within "
            f"{report.planning_time:.2f} s, clearance {report.clearance:.3f} m"
        )
        header = Header(stamp=self.get_clock().now().to_msg(), frame_id=self._settings.world_frame)
        self._path_publisher.publish(messages.markers_from_plan(plan, model, values, header))
        self._plan_publisher.publish(messages.trajectory_from_plan(plan, setup.action, header))

    def send(self, part: Part) -> None:
        """Send a part of a plan."""
        self._control.send(part)

    def are_through(self) -> bool:
        """Tell whether the controllers have done what they were sent; raise if one failed."""
        return self._control.are_through()

    def hold(self, positions: NDArray[np.float64]) -> None:
        """Let the robot hold at positions (J,), m and rad."""
        self._control.hold(positions, self._settings.execution.hold_duration)

    def tell(self, text: str) -> None:
        """Log a warning."""
        self.get_logger().warning(text)

    def _make_skill(self, setup: PlanningSetup) -> ActionSkill:
        settings = self._settings
        motions = Prototypes.load(setup.action.motions, settings.robot)
        planner = self._ending.enter_context(Planner(setup, motions, settings.planning_time))
        memory = DoorMemory(self._memory_file(setup), self.tell)
        return ActionSkill.make(setup, planner, settings, memory, self._watch, self._others)

    def _memory_file(self, setup: PlanningSetup) -> Path:
        """Return the file in which this node keeps the door, beside the logs of ROS.

        It is of one action, robot and frame: numbers of another one would look alike.
        """
        home = os.environ.get("ROS_HOME") or os.path.expanduser("~/.ros")
        name = self.get_fully_qualified_name().strip("/").replace("/", ".")
        frame = self._settings.world_frame.replace("/", "_")
        done = f"{setup.model.name}.{setup.action.name}"
        of = f"{self.context.get_domain_id()}.{done}.{setup.robot.name}.{frame}"
        return Path(home) / "kmn_skill" / f"{name}.{of}.json"

    def _connect(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._path_publisher = self.create_publisher(MarkerArray, "planned_path", latched)
        self._plan_publisher = self.create_publisher(JointTrajectory, "planned_trajectory", latched)
        for topic in self._states.joints:
            kind = Odometry if topic == BASE else JointState
            self.create_subscription(kind, topic, partial(self._on_state, topic), 1)
        self.create_subscription(
            MorphingParameters, "morphing_parameters", self._on_parameters_of_door, QUEUE_DEPTH
        )
        if any(math.isfinite(each.force_limit) for each in self._settings.model.actions):
            self.create_subscription(WrenchStamped, "handle_force", self._on_force, QUEUE_DEPTH)
        report_periodically(self, self._report)
        self._server = GoalServer(
            self,
            (OpenDoorInterface(), OperateJointInterface(self._settings.model)),
            self._pursue,
            self._statistics,
            self._warnings,
            lambda: self._settings.preempt,
        )

    def _on_state(self, topic: str, message: JointState | Odometry) -> None:
        try:
            sample = self._states.read(topic, message)
        except MessageError as error:
            self._refuse(topic, f"{topic}_{error.reason}", error)
            return
        self._refusals.clear(topic)
        if sample is None:
            return
        watch = self._watch
        breaks = watch.breaks
        watch.put(topic, sample)
        if watch.breaks != breaks:
            self._others.forget(sample.time)
            for skill in self._skills:
                skill.forget(sample.time)
            self._warnings.warn("break", f"another world: {watch.last_break}")

    def _on_force(self, message: WrenchStamped) -> None:
        try:
            force = messages.force_from_wrench(message)
            force = self._frames[0].turned(force, message.header.frame_id)
        except MessageError as error:
            self._refuse("handle_force", error.reason, error)
        else:
            self._refusals.clear("handle_force")
            for skill in self._skills:
                skill.knowledge.force.put(seconds(message.header.stamp), force)

    def _on_parameters_of_door(self, message: MorphingParameters) -> None:
        observation = messages.observation_from_message(message)
        try:
            self._others.add(observation)
        except UnknownModelError as error:
            self._refuse("object", "unknown_model", error)
        for frames in self._frames:
            frames.take(observation, message.header.stamp)

    def _use(self, number: int, observation: DoorObservation) -> None:
        """Let an action's skill have an observation; it is counted once."""
        try:
            self._skills[number].knowledge.door.add(observation)
        except DoorError as error:
            if not number:
                self._refuse("morphing_parameters", error.reason, error)
        else:
            if not number:
                self._refusals.clear("morphing_parameters")
                self._statistics.use()

    def _pursue(self, goal: Goal, client: GoalClient) -> Result:
        """Pursue a goal to its result."""
        self._skill = skill = self._skills[goal.action]
        opening, execution = self._settings.of(skill.setup.action.joint)
        if skill.knowledge.door.choose(goal.object_id):
            skill.knowledge.memory.forget()  # of whichever object that was
        return DoorOpening(skill.knowledge, skill.planner, self, client, opening, execution).run(
            goal
        )

    def _refuse(self, topic: str, reason: str, error: Exception) -> None:
        self._statistics.refuse(reason)
        self._refusals.warn(topic, reason, f"{topic} refused: {error}")

    def _report(self) -> list[DiagnosticStatus]:
        try:
            self._skill.knowledge.door.values(self.now())
            doubt = ""
        except DoorError as error:
            doubt = str(error)
        return self._statistics.report(self.get_fully_qualified_name(), doubt)

    def _on_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Take over changed parameters together, or refuse them with the reason.

        A goal that runs goes on with those that it began with.
        """
        try:
            settings = SkillNodeSettings.check(read_parameters(self, "skill_node", parameters))
        except (OSError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        self._settings = settings
        self._watch.settings = settings.states
        self._others.limit_margin = settings.door.limit_margin
        for skill, frames in zip(self._skills, self._frames, strict=True):
            skill.take(settings)
            frames.settings = settings
        return SetParametersResult(successful=True)


def main() -> int:
    """Run the executable ``skill_node``; stopped, it lets the robot hold and ends."""
    return run_node("skill_node", __doc__, SkillNode, SkillNode.close)
