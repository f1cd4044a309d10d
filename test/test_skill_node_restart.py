"""A skill_node that was ended while the hand was at the handle opens the door when it is back."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from rclpy.parameter import Parameter

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import SPEED, DoorClient  # noqa: E402
from kmn_perception.ros.morph_node import MorphNode  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

PATIENT = {
    "use_sim_time": True,
    "min_consistent_frames": 2,
    "max_age": 20.0,
    "door_timeout": 40.0,
    "state_timeout": 1.0 * SPEED,
    "start_delay": 0.3 * SPEED,
    "part_duration": 2.0 * SPEED,
    "part_overlap": 0.4 * SPEED,
}


class Restarted:
    """A system whose skill_node ends, and comes back knowing nothing."""

    def __init__(self, graph: Any) -> None:
        self._graph, self._node = graph, ExitStack()
        self.client = graph.start(lambda **_: DoorClient(graph))
        self.client.start_simulator()
        clock = Parameter("use_sim_time", value=True)
        reliable = Parameter("reliability", value="reliable")
        graph.start(MorphNode, parameter_overrides=[clock, reliable])
        self.start()
        self.client.graph.wait_for(lambda: self.client.perceived)

    def start(self) -> None:
        overrides = [Parameter(name, value=value) for name, value in PATIENT.items()]
        self._node.enter_context(self._graph.running(SkillNode, parameter_overrides=overrides))
        self.client.graph.wait_for(self.client.action.server_is_ready)

    def end(self) -> None:
        self._node.close()
        self.client.graph.wait_for(lambda: not self.client.action.server_is_ready())


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return where nodes keep what they remember."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("ros_home")
        patch.setenv("ROS_HOME", str(folder))
        yield folder


@pytest.fixture(scope="module")
def system(graph: Any, home: Path) -> Iterator[Restarted]:
    made = Restarted(graph)
    yield made
    made.end()
    made.client.stop_simulator()


@pytest.mark.parametrize(
    ("phase", "progress"), [pytest.param("press", 0.0, marks=pytest.mark.slow), ("open", 0.8)]
)
def test_the_next_goal_opens_the_door(system: Restarted, phase: str, progress: float) -> None:
    client = system.client
    client.start_anew()
    client.send()
    client.wait_for_phase(phase)
    with client.pace(0.2):  # which leaves time to end the node before the phase is over
        client.wait_for_phase(phase, progress)
        system.end()
    system.start()
    status, result = client.result(client.send())
    assert result.reason == ""
    assert status == GoalStatus.STATUS_SUCCEEDED
    phases = list(dict.fromkeys(feedback.phase for feedback in client.feedback))
    assert phases[:3] == ["wait", "plan", "release"]  # it knows where the hand is
    # A door that is let go moves a little by itself, which nobody tells.
    client.graph.wait_for(lambda: client.doors[-1].position[0] < -0.7)
