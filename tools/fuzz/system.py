"""The whole system with hostile peers: what its nodes take is asked of the graph."""

from __future__ import annotations

import argparse
import base64
import json
import re
import resource
import urllib.request
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

from control_msgs.action import FollowJointTrajectory
from rcl_interfaces.msg import Parameter
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy._rclpy_pybind11 import RCLError
from rclpy.action.client import ActionClient
from rclpy.action.graph import get_action_server_names_and_types_by_node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from fuzz.messages import hostile_message, hostile_values, interface
from fuzz.outcome import ACCEPTED, ANSWERED, REFUSED, SENT
from kmn_perception.configuration.node_parameters import load_node_parameters
from kmn_perception.ros.node_process import NoAnswerError
from kmn_skill.experiments.door_system import DoorSystem
from kmn_skill.experiments.settings import Experiment
from kmn_skill.planning.robot import RobotModel, default_robot

DEPTH = 10
CAPTURE = 5.0  # seconds for valid messages of all topics to come
MATCH = 5.0  # seconds for a publisher to find a subscription
LATER = 0.5  # seconds until an answer that was sent before another one is there
ANSWER = 60.0  # seconds for a node to answer; a busy machine needs some
TOPIC, SERVICE, ACTION = "topic", "service", "action"


def resident(pid: int) -> int:
    """Return the resident memory of a process, bytes."""
    pages = Path(f"/proc/{pid}/statm").read_text().split()[1]
    return int(pages) * resource.getpagesize()


class Entrance(NamedTuple):
    """What a node takes: from a topic, by a service, or by an action."""

    node: str
    kind: str
    name: str
    type: str

    def __str__(self) -> str:
        _, *relative = self.name.lstrip("/").split("/")  # without the namespace
        return f"{self.node}: {'/'.join(relative) or self.name}"


def line(to: Entrance, content: Any) -> str:
    """Return something hostile as a line of JSON, with its bytes (CDR)."""
    data = content if isinstance(content, bytes) else serialize_message(content)
    return json.dumps({"to": to, "cdr": base64.b64encode(data).decode()})


class FuzzedSystem(DoorSystem):
    """The system, to whose nodes hostile content is sent."""

    def __init__(self, experiment: Experiment, seed: int) -> None:
        options = argparse.Namespace(
            robot=default_robot(), object="", room=False, mode="pull", parameters="perceived",
            control="action", viewer={"port": 0},
        )  # fmt: skip
        super().__init__({**experiment.evaluation._asdict(), "seed": seed}, options, experiment)
        self._robot = RobotModel.load()
        self._publishers: dict[str, Any] = {}
        self._valid: dict[str, Any] = {}
        self._clients: dict[str, Any] = {}
        self._stated: dict[str, list[Any]] = {}

    def __enter__(self) -> FuzzedSystem:
        super().__enter__()
        self._names = {name: f"{self._node.get_namespace()}/{name}" for name in self._processes}
        return self

    @property
    def nodes(self) -> list[str]:
        """Names of the nodes."""
        return list(self._processes)

    def entrances(self) -> list[Entrance]:
        """Return all that the nodes take, as the graph of ROS has it."""
        node, space = self._node, self._node.get_namespace()
        found = []
        for name in self._processes:
            topics = node.get_subscriber_names_and_types_by_node(name, space)
            services = node.get_service_names_and_types_by_node(name, space)
            actions = get_action_server_names_and_types_by_node(node, name, space)
            services = [each for each in services if "/_action/" not in each[0]]
            topics = [each for each in topics if "/_action/" not in each[0]]
            for kind, of_kind in ((TOPIC, topics), (SERVICE, services), (ACTION, actions)):
                found += [Entrance(name, kind, entry, type_) for entry, (type_, *_) in of_kind]
        return found

    def learn(self, entrances: Sequence[Entrance]) -> None:
        """Take a valid message of each topic, and the parameters as they are."""
        node, heard = self._node, []
        quick = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
        topics = {each.name: each.type for each in entrances if each.kind == TOPIC}
        for topic, type_ in topics.items():
            keep = lambda message, topic=topic: self._valid.setdefault(topic, message)  # noqa: E731
            heard.append(node.create_subscription(interface(type_), topic, keep, quick))
        self._client.pause(CAPTURE)
        for subscription in heard:
            node.destroy_subscription(subscription)
        for name in self._processes:
            stated = load_node_parameters(name)
            names = [each for each in stated if not stated[each].read_only]
            request = GetParameters.Request(names=names)
            values = self._call(f"{name}/get_parameters", GetParameters, request).values
            parameters = SetParameters.Request().parameters
            for parameter, value in zip(names, values, strict=True):
                parameters.append(Parameter(name=parameter, value=value))
            self._stated[name] = parameters

    def hostile(self, to: Entrance, random: Random) -> Any:
        """Return something hostile for an entrance, or the bytes of it."""
        change = hostile_message if to.kind == TOPIC else hostile_values
        return change(self._valid_of(to), random)

    def deliver(self, to: Entrance, content: Any) -> str:
        """Send it, and return what became of it, as far as the node says."""
        if to.kind == TOPIC:
            try:
                self.publish(to, content)
            except RCLError:  # of ROS itself, as of bytes that are too few
                return REFUSED
            return SENT
        if to.kind == ACTION:
            return self.pursue(to, content)
        if not to.type.startswith("rcl_interfaces/"):
            self._call(to.name, interface(to.type), content)
            return ANSWERED
        answer = self._request(to.name, interface(to.type), content)
        self.probe(to.node)  # is answered later
        with suppress(NoAnswerError):
            self._client.wait(answer.done, LATER, to.node)
        return ANSWERED if answer.done() else REFUSED  # by rclpy, which then says nothing

    def deliver_line(self, text: str, entrances: Sequence[Entrance]) -> None:
        """Send what `line` returned, to a system with another namespace."""
        said = json.loads(text)
        there = Entrance(*said["to"])
        (to,) = (each for each in entrances if str(each) == str(there) and each.kind == there.kind)
        content = base64.b64decode(said["cdr"])
        if to.kind == TOPIC:
            self.publish(to, content)
        else:
            cls = interface(to.type)
            self.deliver(
                to, deserialize_message(content, cls.Goal if to.kind == ACTION else cls.Request)
            )

    def publish(self, to: Entrance, message: Any) -> None:
        """Publish a message, or bytes of one."""
        if to.name not in self._publishers:
            self._publishers[to.name] = self._publisher(to)
        self._publishers[to.name].publish(message)

    def pursue(self, to: Entrance, goal: Any) -> str:
        """Send a goal and cancel it; return whether it was accepted."""
        client = self._client_of(
            to.name, lambda: ActionClient(self._node, interface(to.type), to.name)
        )
        self._wait(client.server_is_ready, to.node)
        handle = self._result(client.send_goal_async(goal), to.node)
        if not handle.accepted:
            return REFUSED
        result = handle.get_result_async()
        self._result(handle.cancel_goal_async(), to.node)
        self._result(result, to.node)
        return ACCEPTED

    def probe(self, node: str) -> None:
        """Ask a node for something; raise `ProcessError` if it is dead, or does not answer."""
        self._call(f"{node}/get_parameters", GetParameters, GetParameters.Request())

    def restore(self, node: str) -> None:
        """Give a node its parameters back."""
        request = SetParametersAtomically.Request(parameters=self._stated[node])
        name = f"{node}/set_parameters_atomically"
        result = self._call(name, SetParametersAtomically, request).result
        if not result.successful:
            raise NoAnswerError(f"{node} does not take its own parameters back: {result.reason}")

    def answers(self, entrances: Sequence[Entrance]) -> None:
        """See that each node does its work for what is valid; raise `ProcessError` if not."""
        for name in self._processes:
            self.probe(name)
            self.restore(name)
        seen = len(self._seen)
        self._wait(lambda: len(self._seen) > seen + 2, "what perceives the door")
        for to in entrances:
            if to.kind == ACTION and to.node == "skill_node":
                self.pursue(to, interface(to.type).Goal())
        if "viewer" in self._processes:
            (address, *_) = re.findall(r"http://\S+", self.output("viewer"))[-1:]
            with urllib.request.urlopen(address, timeout=ANSWER) as page:
                page.read()

    def revive(self) -> list[str]:
        """Start dead nodes anew; return them."""
        dead = [name for name, process in self._processes.items() if not process.is_running()]
        for name in dead or []:
            self._processes[name].start()
        if dead:
            for publisher in self._publishers.values():
                self._node.destroy_publisher(publisher)
            self._publishers.clear()
            for name in dead:
                self.probe(name)
        return dead

    def output(self, node: str) -> str:
        """Return what a node has printed."""
        return self._processes[node].output()

    def memory(self) -> dict[str, int]:
        """Return the resident memory of all nodes, bytes."""
        return {name: resident(process.pid) for name, process in self._processes.items()}

    def _valid_of(self, to: Entrance) -> Any:
        """Return something valid of an entrance, as far as it is known."""
        if to.type == "rcl_interfaces/srv/SetParameters":
            return SetParameters.Request(parameters=self._stated[to.node])
        cls = interface(to.type)
        empty = {TOPIC: "", SERVICE: "Request", ACTION: "Goal"}[to.kind]
        valid = self._valid.get(to.name) or (getattr(cls, empty) if empty else cls)()
        if isinstance(valid, JointTrajectory):
            return self._trajectory(self._robot.told_names)
        if isinstance(valid, FollowJointTrajectory.Goal):
            controllers = self._robot.controllers.values()
            joints = [each.joints for each in controllers if to.name.endswith(each.name)]
            valid.trajectory = self._trajectory(*joints)
        return valid

    def _trajectory(self, joints: Sequence[str]) -> JointTrajectory:
        """Return the one that leaves joints where they are."""
        state = self._valid.get(f"{self._node.get_namespace()}/joint_states", JointState())
        known = dict(zip(state.name, state.position, strict=True))
        point = JointTrajectoryPoint(positions=[known.get(name, 0.0) for name in joints])
        point.time_from_start.sec = 1
        return JointTrajectory(joint_names=list(joints), points=[point])

    def _publisher(self, to: Entrance) -> Any:
        """Return a publisher that the node hears."""
        infos = self._node.get_subscriptions_info_by_topic(to.name)
        latched = DurabilityPolicy.TRANSIENT_LOCAL
        durable = any(info.qos_profile.durability == latched for info in infos)
        profile = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.RELIABLE)
        if durable:
            profile.durability = latched
        publisher = self._node.create_publisher(interface(to.type), to.name, profile)
        with suppress(NoAnswerError):
            self._client.wait(publisher.get_subscription_count, MATCH, to.node)
        return publisher

    def _client_of(self, name: str, make: Any) -> Any:
        if name not in self._clients:
            self._clients[name] = make()
        return self._clients[name]

    def _call(self, name: str, kind: Any, request: Any) -> Any:
        return self._result(self._request(name, kind, request), name)

    def _request(self, name: str, kind: Any, request: Any) -> Future:
        client = self._client_of(name, lambda: self._node.create_client(kind, name))
        self._wait(client.service_is_ready, name)
        return client.call_async(request)

    def _result(self, future: Future, whom: str) -> Any:
        self._wait(future.done, whom)
        return future.result()

    def _wait(self, find: Any, whom: str) -> Any:
        return self._client.wait(find, ANSWER, whom)
