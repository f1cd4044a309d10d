"""What sim_node reports of itself once a second on ``/diagnostics``."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray

from kmn_perception.ros.reports import make_status


class SimulationStatistics:
    """Counts of trajectories since the start, and the tracking error of late; thread-safe."""

    def __init__(self, joints: Sequence[str]) -> None:
        self._lock = threading.Lock()
        self._joints = tuple(joints)
        self._error = np.zeros(len(joints))
        self._progress: float | None = None
        self._accepted, self._refused = 0, Counter[str]()
        self._failures, self._recordings_lost = 0, 0
        self._last = "no trajectory received yet"

    def accept(self) -> None:
        """Count a trajectory that was taken over."""
        with self._lock:
            self._accepted += 1
            self._last = "accepted"

    def refuse(self, reason: str, text: str) -> None:
        """Count a refused trajectory by its reason key."""
        with self._lock:
            self._refused[reason] += 1
            self._last = f"refused, {reason}: {text}"

    def fail(self) -> None:
        """Count an internal error."""
        with self._lock:
            self._failures += 1

    def lose_recording(self) -> None:
        """Count a recording that could not be written."""
        with self._lock:
            self._recordings_lost += 1

    def track(self, error: NDArray[np.float64], progress: float | None) -> None:
        """Keep the largest tracking error (J,), and the progress of the trajectory."""
        with self._lock:
            self._error = np.maximum(self._error, np.abs(error))
            self._progress = progress

    def report(
        self, name: str, achieved: float, time: float, renderer: str
    ) -> list[DiagnosticStatus]:
        """Return the statuses and begin a new period.

        Parameters
        ----------
        name
            Who reports.
        achieved
            Simulated seconds in one second.
        time
            Simulated seconds since the start.
        renderer
            What renders the depth images.
        """
        with self._lock:
            error, self._error = self._error, np.zeros(len(self._joints))
            world = {
                "real_time_factor": f"{achieved:.2f}",
                "time_s": f"{time:.2f}",
                "renderer": renderer,
                "internal_errors": str(self._failures),
                "recordings_lost": str(self._recordings_lost),
            }
            control = {
                "progress": "none" if self._progress is None else f"{self._progress:.3f}",
                **{
                    f"error_{joint}": f"{value:.5f}"
                    for joint, value in zip(self._joints, error, strict=True)
                },
                "trajectories_accepted": str(self._accepted),
                "trajectories_refused": str(self._refused.total()),
                **{f"refused_{key}": str(count) for key, count in sorted(self._refused.items())},
                "last": self._last,
            }
            refused = self._last.startswith("refused")
            failed = self._failures + self._recordings_lost > 0
        return [
            make_status(f"{name}: simulation", failed, "running", world),
            make_status(f"{name}: trajectory", refused, self._last, control),
        ]
