"""The node that opens doors: an action in, joint trajectories out."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.action.server import ActionServer, CancelResponse, GoalResponse, ServerGoalHandle
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from kmn_msgs.action import OpenDoor
from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.node_program import run_node
from kmn_perception.ros.parameters import declare_parameters, read_parameters
from kmn_perception.ros.reports import ChangeWarnings, ThrottledWarnings, report_periodically
from kmn_perception.ros.stamps import seconds
from kmn_skill.execution.door_memory import DoorMemory
from kmn_skill.execution.errors import DoorError
from kmn_skill.execution.goal import SUCCESS, Goal, Result
from kmn_skill.execution.opening import DoorOpening, Knowledge
from kmn_skill.execution.perceived_door import PerceivedDoor
from kmn_skill.execution.plan_execution import Part
from kmn_skill.execution.states import DOOR, ROBOT, StateWatch
from kmn_skill.planning.plan import Plan
from kmn_skill.planning.planner import Planner
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.ros import messages
from kmn_skill.ros.goal_client import GoalClient
from kmn_skill.ros.skill_node_parameters import SkillNodeSettings
from kmn_skill.ros.skill_statistics import SkillStatistics

QUEUE_DEPTH = 10
POLL_PERIOD = 0.05  # seconds
GOAL_TIMEOUT = 10.0  # seconds in which a goal ends when the node does
FAREWELL = 0.5  # seconds in which its client then may ask for the result


class SkillNode(Node):
    """Opens one door at a time, in a thread of its own; the executor only takes messages.

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
        setup = PlanningSetup.load(settings.model)
        self._joints = {
            ROBOT: setup.robot.joint_names,
            DOOR: tuple(joint.name for joint in settings.model.joints),
        }
        self._knowledge = Knowledge(
            settings.model,
            PerceivedDoor(settings.model, settings.world_frame, settings.door),
            DoorMemory(),
            StateWatch(settings.states, self._joints),
            setup.settings.surroundings,
        )
        self._ending = ExitStack()
        planner = Planner(setup, Prototypes.load(), settings.planning_time)
        self._planner = self._ending.enter_context(planner)
        self._statistics = SkillStatistics()
        self._warnings, self._refusals = ThrottledWarnings(self), ChangeWarnings(self)
        self._busy, self._closing = False, threading.Event()
        self._worker: threading.Thread | None = None  # of the goal
        self._connect()
        self.add_on_set_parameters_callback(self._on_parameters)
        self.get_logger().info(f"opening doors of model '{settings.model.name}'")

    def close(self) -> None:
        """Let the robot hold and the client of a goal get its result.

        Meanwhile the executor must go on.
        """
        self._closing.set()
        if self._busy:
            deadline = time.monotonic() + GOAL_TIMEOUT
            while self._busy and time.monotonic() < deadline:
                time.sleep(POLL_PERIOD)
            time.sleep(FAREWELL)

    def destroy_node(self) -> None:
        """Let the robot hold, and end the planner and the node."""
        self._closing.set()
        if self._worker is not None:
            self._worker.join()
        self._ending.close()
        self._server.destroy()  # of which the base class does not know
        super().destroy_node()

    def now(self) -> float:
        """Return the present time of the node's clock, seconds."""
        return seconds(self.get_clock().now().to_msg())

    def show(self, plan: Plan, values: NDArray[np.float64]) -> None:
        """Publish a plan as markers."""
        report, model = plan.report, self._settings.model
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

    def send(self, part: Part) -> None:
        """Publish a part of a plan."""
        message = messages.trajectory_from_part(part, self._joints[ROBOT])
        self._trajectory_publisher.publish(message)

    def hold(self) -> None:
        """Let the robot hold where it is."""
        self._trajectory_publisher.publish(JointTrajectory())

    def tell(self, text: str) -> None:
        """Log a warning."""
        self.get_logger().warning(text)

    def _connect(self) -> None:
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._trajectory_publisher = self.create_publisher(
            JointTrajectory, "joint_trajectory", QUEUE_DEPTH
        )
        self._path_publisher = self.create_publisher(MarkerArray, "planned_path", latched)
        for topic in self._joints:
            self.create_subscription(JointState, topic, partial(self._on_state, topic), 1)
        self.create_subscription(
            MorphingParameters, "morphing_parameters", self._on_parameters_of_door, QUEUE_DEPTH
        )
        report_periodically(self, self._report)
        self._server = ActionServer(
            self,
            OpenDoor,
            "open_door",
            self._on_open_door,
            goal_callback=self._on_goal,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    def _on_state(self, topic: str, message: JointState) -> None:
        try:
            sample = messages.sample_from_state(message, self._joints[topic])
        except MessageError as error:
            self._refuse(topic, f"{topic}_{error.reason}", error)
            return
        self._refusals.clear(topic)
        _, door, memory, watch, _ = self._knowledge
        breaks = watch.breaks
        watch.put(topic, sample)
        if watch.breaks != breaks:
            door.forget(sample.time)
            memory.forget()
            self._warnings.warn("break", f"another world: {watch.last_break}")

    def _on_parameters_of_door(self, message: MorphingParameters) -> None:
        try:
            self._knowledge.door.add(messages.observation_from_message(message))
        except DoorError as error:
            self._refuse("morphing_parameters", error.reason, error)
        else:
            self._refusals.clear("morphing_parameters")
            self._statistics.use()

    def _on_goal(self, request: OpenDoor.Goal) -> GoalResponse:
        """Accept a goal if none runs; whether it can be reached is for its result to tell."""
        if not self._busy and not self._closing.is_set():
            self._busy = True
            return GoalResponse.ACCEPT
        text = "goal rejected: another one runs, which must end or be cancelled first"
        self._statistics.reject(text)
        self._warnings.warn("rejected", text)
        return GoalResponse.REJECT

    async def _on_open_door(self, goal_handle: ServerGoalHandle) -> OpenDoor.Result:
        """Open the door in a thread, so that the executor goes on meanwhile."""
        executor = self.executor
        assert executor is not None
        done = Future()
        done.add_done_callback(lambda _: executor.wake())
        self._worker = threading.Thread(target=self._work, args=(goal_handle, done), name="goal")
        self._worker.start()
        result: Result = await done
        self._busy = False
        return messages.result_message(result)

    def _work(self, goal_handle: ServerGoalHandle, done: Future) -> None:
        request = goal_handle.request
        result = self._open(goal_handle, Goal(request.handle_angle, request.door_angle))
        try:
            self._finish(goal_handle, result)
        finally:
            done.set_result(result)

    def _open(self, goal_handle: ServerGoalHandle, goal: Goal) -> Result:
        settings = self._settings
        client = GoalClient(goal_handle, self._closing, self._statistics)
        opening = DoorOpening(
            self._knowledge, self._planner, self, client, settings.opening, settings.execution
        )
        try:
            return opening.run(goal)
        except Exception as error:  # a node never dies of a goal
            self.get_logger().error(traceback.format_exc())
            return Result("internal_error", repr(error))

    def _finish(self, goal_handle: ServerGoalHandle, result: Result) -> None:
        self._statistics.finish(result)
        if result.outcome == SUCCESS:
            self.get_logger().info(f"the door is open by {result.door_angle:.2f} rad")
            goal_handle.succeed()
            return
        self.get_logger().warning(f"the door was not opened, {result.outcome}: {result.reason}")
        if goal_handle.is_cancel_requested:
            goal_handle.canceled()
        else:
            goal_handle.abort()

    def _refuse(self, topic: str, reason: str, error: Exception) -> None:
        self._statistics.refuse(reason)
        self._refusals.warn(topic, reason, f"{topic} refused: {error}")

    def _report(self) -> list[DiagnosticStatus]:
        try:
            self._knowledge.door.values(self.now())
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
        self._knowledge.door.settings = settings.door
        self._knowledge.watch.settings = settings.states
        return SetParametersResult(successful=True)


def main() -> int:
    """Run the executable ``skill_node``; stopped, it lets the robot hold and ends."""
    return run_node("skill_node", __doc__, SkillNode, SkillNode.close)
