"""A gripper that takes ``GripperCommand``: in the simulator, and in the hand that opens a door."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand
from rclpy.parameter import Parameter

from kmn_perception.configuration import resources

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import PATIENT, TrueDoorClient  # noqa: E402
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

ACTION = "l_gripper_controller/gripper_cmd"


class GripperClient(TrueDoorClient):
    """Moves the gripper."""

    def __init__(self, graph: Any) -> None:
        super().__init__(graph)
        self.gripper = LockedActionClient(self, GripperCommand, ACTION)
        self.gripper_feedback: list[GripperCommand.Feedback] = []

    def command(self, position: float, max_effort: float = 0.0) -> Any:
        """Send the gripper to a position; return the goal's handle."""
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = position, max_effort
        return self.wait(
            self.gripper.send_goal_async(
                goal, lambda message: self.gripper_feedback.append(message.feedback)
            )
        )

    def end(self, handle: Any) -> tuple[int, GripperCommand.Result]:
        answer = self.wait(handle.get_result_async())
        return answer.status, answer.result


@pytest.fixture(scope="module")
def system(graph: Any, tmp_path_factory: pytest.TempPathFactory) -> Iterator[GripperClient]:
    """Return the client of a robot whose file names the action."""
    values = yaml.safe_load(resources.find("config/robots", "pr2").read_text())
    values["controllers"]["gripper"].update(type="gripper_command", name=ACTION)
    robot = tmp_path_factory.mktemp("robot") / "robot.yaml"
    robot.write_text(yaml.safe_dump(values, sort_keys=False))
    motions = resources.find("config/skill/prototypes", "pr2/door", ".json")
    robot.with_suffix("").mkdir()
    shutil.copy(motions, robot.with_suffix(""))
    made = graph.start(lambda **_: GripperClient(graph))
    made.start_simulator(robot=str(robot))
    given = {**PATIENT, "control": "action", "use_sim_time": True, "robot": str(robot)}
    overrides = [Parameter(name, value=value) for name, value in given.items()]
    graph.start(SkillNode, parameter_overrides=overrides)
    try:
        assert made.gripper.wait_for_server(30.0)
        assert made.action.wait_for_server(30.0)
        made.graph.wait_for(lambda: made.perceived)
        yield made
    finally:
        made.stop_simulator()


def test_a_gripper_goes_where_it_is_told_to(system: GripperClient) -> None:
    status, result = system.end(system.command(0.4))
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert (result.reached_goal, result.stalled) == (True, False)
    assert result.position == pytest.approx(0.4, abs=0.02)
    assert system.gripper_feedback
    assert not system.command(5.0).accepted


def test_a_new_command_ends_the_one_that_runs_and_a_cancelled_one_holds(
    system: GripperClient,
) -> None:
    with system.pace(0.2):
        first, second = system.command(0.0), system.command(0.5)
        assert system.end(first)[0] == GoalStatus.STATUS_ABORTED
        system.wait(second.cancel_goal_async())
        status, result = system.end(second)
    assert status == GoalStatus.STATUS_CANCELED
    assert result.position < 0.45


def test_a_door_is_opened_by_a_gripper_that_stalls_about_its_handle(system: GripperClient) -> None:
    system.assert_it_opens()
    assert not system.sent
    status, result = system.end(system.command(0.0))
    assert status == GoalStatus.STATUS_ABORTED
    assert (result.reached_goal, result.stalled) == (False, True)
    assert result.position > 0.05
