"""The whole system in processes of its own - sim_node, morph_node, skill_node - and its client."""

from __future__ import annotations

import argparse
import math
import os
import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from copy import copy
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from numpy.typing import NDArray
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from rclpy.time import Time
from sensor_msgs.msg import JointState

from kmn_msgs.action import OperateJoint
from kmn_msgs.msg import MorphingParameters
from kmn_perception.ros.node_process import (
    NodeProcess,
    ProcessClient,
    namespace_arguments,
    parameter_arguments,
)
from kmn_skill.execution.goal import Goal
from kmn_skill.experiments.beside import FIRST_ID, Beside
from kmn_skill.experiments.patience import Patience
from kmn_skill.experiments.settings import Experiment
from kmn_skill.experiments.stopwatch import Stopwatch
from kmn_skill.experiments.trials import Opened
from kmn_skill.planning.layout import MOVED
from kmn_skill.planning.surroundings import WALL
from kmn_skill.ros.locked_action_client import LockedActionClient

QUEUE_DEPTH = 10
ON_ROBOT = "base"  # where sim_node has a camera that moves with the robot
PROTOTYPE_PERIOD = 0.2  # seconds between two messages of the prototype
SOURCES = {  # of the door's parameters, and the topic that skill_node takes them from
    "perceived": "morphing_parameters",
    "true": "ground_truth",
    "prototype": "prototype_parameters",
}


class Room(NamedTuple):
    """A simulated room: its seed, and the recess of the door in it, metres."""

    seed: int
    recess: float


class DoorSystem:
    """Starts the nodes and is a client of theirs, up to the end of a context.

    Parameters
    ----------
    sim
        Parameters of sim_node.
    options
        Of a program: ``robot``; ``object``, model of what is opened, and ``mode``, to which side;
        ``parameters``, where skill_node takes it from, one of ``SOURCES``; ``room``, whether it is
        a door that stands in a room, and is perceived by depth and image; and ``control``, how
        skill_node moves the robot, ``topic`` or ``action``; and, if it is to be started,
        ``viewer``, parameters of that; and ``beside``, see `Beside`.
    experiment
        Models of the doors, and how long to wait for what.

    Raises
    ------
    ProcessError
        If a node ends or does not answer; by all methods.
    """

    def __init__(
        self, sim: dict[str, Any], options: argparse.Namespace, experiment: Experiment
    ) -> None:
        in_rooms, robot = options.room, options.robot
        model = experiment.room.model if in_rooms else options.object or experiment.model
        around = {"robot": robot, "model": model, "direction": options.mode, "image": in_rooms}
        self._beside = Beside(options, experiment.row.closed)
        self._sim = {**sim, **around, **self._beside.of_sim_node()}
        if in_rooms:
            self._sim["renderer"] = "software"  # EGL's highlights are none of a room's light
        self._source, self._in_rooms = options.parameters, in_rooms
        self._timeouts, self._viewer = experiment.timeouts, vars(options).get("viewer")
        self._patience, self._opened = Patience.load(), experiment.opened
        self._control = options.control
        self._processes: dict[str, NodeProcess] = {}
        self._stack = ExitStack()
        self._truth: MorphingParameters | None = None
        self._seen: list[MorphingParameters] = []
        self._hinge = float("nan")

    def __enter__(self) -> DoorSystem:
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            namespace = f"/doors_{os.getpid()}"  # whatever else runs here is not disturbed
            alone = namespace_arguments(namespace)
            for package, executable, parameters, more in self._nodes():
                renamed = [part for text in more for part in ("-r", text)]
                arguments = [*alone, *renamed, *parameter_arguments(parameters)]
                process = NodeProcess(package, executable, arguments, folder / executable)
                self._processes[executable] = stack.enter_context(process)
            self._node = Node("doors", cli_args=["--ros-args", "-r", f"__ns:={namespace}"])
            self._stopwatch = Stopwatch(f"{namespace}/sim_node")
            stack.callback(self._node.destroy_node)
            self._client = ProcessClient(self._node, list(self._processes.values()))
            self._connect()
            self._client.wait(self._is_ready, self._timeouts.start, "the system")
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def show(
        self,
        values: NDArray[np.float64],
        direction: str,
        room: Room | None = None,
        seed: int | None = None,
    ) -> None:
        """Set up a closed door of morphing parameters (n + m,), and the robot where it starts.

        Returns when skill_node knows of this door only.

        Parameters
        ----------
        room
            That the door stands in.
        seed
            That draws what stands beside it; None: as before.
        """
        scene = self._timeouts.scene
        around = {"room": False} if room is None else {"room": True, **room._asdict()}
        given = [float(value) for value in values]
        drawn = {} if seed is None else {"seed": seed}
        self._set(placement="given", values=given, direction=direction, **around, **drawn)
        if room is not None:
            wall: dict[str, Any] = {"surroundings": WALL}
            if self._source != "perceived":
                wall["recess"] = room.recess
            self._client.set_parameters(self._knowing, wall, scene)
        self._truth = None
        truth = self._client.wait(lambda: self._truth_of(values), scene, "sim_node")
        since = Time.from_msg(truth.header.stamp)
        self._seen.clear()
        count = self._patience.new_frames * (1 + self._beside.count)
        self._client.wait(
            lambda: self._count_since(since) >= count, scene, "what perceives the door"
        )

    def open(self, goal: Goal, feedback: Callable[[OperateJoint.Feedback], None]) -> Opened:
        """Open the door that is there; ``feedback`` is told what is being done."""
        assert self._truth is not None  # since `show`
        last = self._beside.meant(self._seen, self._truth)
        perceived = np.array([*last.theta, *last.gamma])

        def progress(message: OperateJoint.Feedback) -> None:
            self._stopwatch.enter(message.phase)
            feedback(message)

        self._stopwatch.start(self._opened * goal.target)
        self._beside.watch()
        answer = self._send(goal, progress, last.id if self._beside.count else 0)
        self._client.wait(answer.done, self._timeouts.goal, "skill_node")
        self._stopwatch.stop()
        reported = self._stopwatch.reports
        self._client.wait(  # for the report of the last second
            lambda: self._stopwatch.reports > reported, self._timeouts.scene, "sim_node"
        )
        measured, moved = self._stopwatch.measured, self._beside.moved()
        return Opened(answer.result().result, perceived, self._hinge, measured, moved)

    def _send(
        self, goal: Goal, feedback: Callable[[OperateJoint.Feedback], None], number: int = 0
    ) -> Future:
        """Send a goal for the object of a number, 0: any, and return its result to come."""
        request = OperateJoint.Goal(target=goal.target, object_id=number)
        accepted = self._action.send_goal_async(
            request, feedback_callback=lambda message: feedback(message.feedback)
        )
        self._client.wait(accepted.done, self._timeouts.scene, "skill_node")
        answer: Future = accepted.result().get_result_async()
        return answer

    def stay(self) -> None:
        """Let the nodes run until one ends or the program is interrupted."""
        self._client.wait(lambda: None, math.inf, "nobody")

    def record(self, file: Path | None, rate: float) -> None:
        """Let sim_node record what follows with so many pictures a second; None ends that."""
        self._set(record=str(file.absolute()) if file else "", record_rate=rate)

    def _nodes(self) -> list[tuple[str, str, dict[str, Any], list[str]]]:
        """Return packages, executables, parameters and remappings of the nodes that are needed."""
        simulated = {"use_sim_time": True, "model": self._sim["model"]}
        skill = {"robot": self._sim["robot"], **simulated, **self._skill_parameters()}
        door = f"morphing_parameters:={SOURCES[self._source]}"
        nodes: list[tuple[str, str, dict[str, Any], list[str]]] = [
            ("kmn_sim", "sim_node", {**self._sim, "publish_clock": True}, []),
            ("kmn_skill", "skill_node", skill, [door]),
        ]
        if self._source == "perceived":
            models = self._beside.of_morph_node(self._sim["model"])
            morph = {**simulated, "reliability": "reliable", **models}
            if self._in_rooms:  # the simulated sensor's depth is not off as a whole
                morph["calibration"] = "calibrated"
            nodes.append(("kmn_perception", "morph_node", morph, []))
        if self._viewer is not None:
            nodes.append(("kmn_perception", "viewer", {**simulated, **self._viewer}, [door]))
        return nodes

    def _skill_parameters(self) -> dict[str, Any]:
        """Return the parameters of skill_node, in simulated seconds."""
        pace = max(1.0, self._sim["real_time_factor"])
        paced: dict[str, Any]
        paced = {name: pace * value for name, value in self._patience.skill_node.items()}
        paced["control"] = self._control
        if self._sim.get("camera_mount") == ON_ROBOT:
            paced |= self._patience.skill_node_with_camera
            if self._sim.get("mount_offset"):
                paced |= self._patience.skill_node_with_faults
        return {**paced, **(self._patience.skill_node_in_rooms if self._in_rooms else {})}

    def _connect(self) -> None:
        node = self._node
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(MorphingParameters, "ground_truth", self._on_truth, latched)
        node.create_subscription(
            MorphingParameters, SOURCES[self._source], self._on_parameters, QUEUE_DEPTH
        )
        node.create_subscription(JointState, "door_state", self._on_door, QUEUE_DEPTH)
        beside = self._beside
        node.create_subscription(JointState, "beside_state", beside.on_state, QUEUE_DEPTH)
        watch = self._stopwatch
        node.create_subscription(WrenchStamped, "handle_force", watch.on_force, QUEUE_DEPTH)
        node.create_subscription(DiagnosticArray, "/diagnostics", watch.on_reports, QUEUE_DEPTH)
        self._action = LockedActionClient(node, OperateJoint, "operate_joint")
        self._setting = node.create_client(
            SetParametersAtomically, "sim_node/set_parameters_atomically"
        )
        self._knowing = node.create_client(
            SetParametersAtomically, "skill_node/set_parameters_atomically"
        )
        self._prototype = node.create_publisher(
            MorphingParameters, SOURCES["prototype"], QUEUE_DEPTH
        )
        if self._source == "prototype":
            node.create_timer(PROTOTYPE_PERIOD, self._publish_prototype)

    def _truth_of(self, values: NDArray[np.float64]) -> MorphingParameters | None:
        """Return the truth if it is of these parameters."""
        truth = self._truth
        return truth if truth and np.allclose([*truth.theta, *truth.gamma], values) else None

    def _count_since(self, since: Time) -> int:
        return sum(Time.from_msg(message.header.stamp) >= since for message in self._seen)

    def _is_ready(self) -> bool:
        return (
            self._setting.service_is_ready()
            and self._knowing.service_is_ready()
            and self._action.server_is_ready()
            and self._truth is not None
            and len(self._seen) > 0
        )

    def _on_truth(self, message: MorphingParameters) -> None:
        if message.id <= FIRST_ID:  # not of those beside it
            self._truth = message

    def _on_parameters(self, message: MorphingParameters) -> None:
        self._seen.append(message)

    def _on_door(self, message: JointState) -> None:
        self._hinge = message.position[MOVED]
        self._stopwatch.on_door(message)

    def _publish_prototype(self) -> None:
        """Publish the prototype with the stamp of the true door."""
        if self._truth is not None:
            prototype = copy(self._truth)
            prototype.theta = [0.0] * len(prototype.theta)
            prototype.gamma = [0.0] * len(prototype.gamma)
            self._prototype.publish(prototype)

    def _set(self, **values: Any) -> None:
        self._client.set_parameters(self._setting, values, self._timeouts.scene)
