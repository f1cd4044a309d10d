"""The executable ``replay``: the README's line, bad arguments, and how it ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix
from rclpy.node import Node
from std_msgs.msg import String

from kmn_perception.bags.rosbag2 import write_bag
from talk import STRING, listen, said, spin_until

REPLAY = [sys.executable, "-m", "kmn_perception", "replay"]


def test_the_readmes_line_replays_under_another_name(player: Node, tmp_path: Path) -> None:
    readme = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
    (line,) = re.findall(
        r"^\./run (kmn_perception replay .* --topic-map .*)$", readme, re.MULTILINE
    )
    package, executable, bag, *arguments = line.split()
    write_bag(
        tmp_path / bag,
        {"/camera/depth/points": STRING},
        [said("/camera/depth/points", 0, "hello")],
    )
    heard = listen(player, String, "/points")
    installed = f"{get_package_prefix(package)}/lib/{package}/{executable}"
    process = subprocess.Popen(
        [installed, bag, *arguments],
        cwd=tmp_path,
        env={**os.environ, "ROS_DOMAIN_ID": str(player.context.get_domain_id())},
        stderr=subprocess.PIPE,
        text=True,
    )
    assert spin_until(player, lambda: bool(heard)), process.communicate()[1]
    assert heard[0].data == "hello"
    assert process.wait(timeout=60) == 0


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
