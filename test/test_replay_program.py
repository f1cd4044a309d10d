"""The executable ``replay``: bad arguments, and how it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rclpy.node import Node
from std_msgs.msg import String

from talk import listen, spin_until

REPLAY = [sys.executable, "-m", "kmn_perception", "replay"]


def _run_replay(domain: int, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*REPLAY, *arguments],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        stderr=subprocess.PIPE,
        text=True,
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["nowhere"], "nowhere: no such bag"),
        (["BAG", "--rate", "0"], "0 is not a positive number"),
        (["BAG", "--rate", "nan"], "nan is not a positive number"),
        (["BAG", "--topics", "/points"], "no topic /points; the bag holds /a, /b"),
        (["BAG", "--topic-map", "/a=/b"], "/a=/b is not of the form FROM:=TO"),
        (["BAG", "--topic-map", "/a:=no good"], "Invalid topic name"),
    ],
)
def test_bad_arguments_end_with_a_message(
    arguments: list[str], message: str, domain: int, talk: Path
) -> None:
    process = _run_replay(domain, *[str(talk) if text == "BAG" else text for text in arguments])
    _, errors = process.communicate(timeout=60)
    assert process.returncode in (1, 2)
    assert message in errors
    assert "Traceback" not in errors


def test_ctrl_c_ends_an_endless_replay_without_a_traceback(
    domain: int, player: Node, talk: Path
) -> None:
    heard = listen(player, String, "a")
    process = _run_replay(domain, str(talk), "--loop")
    try:
        assert spin_until(player, lambda: len(heard) > 6), "it does not start again at the end"
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=60)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in errors
