"""Nodes that are stopped at any moment end quietly, on an idle machine and on a busy one."""

from __future__ import annotations

import multiprocessing
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

import pytest

from programs import TIMEOUT, read_until, start

NODES = {
    "morph_node": ("kmn_perception", "estimating morphing parameters"),
    "sim_node": ("kmn_sim", "simulating model"),
    "skill_node": ("kmn_skill", "opening 'door'"),
}
WORKING = """
import time
from rclpy.node import Node
from kmn_perception.ros.node_program import run_node

class Working(Node):
    def __init__(self):
        super().__init__("working")
        self.create_timer(0.01, self.work)

    def work(self):
        print("at work", flush=True)
        time.sleep(0.3)
        self.get_node_names()  # raises where the signal has shut the context down

raise SystemExit(run_node("morph_node", "", Working))
"""

RUNNING = """
from threading import Event, Thread
from kmn_perception.ros.program import ros_session

def deep(left):
    return left and deep(left - 1)

def run():
    while True:
        deep(200)

with ros_session("running"):
    for _ in range(4):
        Thread(target=run, daemon=True).start()
    print("running", flush=True)
    Event().wait()
"""


def burn() -> None:
    while True:
        pass


@contextmanager
def busy_machine(processes: int) -> Iterator[None]:
    """Keep so many processors at work up to the end of the context."""
    burning = [multiprocessing.Process(target=burn, daemon=True) for _ in range(processes)]
    for process in burning:
        process.start()
    try:
        yield
    finally:
        for process in burning:
            process.kill()
            process.join()


def stop_later(process: subprocess.Popen[str], number: signal.Signals, delay: float) -> str:
    """Stop a process after some seconds, twice as a launch file and a terminal do together."""
    time.sleep(delay)
    process.send_signal(number)
    time.sleep(0.001)
    process.send_signal(number)
    rest, _ = process.communicate(timeout=TIMEOUT)
    return rest


@pytest.mark.parametrize(("busy", "times"), [(0, 2), pytest.param(4, 2, marks=pytest.mark.slow)])
@pytest.mark.parametrize("node", NODES)
def test_nodes_stop_quietly_at_any_moment(node: str, busy: int, times: int, domain: int) -> None:
    pytest.importorskip("robotic")
    package, greeting = NODES[node]
    moments = random.Random(busy)
    with busy_machine(busy):
        for turn in range(times):
            process = start([sys.executable, "-m", package, node], domain)
            try:
                read_until(greeting, process)
                number = (signal.SIGINT, signal.SIGTERM)[turn % 2]
                rest = stop_later(process, number, moments.choice([0.0, 0.01, 0.1, 1.0]))
            finally:
                process.kill()
            assert (process.returncode, "Traceback" in rest) == (0, False), rest


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_callback_that_is_at_work_may_communicate_to_its_end(
    number: signal.Signals, domain: int
) -> None:
    process = start([sys.executable, "-c", WORKING], domain)
    try:
        read_until("at work", process)
        process.send_signal(number)
        rest, _ = process.communicate(timeout=TIMEOUT)
    finally:
        process.kill()
    assert (process.returncode, "Traceback" in rest) == (0, False), rest


def test_a_node_tells_where_its_threads_are_and_goes_on(domain: int) -> None:
    """A callback that hangs is named."""
    process = start([sys.executable, "-c", WORKING], domain)
    try:
        read_until("at work", process)
        process.send_signal(signal.SIGUSR1)
        assert " in work" in read_until(" in run_node", process)
        read_until("at work", process)
    finally:
        process.kill()


def test_a_program_whose_threads_run_may_be_asked_where_they_are(domain: int) -> None:
    """What reads the frames of threads that run meanwhile crashes after some twenty times."""
    process = start([sys.executable, "-c", RUNNING], domain)
    try:
        read_until("running", process)
        with ThreadPoolExecutor(1) as reader:
            assert process.stdout is not None
            printed = reader.submit(process.stdout.read)
            for _ in range(100):
                process.send_signal(signal.SIGUSR1)
                time.sleep(0.03)
            process.send_signal(signal.SIGTERM)
            assert process.wait(TIMEOUT) == 128 + signal.SIGTERM
            assert printed.result().count(" in deep") > 100
    finally:
        process.kill()
