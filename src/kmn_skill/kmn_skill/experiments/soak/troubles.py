"""What goes wrong while a goal is pursued."""

from __future__ import annotations

import argparse
import os
import resource
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from random import Random

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState

from kmn_skill.experiments.kill_nodes import KilledSystem
from kmn_skill.experiments.settings import Experiment
from kmn_skill.experiments.soak.settings import SoakSettings
from kmn_skill.experiments.soak.usage import UsageLog

DEPTH = 10
RATE = 5.0  # pictures a simulated second of a recording
QUIET = ("viewer",)  # nodes that report nothing
TROUBLES = ("kill", "flood", "slow", "clock", "disk")
FLOODED = (JointState, "joint_states"), (Image, "depth/image")


class TroubledSystem(KilledSystem):
    """A system that things happen to, and that is watched meanwhile.

    Parameters
    ----------
    log
        What the nodes take of the machine.

    Attributes
    ----------
    frames_lost
        On the way to morph_node.
    """

    def __init__(
        self,
        options: argparse.Namespace,
        experiment: Experiment,
        settings: SoakSettings,
        log: UsageLog,
    ) -> None:
        sim = {**experiment.evaluation._asdict(), "seed": options.seed}
        super().__init__(sim, options, experiment)
        self._settings, self._log, self.frames_lost = settings, log, 0
        self._lost_before = 0  # of the life of morph_node that is

    @property
    def nodes(self) -> list[str]:
        """Names of the nodes."""
        return list(self._processes)

    def watch(self, hours: float) -> None:
        """Note what the nodes take now, so many hours after the start."""
        for name, process in self._processes.items():
            self._log.add(name, process.pid, hours)

    def happen(self, trouble: str, random: Random) -> str:
        """Let one of `TROUBLES` happen, and return to what it happened."""
        act: dict[str, Callable[[Random], str]] = {
            "kill": self._kill,
            "flood": self._flood,
            "slow": self._slow,
            "clock": self._jump,
            "disk": self._fill_disk,
        }
        return act[trouble](random)

    def where(self) -> str:
        """Return where each thread of the nodes is."""
        running = {name: one for name, one in self._processes.items() if one.is_running()}
        return "\n".join(f"{name}:\n{process.where()}" for name, process in running.items())

    def revive(self) -> list[str]:
        """Start what has ended by itself, and return it."""
        dead = [name for name, process in self._processes.items() if not process.is_running()]
        for name in dead:
            self.restart(name)
        return dead

    def restart(self, node: str) -> None:
        """Kill a node and start it again."""
        if node in QUIET:
            self._processes[node].kill()
            self._processes[node].start()
        else:
            super().restart(node)

    def _kill(self, random: Random) -> str:
        node = random.choice(self.nodes)
        self.restart(node)
        return node

    def _flood(self, random: Random) -> str:
        """Send foreign messages to what the nodes listen to, as fast as it goes."""
        flood = self._settings.flood
        publishers = [self._node.create_publisher(kind, name, DEPTH) for kind, name in FLOODED]
        states = JointState(name=["foreign"], position=[random.uniform(-1.0, 1.0)])
        image = Image(height=4, width=4, step=16, encoding="32FC1", data=bytes(64))
        for _ in range(int(flood.seconds * flood.rate)):
            for publisher, message in zip(publishers, (states, image), strict=True):
                message.header.stamp = self._node.get_clock().now().to_msg()
                publisher.publish(message)
            self._client.pause(1.0 / flood.rate)
        for publisher in publishers:
            self._node.destroy_publisher(publisher)
        return " and ".join(name for _, name in FLOODED)

    def _slow(self, random: Random) -> str:
        """Stop a process again and again."""
        slow, node = self._settings.slow, random.choice(self.nodes)
        pid = self._processes[node].pid
        for _ in range(slow.bursts):
            os.kill(pid, signal.SIGSTOP)
            try:
                self._client.pause(slow.stopped)
            finally:
                os.kill(pid, signal.SIGCONT)
            self._client.pause(slow.running)
        return node

    def _jump(self, random: Random) -> str:
        """Let the clock of all nodes jump forwards, from where sim_node takes it back."""
        topic = f"{self._node.get_namespace()}/clock"
        publisher = self._node.create_publisher(Clock, topic, QoSProfile(depth=1))
        now = self._truth.header.stamp if self._truth is not None else Time()
        jumped = Time(sec=now.sec + int(self._settings.clock_jump), nanosec=now.nanosec)
        self._client.wait(publisher.get_subscription_count, self._timeouts.scene, "the nodes")
        publisher.publish(Clock(clock=jumped))
        self._client.pause(self._settings.period)
        self._node.destroy_publisher(publisher)
        return f"by {self._settings.clock_jump:g} s"

    def _fill_disk(self, random: Random) -> str:
        """Let sim_node record to where there is no room."""
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            with full_disk(folder, self._processes["sim_node"].pid, self._settings.disk) as disk:
                for file in (folder / "full.gif", None):
                    self.record(file, RATE)
                    self._client.pause(self._settings.period)
                left = [file.name for file in folder.iterdir()]
        return f"sim_node by {disk}, left: {', '.join(left) or 'nothing'}"

    def _hear(self, message: DiagnosticArray) -> None:
        super()._hear(message)
        for status in message.status:
            for value in status.values:
                if value.key == "frames_lost" and "morph_node" in status.name:
                    now = int(value.value)
                    self.frames_lost += max(now - self._lost_before, 0)
                    self._lost_before = now


@contextmanager
def full_disk(folder: Path, pid: int, size: int) -> Iterator[str]:
    """Let so many bytes be written to a folder up to the end of a context, and yield by what.

    By a tmpfs where one can be mounted, else by the limit of a process for all of its files.
    """
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(folder)]
    mounted = not subprocess.run(command, capture_output=True).returncode
    free = resource.RLIM_INFINITY
    if not mounted:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (size, free))
    try:
        yield "tmpfs" if mounted else "file-size limit"
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(folder)], check=True)
        else:
            with suppress(ProcessLookupError):
                resource.prlimit(pid, resource.RLIMIT_FSIZE, (free, free))
