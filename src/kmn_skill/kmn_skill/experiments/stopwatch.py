"""Where the time of a goal goes, by phases, and how large forces and errors become meanwhile."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from typing import NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from sensor_msgs.msg import JointState

from kmn_perception.ros.stamps import seconds
from kmn_skill.planning.layout import MOVED
from kmn_skill.planning.phases import PhaseName

COMPUTED = (PhaseName.WAIT, PhaseName.PLAN)  # take real time, however fast the simulation runs


class Measured(NamedTuple):
    """What was measured from an accepted goal to its result.

    Attributes
    ----------
    seconds
        By phase: real ones of what is computed, simulated ones of the motion.
    opened
        All of them until the door was open; NaN if it never was.
    force
        Largest one on the handle, N.
    errors
        Largest tracking error of each joint, m or rad.
    """

    seconds: dict[str, float]
    opened: float
    force: float
    errors: dict[str, float]


class Stopwatch:
    """Measures one goal after the other.

    Parameters
    ----------
    simulator
        Full name of sim_node, whose reports count.

    Attributes
    ----------
    measured
        Since the start.
    reports
        Of sim_node that came since the start.
    """

    def __init__(self, simulator: str) -> None:
        self._status = f"{simulator}: trajectory"
        self._simulated = math.nan
        self.start(math.inf)

    def start(self, opened: float) -> None:
        """Begin anew; from a hinge angle on, to its side, the door counts as open (rad)."""
        self._opened, self._phase = opened, PhaseName.WAIT
        self._since = (time.monotonic(), self._simulated)
        self.measured, self.reports = Measured({}, math.nan, 0.0, {}), 0

    def enter(self, phase: str) -> None:
        """Note what is being done from now on."""
        self._advance()
        self._phase = phase

    def stop(self) -> None:
        """Measure no more times."""
        self.enter("")

    def on_door(self, message: JointState) -> None:
        """Read the simulated time, and whether the door is open."""
        self._simulated = seconds(message.header.stamp)
        self._advance()
        angle, opened = message.position[MOVED], self._opened
        if math.isnan(self.measured.opened) and math.copysign(1.0, opened) * angle >= abs(opened):
            total = sum(self.measured.seconds.values())
            self.measured = self.measured._replace(opened=total)

    def on_force(self, message: WrenchStamped) -> None:
        """Keep the largest force on the handle."""
        force = message.wrench.force
        newtons = max(self.measured.force, math.hypot(force.x, force.y, force.z))
        self.measured = self.measured._replace(force=newtons)

    def on_reports(self, message: DiagnosticArray) -> None:
        """Keep the largest tracking errors that the simulator reports."""
        for status in message.status:
            if status.name != self._status:
                continue
            self.reports += 1
            for key, value in ((pair.key, pair.value) for pair in status.values):
                if key.startswith("error_"):
                    joint, errors = key.removeprefix("error_"), self.measured.errors
                    with suppress(ValueError):  # of a stranger, who may report what he likes
                        errors[joint] = max(errors.get(joint, 0.0), float(value))

    def _advance(self) -> None:
        """Add the time that passed to the present phase."""
        now = (time.monotonic(), self._simulated)
        real, simulated = (after - before for before, after in zip(self._since, now, strict=True))
        passed = real if self._phase in COMPUTED else simulated
        spent = self.measured.seconds
        if self._phase and math.isfinite(passed):
            spent[self._phase] = spent.get(self._phase, 0.0) + passed
        self._since = now
