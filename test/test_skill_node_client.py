"""Clients of skill_node in other processes: its end, and the program ``open_door``.

The simulator gives the true parameters of its door in place of perception.
"""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from domain_coordinator import domain_id
from std_srvs.srv import Trigger

from kmn_msgs.action import OpenDoor
from kmn_perception.ros.node_process import parameter_arguments
from programs import INTERRUPTS, read_until, start

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import CAMERA_RATE, SEED, SPEED, DoorClient  # noqa: E402

TIMEOUT = 60.0  # seconds
SIM, SKILL = ("kmn_sim", "sim_node"), ("kmn_skill", "skill_node")
WORLD = {
    "placement": "random",
    "seed": SEED,
    "publish_clock": True,
    "camera_rate": CAMERA_RATE,
    "real_time_factor": SPEED,
}
PATIENT = {
    "use_sim_time": True,
    "max_age": 600.0,
    "min_consistent_frames": 1,
    "door_timeout": 600.0,
    "state_timeout": 1.0 * SPEED,
    "start_delay": 0.3 * SPEED,
    "part_duration": 2.0 * SPEED,
    "part_overlap": 0.4 * SPEED,
}
TRUTH = ("-r", "morphing_parameters:=ground_truth")
OPEN_DOOR = [sys.executable, "-m", "kmn_skill", "open_door"]


@contextmanager
def program(
    executable: tuple[str, str], domain: int, *arguments: str
) -> Iterator[subprocess.Popen[str]]:
    """Run a node as a program, at the longest up to the end of the context."""
    process = start([sys.executable, "-m", *executable], domain, *arguments)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def client(graph: Any, domain: int) -> Iterator[DoorClient]:
    made = graph.start(lambda **_: DoorClient(graph))
    with program(SIM, domain, *parameter_arguments(WORLD)):
        made.graph.wait_for(lambda: made.joints and made.doors)
        yield made


@pytest.mark.parametrize("interrupt", INTERRUPTS)
@pytest.mark.parametrize(
    ("phase", "source"),
    [("wait", ("-r", "morphing_parameters:=nothing")), ("plan", TRUTH), ("reach", TRUTH)],
)
def test_the_client_of_a_goal_is_told_that_the_node_ended(
    client: DoorClient, domain: int, phase: str, source: tuple[str, ...], interrupt: signal.Signals
) -> None:
    arguments = (*source, *parameter_arguments(PATIENT))
    with program(SKILL, domain, *arguments) as process:
        client.wait_for_server()
        handle = client.send()
        client.wait_for_phase(phase)
        ended = handle.get_result_async()
        process.send_signal(interrupt)
        answer = client.wait(ended)
        assert (answer.status, answer.result.success) == (GoalStatus.STATUS_ABORTED, False)
        assert answer.result.reason == "the node ended"
        assert answer.result.error_code == OpenDoor.Result.NODE_ENDED
        printed, _ = process.communicate(timeout=TIMEOUT)
        assert process.returncode == 0, printed
        assert "Traceback" not in printed
    client.assert_it_holds()
    client.graph.wait_for(lambda: not client.action.server_is_ready())  # nor is the next one it


@pytest.fixture(scope="module")
def skill(client: DoorClient, domain: int) -> Iterator[None]:
    """Run a skill_node that knows the door."""
    with program(SKILL, domain, *TRUTH, *parameter_arguments(PATIENT)):
        client.wait_for_server()
        yield


def open_door(domain: int, *options: str) -> tuple[int, str]:
    """Run the program; return its exit status and what it printed."""
    process = start([*OPEN_DOOR, *options], domain)
    printed, _ = process.communicate(timeout=10.0 * TIMEOUT)
    return process.returncode, printed


@pytest.mark.usefixtures("skill")
def test_open_door_opens_the_door_and_tells_the_phases(client: DoorClient, domain: int) -> None:
    assert client.call(client.reset, Trigger.Request()).success
    status, printed = open_door(domain, "--door-angle", "-0.85")
    assert status == 0, printed
    *phases, last = printed.splitlines()
    assert [line.split()[0] for line in phases if "open by" in line] == [
        "wait", "plan", "reach", "grasp", "press", "open"
    ]  # fmt: skip
    assert last.startswith("the door is open by -0.8")
    client.wait_for_door(-0.85)


@pytest.mark.usefixtures("skill")
def test_interrupted_open_door_cancels_the_goal_and_waits_for_its_result(
    client: DoorClient, domain: int
) -> None:
    assert client.call(client.reset, Trigger.Request()).success
    process = start([*OPEN_DOOR, "--mode", "push"], domain)
    read_until("  reach", process)
    client.sent.clear()
    process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert rest.splitlines()[-2:] == [
        "cancelling the goal",
        "the door was not opened, CANCELLED: the goal was cancelled",
    ]
    client.assert_it_holds()


@pytest.mark.usefixtures("skill")
def test_open_door_says_why_a_goal_failed(domain: int) -> None:
    status, printed = open_door(domain, "--handle-angle", "-3", "--mode", "push")
    assert status == 1
    assert "the door was not opened, INVALID_GOAL: -3 is beyond the joint" in printed


def test_open_door_refuses_an_angle_beside_a_mode(domain: int) -> None:
    status, printed = open_door(domain, "--mode", "push", "--door-angle", "0.3")
    assert status == 2
    assert "not allowed with" in printed


def test_open_door_without_a_server_says_so_in_one_line() -> None:
    with domain_id() as empty:
        status, printed = open_door(empty)
    assert status == 1
    assert printed.splitlines() == [
        "open_door: no action server 'open_door' within 10 s, is skill_node running?"
    ]
