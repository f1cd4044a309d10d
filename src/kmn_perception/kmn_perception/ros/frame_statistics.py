"""What a node did with its frames, as counts for ``/diagnostics``."""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Sequence

from diagnostic_msgs.msg import DiagnosticStatus

from kmn_perception.ros.reports import make_status

OK = "OK"  # the name of the status of what is as it should be
MANY = 0.1  # share of the frames since the last report that do not come in
REMEDY = (
    "unless this computer is too busy to take them, let the camera publish reliably, or start its "
    "process with FASTRTPS_DEFAULT_PROFILES_FILE set to kmn_perception's config/fastdds.xml"
)


class FrameStatistics:
    """Counts of frames since the start, rate and latency since the last report; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._received = self._lost = self._dropped = self._superseded = self._clock_jumps = 0
        self._refused: Counter[str] = Counter()
        self._statuses: Counter[str] = Counter()
        self._used = self._objects = self._left_out = 0
        self._latencies: list[float] = []
        self._reported = 0, 0  # received and lost at the last report
        self._last = "no frames received yet"

    def receive(self, replaced: bool) -> None:
        """Count a frame that came in, and perhaps the older one that it replaced unused."""
        with self._lock:
            self._received += 1
            self._dropped += replaced

    def lose(self, count: int) -> None:
        """Count frames that never came in: lost on the way, or replaced before they were taken."""
        with self._lock:
            self._lost += count

    def supersede(self) -> None:
        """Count a frame whose exposure, or a later one, the camera's other topic has shown."""
        with self._lock:
            self._superseded += 1

    def count_clock_jump(self) -> None:
        """Count a stamp that lies before the one received last on the same topic."""
        with self._lock:
            self._clock_jumps += 1

    def refuse(self, reason: str, text: str) -> None:
        """Count a malformed message by its reason key."""
        with self._lock:
            self._refused[reason] += 1
            self._last = f"refused, {reason}: {text}"

    def use(self, results: Sequence[tuple[str, str]], latency: float, left_out: int) -> None:
        """Count a frame that was estimated.

        Parameters
        ----------
        results
            For each object the name of the estimate's status, and why it is not OK.
        latency
            Seconds from the reception of the frame to its estimate.
        left_out
            Number of objects for which its budget did not suffice.
        """
        with self._lock:
            self._used += 1
            self._statuses.update(status for status, _ in results)
            self._objects = sum(status == OK for status, _ in results)
            self._latencies.append(latency)
            self._left_out += left_out
            wrong = Counter(f"{status}: {text}" for status, text in results if status != OK)
            self._last = "; ".join(_times(text, count) for text, count in wrong.items()) or OK

    def report(self, name: str, period: float) -> DiagnosticStatus:
        """Return the counts and begin a new period.

        Parameters
        ----------
        name
            Who reports.
        period
            Seconds since the last report.
        """
        with self._lock:
            latencies, self._latencies = self._latencies, []
            values = {
                "rate_hz": f"{len(latencies) / period:.2f}",
                "latency_mean_ms": f"{1e3 * sum(latencies) / max(len(latencies), 1):.2f}",
                "latency_max_ms": f"{1e3 * max(latencies, default=0.0):.2f}",
                "frames_received": str(self._received),
                "frames_lost": str(self._lost),
                "frames_used": str(self._used),
                "objects_last": str(self._objects),
                "objects_left_out": str(self._left_out),
                "frames_dropped": str(self._dropped),
                "frames_superseded": str(self._superseded),
                "frames_refused": str(self._refused.total()),
                **{f"refused_{key}": str(count) for key, count in sorted(self._refused.items())},
                **{f"status_{key}": str(count) for key, count in sorted(self._statuses.items())},
                "clock_jumps": str(self._clock_jumps),
                "last": self._last,
            }
            received, lost = self._received - self._reported[0], self._lost - self._reported[1]
            self._reported = self._received, self._lost
            message = "no frames" if self._last == OK and not latencies else self._last
            if lost > MANY * (received + lost):
                message = f"{lost} of {received + lost} frames did not come in: {REMEDY}"
        return make_status(name, message != OK, message, values)


def _times(text: str, count: int) -> str:
    return f"{text} ({count} times)" if count > 1 else text
