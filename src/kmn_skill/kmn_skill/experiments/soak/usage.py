"""What processes take of the machine, over time."""

from __future__ import annotations

import os
import resource
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

MIB = 2.0**20


class Usage(NamedTuple):
    """What a process takes: hours since the start, MiB of memory, open files, and threads.

    What it shares is not counted, as libraries, and the shared memory of those it hears.
    """

    hours: float
    memory: float
    files: int
    threads: int


def usage_of(pid: int, hours: float) -> Usage | None:
    """Return what a process takes now; None if there is none."""
    process = Path(f"/proc/{pid}")
    try:
        _, resident, shared, *_ = map(int, (process / "statm").read_text().split())
        files, threads = len(os.listdir(process / "fd")), len(os.listdir(process / "task"))
    except OSError:
        return None
    return Usage(hours, (resident - shared) * resource.getpagesize() / MIB, files, threads)


class UsageLog:
    """What the nodes took over time, each life of a node apart."""

    def __init__(self) -> None:
        self._lives: dict[str, list[list[Usage]]] = defaultdict(list)
        self._pids: dict[str, int] = {}

    def add(self, node: str, pid: int, hours: float) -> None:
        """Note what a node takes now."""
        usage = usage_of(pid, hours)
        if usage is not None:
            if self._pids.get(node) != pid:
                self._pids[node] = pid
                self._lives[node].append([])
            self._lives[node][-1].append(usage)

    @property
    def nodes(self) -> list[str]:
        """Names of the nodes."""
        return list(self._lives)

    def all_of(self, node: str) -> list[Usage]:
        """Return all that was noted of a node."""
        return [usage for life in self._lives[node] for usage in life]

    def lives(self, node: str) -> int:
        """Return how often a node was started."""
        return len(self._lives[node])

    def growth(self, node: str, warm_up: float) -> float:
        """Return by which part the memory of a node grew from some hours after its start on.

        Of its longest life: from the first third of what comes after the warm-up to the last one.
        NaN if no life was longer than that.
        """
        longest = max(self._lives[node], key=lambda life: life[-1].hours - life[0].hours)
        warm = [u.memory for u in longest if u.hours >= longest[0].hours + warm_up]
        third = len(warm) // 3
        if not third:
            return float("nan")
        return float(np.median(warm[-third:]) / np.median(warm[:third]) - 1.0)
