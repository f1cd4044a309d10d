"""A goal that ends because skill_node does: its client gets the result, and the robot holds."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from action_msgs.msg import GoalStatus

from programs import parameters, start

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from door_client import CAMERA_RATE, SEED, DoorClient  # noqa: E402

TIMEOUT = 60.0  # seconds
WORLD = ("placement:=random", f"seed:={SEED}", "publish_clock:=true", f"camera_rate:={CAMERA_RATE}")
PATIENT = ("use_sim_time:=true", "max_age:=600.0", "frames:=1", "door_timeout:=600.0")


@contextmanager
def program(module: str, domain: int, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a node as a program, at the longest up to the end of the context."""
    process = start([sys.executable, "-m", module], domain, *arguments)
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.fixture(scope="module")
def client(graph: Any, domain: int) -> Iterator[DoorClient]:
    made = graph.start(lambda **_: DoorClient(graph))
    with program("kmn_sim.ros.start_sim_node", domain, *parameters(*WORLD)):
        made.graph.wait_for(lambda: made.joints and made.doors)
        yield made


@pytest.mark.parametrize("interrupt", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    ("phase", "source"), [("wait", "nothing"), ("plan", "ground_truth"), ("reach", "ground_truth")]
)
def test_the_client_of_a_goal_is_told_that_the_node_ended(
    client: DoorClient, domain: int, phase: str, source: str, interrupt: signal.Signals
) -> None:
    remap = ("-r", f"morphing_parameters:={source}")
    arguments = (*remap, *parameters(*PATIENT))
    with program("kmn_skill.ros.start_skill_node", domain, *arguments) as process:
        assert client.action.wait_for_server(TIMEOUT)
        handle = client.send()
        client.wait_for_phase(phase)
        ended = handle.get_result_async()
        process.send_signal(interrupt)
        answer = client.wait(ended)
        assert (answer.status, answer.result.success) == (GoalStatus.STATUS_ABORTED, False)
        assert answer.result.reason == "the node ended"
        printed, _ = process.communicate(timeout=TIMEOUT)
        assert process.returncode == 0, printed
        assert "Traceback" not in printed
    client.assert_it_holds()
