"""skill_node as a program: how it starts, what it says when it cannot, and how it ends."""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml
from rclpy.node import Node
from rclpy.parameter import Parameter

from kmn_msgs.action import OpenDoor
from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from programs import BROKEN_FILES, INTERRUPTS, assert_file_is_refused, parameters, read_until, start

pytest.importorskip("robotic")
from kmn_skill.ros.locked_action_client import LockedActionClient  # noqa: E402
from kmn_skill.ros.skill_node import SkillNode  # noqa: E402

COMMAND = [sys.executable, "-m", "kmn_skill", "skill_node"]


def children(pid: int) -> list[str]:
    """Return the numbers of the processes that a process started."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return [child for task in tasks for child in task.read_text().split()]


def runs(pid: str) -> bool:
    """Tell whether a process runs; one that ended but is not waited for has no command line."""
    try:
        return bool(Path(f"/proc/{pid}/cmdline").read_text())
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("interrupt", INTERRUPTS)
def test_interrupted_it_ends_quietly_and_its_planner_with_it(
    interrupt: signal.Signals, domain: int
) -> None:
    process = start(COMMAND, domain)
    read_until("opening 'door'", process)
    started = children(process.pid)
    assert started
    process.send_signal(interrupt)
    rest, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert "Traceback" not in rest
    deadline = time.monotonic() + 10.0
    while any(map(runs, started)):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_a_destroyed_node_offers_its_action_no_more(graph: Any) -> None:
    client = graph.start(lambda context: Node("client", context=context))
    action = LockedActionClient(client, OpenDoor, "open_door")
    with graph.running(SkillNode):
        assert action.wait_for_server(60.0)
    graph.wait_for(lambda: not action.server_is_ready())
    action.destroy()


def test_a_model_that_lacks_what_its_action_grasps_is_refused(graph: Any, tmp_path: Path) -> None:
    values = yaml.safe_load(resources.find("config/models", "door").read_text())
    values["bodies"]["flap"] = values["bodies"].pop("handle")
    values["joints"]["handle"]["body"] = "flap"
    file = tmp_path / "other.yaml"
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    given = [Parameter("model", value=str(file))]
    with (
        pytest.raises(ConfigurationError, match="grasp: 'body' must be one of panel, flap"),
        graph.running(SkillNode, parameter_overrides=given),
    ):
        pass


@pytest.mark.parametrize(
    ("parameter", "text"),
    [
        ("model:=elephant", "'elephant' is neither a file nor"),
        ("model:=box_a", "'model' must be that of an object whose file has 'actions'"),
        ("retries:=-1", "retries"),
        ("world_frame:=''", "'world_frame' is empty"),
        ("surroundings:=moat", "'surroundings' must be one of none, wall"),
    ],
)
def test_a_wrong_parameter_ends_it_with_the_reason(domain: int, parameter: str, text: str) -> None:
    process = start(COMMAND, domain, *parameters(parameter))
    printed, _ = process.communicate(timeout=120)
    assert process.returncode == 1
    assert "Traceback" not in printed
    assert text in printed


@pytest.mark.parametrize("text", BROKEN_FILES)
def test_a_missing_or_broken_parameter_file_is_named_in_one_line(
    domain: int, tmp_path: Path, text: str | None
) -> None:
    assert_file_is_refused(COMMAND, domain, tmp_path, text)
