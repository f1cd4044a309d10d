"""What skill_node reports of itself once a second on ``/diagnostics``."""

from __future__ import annotations

import threading
from collections import Counter

from diagnostic_msgs.msg import DiagnosticStatus

from kmn_perception.ros.reports import make_status
from kmn_skill.execution.goal import SUCCESS, Result


class SkillStatistics:
    """Counts since the start, and what is done at present; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._outcomes: Counter[str] = Counter()
        self._rejected = self._plans = self._used = 0
        self._refused: Counter[str] = Counter()
        self._planning_time = self._tracking_error = 0.0
        self._phase, self._last = "idle", "no goal yet"

    def use(self) -> None:
        """Count morphing parameters or a state that was taken."""
        with self._lock:
            self._used += 1

    def refuse(self, reason: str) -> None:
        """Count morphing parameters or a state that cannot be used, by its reason key."""
        with self._lock:
            self._refused[reason] += 1

    def reject(self, text: str) -> None:
        """Count a goal that was rejected."""
        with self._lock:
            self._rejected += 1
            self._last = text

    def plan(self, planning_time: float) -> None:
        """Count a plan that took so many seconds."""
        with self._lock:
            self._plans += 1
            self._planning_time = planning_time

    def enter(self, phase: str) -> None:
        """Note what is being done now."""
        with self._lock:
            self._phase = phase

    def finish(self, result: Result) -> None:
        """Count the end of a goal."""
        with self._lock:
            self._phase = "idle"
            self._outcomes[result.outcome] += 1
            self._tracking_error = result.tracking_error
            self._last = result.reason or result.outcome

    def report(self, name: str, door: str) -> list[DiagnosticStatus]:
        """Return the statuses.

        Parameters
        ----------
        name
            Who reports.
        door
            Why there is no door to rely on; empty if there is one.
        """
        with self._lock:
            goals = {
                "phase": self._phase,
                "goals_rejected": str(self._rejected),
                **{f"goals_{key}": str(count) for key, count in sorted(self._outcomes.items())},
                "plans": str(self._plans),
                "planning_time_s": f"{self._planning_time:.2f}",
                "tracking_error": f"{self._tracking_error:.2f}",  # in units of the tolerances
                "last": self._last,
            }
            messages = {
                "messages_used": str(self._used),
                "messages_refused": str(self._refused.total()),
                **{f"refused_{key}": str(count) for key, count in sorted(self._refused.items())},
            }
            failed = self._last not in (SUCCESS, "no goal yet")
            phase = self._phase
        return [
            make_status(f"{name}: goals", failed, phase, goals),
            make_status(f"{name}: door", bool(door), door or "known", messages),
        ]
