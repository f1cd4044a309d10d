"""All nodes take the time from /clock where `use_sim_time` says so, whoever publishes it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState

from kmn_perception.ros.morph_node import MorphNode
from kmn_perception.ros.reports import REPORT_PERIOD
from kmn_perception.ros.stamps import seconds, stamp_of

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from kmn_sim.ros.sim_node import SimNode  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

BEGIN = 5000.0  # of the time here, seconds
PERIOD = 0.02
SIMULATED = [Parameter("use_sim_time", value=True)]


class OtherWorld(Node):
    """Publishes a time of its own, and keeps the stamps of what is told."""

    def __init__(self, **options: Any) -> None:
        super().__init__("other_world", **options)
        self._clock_publisher = self.create_publisher(ClockMessage, "/clock", 10)
        self._begin = time.time()
        self.create_timer(PERIOD, self._tick, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.reports: list[tuple[str, float]] = []
        self.states: list[float] = []
        self.create_subscription(DiagnosticArray, "/diagnostics", self._keep_report, 10)
        self.create_subscription(JointState, "joint_states", self._keep_state, 10)

    def now(self) -> float:
        """Return the time here, seconds."""
        return BEGIN + time.time() - self._begin

    def _tick(self) -> None:
        self._clock_publisher.publish(ClockMessage(clock=stamp_of(self.now())))

    def _keep_report(self, message: DiagnosticArray) -> None:
        self.reports.append((message.status[0].name, seconds(message.header.stamp)))

    def _keep_state(self, message: JointState) -> None:
        self.states.append(seconds(message.header.stamp))


@pytest.fixture(scope="module")
def world(graph: Any) -> Iterator[OtherWorld]:
    with graph.running(OtherWorld) as made:
        yield made


@pytest.mark.parametrize("make", [MorphNode, SimNode, SkillNode], ids=lambda make: make.__name__)
def test_the_nodes_report_by_the_clock(graph: Any, world: OtherWorld, make: type[Node]) -> None:
    with graph.running(make, parameter_overrides=SIMULATED) as node:

        def stamps() -> list[float]:
            name = node.get_fully_qualified_name()
            return [stamp for reported, stamp in world.reports if reported.startswith(name)]

        graph.wait_for(lambda: len(stamps()) > 2)
        first, second, *_ = stamps()[1:]  # before the first one the clock may not have come
    assert BEGIN < first < second < world.now()
    assert second - first == pytest.approx(REPORT_PERIOD, abs=0.5)


def test_a_simulator_without_a_clock_of_its_own_stamps_by_the_clock(
    graph: Any, world: OtherWorld
) -> None:
    world.states.clear()
    with graph.running(SimNode, parameter_overrides=SIMULATED):
        graph.wait_for(lambda: len(world.states) > 100)
    *_, before, last = world.states
    assert BEGIN < before <= last < world.now()


def test_without_the_parameter_the_time_is_the_systems(graph: Any, world: OtherWorld) -> None:
    world.states.clear()
    with graph.running(SimNode):
        graph.wait_for(lambda: len(world.states) > 100)
    assert abs(world.states[-1] - time.time()) < 10.0
