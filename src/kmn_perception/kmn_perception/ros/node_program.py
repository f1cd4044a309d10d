"""The start-up path and the end of all nodes."""

from __future__ import annotations

import argparse
import multiprocessing
import os
import select
import signal
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from threading import Event
from types import FrameType
from typing import TypeVar

from rclpy.node import Node
from rclpy.task import Future

from kmn_perception.configuration.node_parameters import describe_parameters
from kmn_perception.ros.parameter_files import useless_files
from kmn_perception.ros.parameters import foreign_parameters
from kmn_perception.ros.program import ros_session, split_arguments
from kmn_perception.ros.shared_memory import lost_ports
from kmn_perception.ros.steadfast_executor import SteadfastExecutor

STOPPING = (signal.SIGINT, signal.SIGTERM)
TURNS = 10  # of the executor, for what the last words of a node bring about, as an action's result
TURN_TIMEOUT = 1.0  # seconds
LISTENING_PERIOD = 2.0  # seconds between two looks whether messages can reach the node

SomeNode = TypeVar("SomeNode", bound=Node)


def run_node(
    name: str,
    description: str | None,
    make_node: Callable[[], SomeNode],
    say_last_words: Callable[[SomeNode], None] = lambda node: None,
) -> int:
    """Run a node until it is stopped, and return the exit status; being stopped is 0.

    A node that no message can reach any more, see `lost_ports`, starts anew in the same process.

    Parameters
    ----------
    name
        Of the program and of its parameters, see `load_node_parameters`.
    description
        What the node does, for ``--help``.
    make_node
        Makes the node; its errors are of `OSError`, `ValueError` or `ParameterException`.
    say_last_words
        Called when the node is stopped. Meanwhile, and until what it brought about is done, the
        node communicates and its callbacks are executed.
    """
    own, ros = split_arguments(sys.argv[1:])
    argparse.ArgumentParser(
        prog=name,
        description=description,
        epilog=describe_parameters(name),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage=f"{name} [-h] [--ros-args -p NAME:=VALUE --params-file FILE -r FROM:=TO ...]",
    ).parse_args(own)
    with ros_session(name):
        stop = _Stop()
        node = make_node()
        useless = useless_files(node.get_fully_qualified_name(), ros)
        for text in [*foreign_parameters(node), *useless]:
            node.get_logger().warning(text)
        stop.in_order = True
        is_deaf = _serve(node, stop, say_last_words)
    if is_deaf:
        sys.stdout.flush()
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    return 0


class _Stop:
    """The wish that a node stops, by a signal.

    While the node starts, it ends at once: an exception could get lost in the libraries that are
    at work then. Later on, the signal only wakes the one who waits: nothing is interrupted.
    """

    def __init__(self) -> None:
        self.in_order = False
        self._awake, self._alarm = os.pipe()
        for number in STOPPING:  # a shell may have had them ignored
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        if not self.in_order:
            for child in multiprocessing.active_children():
                child.terminate()
            os._exit(0)
        self.set()

    def set(self) -> None:
        """Wish it."""
        os.write(self._alarm, b"!")

    def wait(self, period: float) -> bool:
        """Wait until it is wished, but not longer than a period (s); return whether it is."""
        return bool(select.select([self._awake], [], [], period)[0])


def _serve(node: SomeNode, stop: _Stop, say_last_words: Callable[[SomeNode], None]) -> bool:
    """Execute callbacks in a thread until they fail or a signal comes, and destroy the node.

    Returns
    -------
    is_deaf
        Whether it ended since no message could reach it.
    """
    executor = SteadfastExecutor(node)
    done = Future()

    def spin() -> None:
        try:
            executor.spin_until_future_complete(done)
        finally:
            stop.set()

    with ThreadPoolExecutor(1, thread_name_prefix="executor") as thread:
        spinning = thread.submit(spin)
        try:
            is_deaf = _wait(node, stop)
            say_last_words(node)
            for _ in range(0 if spinning.done() else TURNS):
                turn = Event()
                executor.create_task(turn.set)
                turn.wait(TURN_TIMEOUT)
        finally:
            done.set_result(None)
        spinning.result()  # raises what a callback raised
    node.destroy_node()
    executor.shutdown()
    return is_deaf


def _wait(node: Node, stop: _Stop) -> bool:
    """Wait for a signal, or until the node is deaf; return whether it is."""
    before: list[int] = []
    while not stop.wait(LISTENING_PERIOD):
        lost = lost_ports()
        if lost and lost == before:  # a port may be on its way to another file
            node.get_logger().error(
                f"another process removed the shared memory (ports {lost}) by which messages reach "
                "this node, as can happen where nodes are killed; it starts anew"
            )
            return True
        before = lost
    return False
