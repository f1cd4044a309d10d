"""The page of the start: its commands give the parameters of a recording under other names."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from kmn_perception.bags.example_bag import make_example_bag
from kmn_perception.bags.rosbag2 import Message, read_messages, read_topics, write_bag
from programs import TIMEOUT, read_until

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/start.md").read_text(encoding="utf-8")
RECORDED = {
    "/depth/image": "/camera/depth/image_raw",
    "/depth/camera_info": "/camera/depth/camera_info",
}


def record(folder: Path) -> None:
    """Write the real frames as a user's camera would have published them."""
    example = folder / "example"
    make_example_bag(example, rate=2.0)
    topics, messages = read_topics(example), read_messages(example, list(RECORDED))
    types = {name: topics[topic].type for topic, name in RECORDED.items()}
    renamed = (Message(RECORDED[each.topic], each.stamp, each.data) for each in messages)
    write_bag(folder / "my_bag", types, renamed)


def test_the_pages_commands_give_the_parameters_of_a_recording(domain: int, tmp_path: Path) -> None:
    record(tmp_path)
    (tmp_path / "config").symlink_to(ROOT / "config")
    blocks = re.findall(r"```bash\n\./run (.*?)```", PAGE, flags=re.DOTALL)
    topics, estimate, listen, replay = (block.replace("\\\n", "").split() for block in blocks)

    @contextmanager
    def running(command: list[str]) -> Iterator[subprocess.Popen[str]]:
        process = subprocess.Popen(
            [sys.executable, "-m", *command],
            cwd=tmp_path,
            env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            yield process
        finally:
            process.terminate()
            process.communicate(timeout=TIMEOUT)

    with running(topics) as listing:
        assert ", ".join(sorted(RECORDED.values())) in read_until("the bag holds", listing)
    with running(estimate) as node, running(listen) as printer:
        read_until("estimating morphing parameters", node)
        with running(replay):
            line = read_until("OK", printer).splitlines()[-1]
    values = dict(re.findall(r"  (\w+) (-?[\d.]+) ± [\d.]+", line))
    assert list(values) == ["x", "y", "yaw", "x_scaling", "y_scaling", "z_scaling"], line
