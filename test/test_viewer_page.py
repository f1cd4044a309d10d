"""The viewer as a program, and its page in a browser: it draws, and its button opens a door."""

from __future__ import annotations

import io
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import numpy as np
import pytest
from rclpy.node import Node
from sensor_msgs.msg import JointState

from programs import TIMEOUT, parameters, read_until, start

pytest.importorskip("viser")
playwright = pytest.importorskip("playwright.sync_api")
pytest.importorskip("pybullet")
Image = pytest.importorskip("PIL.Image")
BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
WEBGL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
ALONE = ("--no-sandbox", "--disable-dev-shm-usage")  # in containers
PATIENCE = 1e3 * TIMEOUT  # milliseconds


@contextmanager
def running(package: str, executable: str, domain: int, *given: str) -> Iterator[Any]:
    """Run a node up to the end of a context, and see that it ends in order."""
    process = start([sys.executable, "-m", package, executable], domain, *given)
    try:
        yield process
        process.send_signal(signal.SIGINT)
        rest, _ = process.communicate(timeout=60)
        assert process.returncode == 0, rest
    finally:
        process.kill()


@contextmanager
def viewer(domain: int, *given: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run a viewer at a free port; yield it with its address."""
    with running("kmn_perception", "viewer", domain, *parameters("port:=0", *given)) as process:
        told = re.search(r"the view is at (\S+)", read_until("the view is at", process))
        assert told is not None
        yield process, told[1]


@pytest.fixture
def browser() -> Iterator[Any]:
    """Return a browser that draws WebGL without a graphics card."""
    if BROWSER is None:
        pytest.skip("there is no Chromium")
    with playwright.sync_playwright() as started:
        opened = started.chromium.launch(executable_path=BROWSER, args=[*WEBGL, *ALONE])
        yield opened
        opened.close()


def test_a_port_that_is_taken_is_named(domain: int) -> None:
    with viewer(domain) as (_, address):
        port = address.rpartition(":")[2]
        process = start(
            [sys.executable, "-m", "kmn_perception", "viewer"],
            domain,
            *parameters(f"port:={port}"),
        )
        printed, _ = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 1
    assert f"viewer: cannot listen at 127.0.0.1, port {port}: Address already in use" in printed
    assert "Traceback" not in printed


def test_the_page_draws_and_its_button_opens_a_door(graph: Any, domain: int, browser: Any) -> None:
    hinges: list[float] = []
    listener = graph.start(lambda context: Node("listener", context=context))
    listener.create_subscription(
        JointState, "door_state", lambda state: hinges.append(state.position[0]), 10
    )
    clock = parameters("use_sim_time:=true")
    with ExitStack() as stack:
        # What is perceived is the truth here: the page and the skill are tested.
        simulated = parameters("publish_clock:=true", "camera_rate:=2.0", "image:=true")
        truth = ["-r", "ground_truth:=morphing_parameters"]
        stack.enter_context(running("kmn_sim", "sim_node", domain, *simulated, *truth))
        stack.enter_context(running("kmn_skill", "skill_node", domain, *clock))
        _, address = stack.enter_context(viewer(domain, "use_sim_time:=true"))
        page = browser.new_page(viewport={"width": 540, "height": 320})
        page.goto(address)
        page.get_by_text("idle").wait_for(timeout=PATIENCE)
        drawn = picture(page)
        empty = (drawn == 255).all(axis=-1).mean()
        assert 1.0 - empty > 0.05, "the page is white"
        assert abs(hinges[-1]) < 0.01
        page.get_by_role("button", name="open", exact=True).click(timeout=PATIENCE)
        page.get_by_text("succeeded").wait_for(timeout=PATIENCE)
        assert hinges[-1] < -0.8
        changed = (picture(page) != drawn).any(axis=-1).mean()
        assert changed > 0.01, "the robot has not moved on the page"
        page.get_by_role("button", name="reset", exact=True).click(timeout=PATIENCE)
        page.get_by_text("all is where it started").wait_for(timeout=PATIENCE)
        graph.wait_for(lambda: abs(hinges[-1]) < 0.01)


def picture(page: Any) -> np.ndarray[Any, Any]:
    """Return the pixels of the scene, which the panel at the right does not cover."""
    data = page.screenshot(timeout=PATIENCE)
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))[:, :300]
