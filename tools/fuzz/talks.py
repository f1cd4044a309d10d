"""Hostile messages, requests and goals to nodes in processes of their own."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from random import Random

from tqdm import tqdm

from fuzz.outcome import Fault, Outcome
from fuzz.system import SERVICE, Entrance, FuzzedSystem, line
from kmn_perception.ros.node_process import ProcessError
from kmn_skill.experiments.settings import Experiment

BATCH = 10  # messages between two questions whether their node lives
BETWEEN = 50  # batches between two checks that all nodes do their work
MEMORY = 2**29  # bytes by which a node may grow
TRACEBACK = "Traceback"


def run(cases: int, seed: int, kept: Path) -> list[Outcome]:
    """Send so many to all that the nodes take, evenly; keep what makes faults in a folder."""
    with FuzzedSystem(Experiment.load(), seed) as system:
        entrances = system.entrances()
        system.learn(entrances)
        system.answers(entrances)
        return _Fuzzing(system, entrances, seed, kept).run(cases)


def replay(file: Path, seed: int) -> str:
    """Send again what made a fault; return what is wrong then, and what the nodes print."""
    with FuzzedSystem(Experiment.load(), seed) as system:
        entrances = system.entrances()
        system.learn(entrances)
        text = "nothing is wrong"
        try:
            for said in file.read_text().splitlines():
                system.deliver_line(said, entrances)
            system.answers(entrances)
        except ProcessError as error:
            text = str(error)
        return "\n".join([text, *(system.output(name) for name in system.nodes)])


class _Fuzzing:
    """Sends batch after batch."""

    def __init__(
        self, system: FuzzedSystem, entrances: list[Entrance], seed: int, kept: Path
    ) -> None:
        self._system, self._entrances, self._kept = system, entrances, kept
        self._random = Random(seed)
        self._counts: dict[Entrance, Counter[str]] = {to: Counter() for to in entrances}
        self._faults: dict[Entrance, list[Fault]] = {to: [] for to in entrances}
        self._memory, self._tracebacks = system.memory(), dict.fromkeys(system.nodes, 0)
        self._batch: list[str] = []

    def run(self, cases: int) -> list[Outcome]:
        """Send so many, or as many as there is time for, and return how it went."""
        number = len(self._entrances)
        shares = {to: len(range(i, cases, number)) for i, to in enumerate(self._entrances)}
        batches = [
            (to, min(BATCH, share - first))
            for to, share in shares.items()
            for first in range(0, share, BATCH)
        ]
        self._random.shuffle(batches)
        sent: Counter[Entrance] = Counter()
        for done, (to, size) in enumerate(tqdm(batches, unit="batch", desc="messages"), start=1):
            sent[to] += size
            try:
                self._send(to, size)
                self._look(to)
                if done % BETWEEN == 0 or done == len(batches):
                    self._system.answers(self._entrances)
            except ProcessError as error:
                self._blame(to, str(error))
                self._system.revive()
            except KeyboardInterrupt:
                break
        return [Outcome(str(to), sent[to], self._counts[to], self._faults[to]) for to in shares]

    def _send(self, to: Entrance, size: int) -> None:
        self._batch.clear()
        for _ in range(size):
            content = self._system.hostile(to, self._random)
            self._batch.append(line(to, content))
            self._counts[to][self._system.deliver(to, content)] += 1
        self._system.probe(to.node)
        if to.kind == SERVICE:
            self._system.restore(to.node)

    def _look(self, to: Entrance) -> None:
        """Look for what is wrong with nodes that answer."""
        for name, memory in self._system.memory().items():
            if memory > self._memory[name] + MEMORY:
                self._blame(to, f"{name} grows from {self._memory[name]} to {memory} bytes")
                self._memory[name] = memory
            there = self._system.output(name).count(TRACEBACK)
            if there > self._tracebacks[name]:
                self._blame(to, f"{name} prints a traceback")
            self._tracebacks[name] = there

    def _blame(self, to: Entrance, text: str) -> None:
        faults = self._faults[to]
        file = self._kept / f"{str(to).replace(': ', '_').replace('/', '_')}_{len(faults)}.jsonl"
        file.write_text("\n".join(self._batch))
        outputs = [f"{node}:\n{self._system.output(node)[-3000:]}" for node in self._system.nodes]
        file.with_suffix(".log").write_text("\n\n".join((text, *outputs)))
        faults.append(Fault(str(to), text, f"--replay {file}", file))
