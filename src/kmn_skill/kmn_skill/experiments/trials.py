"""What became of objects that were to be opened, each of them and all together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_msgs.action import OperateJoint
from kmn_perception.command_line.columns import columns
from kmn_skill.experiments.stopwatch import Measured


class Opened(NamedTuple):
    """What became of a goal.

    Attributes
    ----------
    result
        Of the action.
    perceived
        The last parameters (n + m,) that skill_node could take when the goal was sent; where there
        were none, those that it refused.
    hinge
        Angle of the door in the physics at the end, radians.
    measured
        Times, forces and errors on the way.
    moved
        Which joints of objects beside it were moved; empty if none was.
    """

    result: OperateJoint.Result
    perceived: NDArray[np.float64]
    hinge: float
    measured: Measured
    moved: str


class Trial(NamedTuple):
    """What became of one door.

    Attributes
    ----------
    values
        (n + m,) true morphing parameters.
    executed, opened
        Whether the plan was followed to its end, and whether the door is open in the physics.
    planning_time, contact_error, clearance
        Of the plan, in s and m; NaN without a plan.
    attempts
        Plans that were begun.
    hinge, told
        Angle of the door in the end, in the physics and as the skill told it, radians.
    reason
        Why it was not opened.
    measured
        Times, forces and errors on the way.
    """

    values: NDArray[np.float64]
    executed: bool
    opened: bool
    planning_time: float
    contact_error: float
    clearance: float
    attempts: int
    hinge: float
    told: float
    reason: str
    measured: Measured

    @property
    def planned(self) -> bool:
        """Whether there was a plan."""
        return not math.isnan(self.clearance)


def tally(trials: Sequence[Trial]) -> dict[str, Any]:
    """Return the counts and figures of all trials as they are written to JSON."""
    planned = [trial for trial in trials if trial.planned]
    return {
        "doors": len(trials),
        "planned": len(planned),
        "executed": sum(trial.executed for trial in trials),
        "opened": sum(trial.opened for trial in trials),
        "false_success": sum(trial.executed and not trial.opened for trial in trials),
        "first_attempt": sum(trial.opened and trial.attempts == 1 for trial in trials),
        "planning_s": spread([trial.planning_time for trial in planned]),
        **motion([trial.measured for trial in trials if trial.opened]),
        "hinge_error_rad": spread([abs(t.told - t.hinge) for t in trials if t.executed]),
        "contact_error_m": {"max": max((trial.contact_error for trial in planned), default=None)},
        "clearance_m": {"min": min((trial.clearance for trial in planned), default=None)},
        "failures": [
            {
                "door": number,
                "values": trial.values.tolist(),
                "hinge": trial.hinge,
                "attempts": trial.attempts,
                "reason": trial.reason,
            }
            for number, trial in enumerate(trials)
            if not (trial.executed and trial.opened)
        ],
    }


def spread(values: Sequence[float]) -> dict[str, float | None]:
    """Return median, 95th percentile and maximum of values; None where there are none."""
    if not values:
        return {"median": None, "p95": None, "max": None}
    return {
        "median": float(np.median(values)),
        "p95": float(np.percentile(values, 95.0)),
        "max": float(np.max(values)),
    }


def motion(opened: Sequence[Measured]) -> dict[str, Any]:
    """Return times, forces and tracking errors of the doors that were opened."""
    phases = dict.fromkeys(phase for each in opened for phase in each.seconds)
    joints = dict.fromkeys(joint for each in opened for joint in each.errors)
    return {
        "open_after_s": spread([each.opened for each in opened]),
        "phases_s": {
            phase: spread([each.seconds.get(phase, 0.0) for each in opened]) for phase in phases
        },
        "handle_force_N": spread([each.force for each in opened]),
        "tracking_error": {
            joint: max(each.errors.get(joint, 0.0) for each in opened) for joint in joints
        },
    }


def table(result: dict[str, Any]) -> str:
    """Return the figures for people to read."""
    rows = [["", "", ""]]
    for name in ("planned", "executed", "opened", "false_success", "first_attempt"):
        count, total = result[name], result["doors"]
        rows.append([name, f"{count} of {total}", f"{100 * count / total:.0f} %"])
    for name, unit, factor, key in (
        ("contact_error_m", "mm", 1e3, "max"),
        ("clearance_m", "mm", 1e3, "min"),
    ):
        value = result[name][key]
        text = "-" if value is None else f"{factor * value:.2f} {unit}"
        rows.append([f"{name.rsplit('_', 1)[0]} {key}", text, ""])
    spreads = {
        "planning": (result["planning_s"], "s"),
        **{phase: (seconds, "s") for phase, seconds in result["phases_s"].items()},
        "open after": (result["open_after_s"], "s"),
        "force on the handle": (result["handle_force_N"], "N"),
        "error of the told angle": (result["hinge_error_rad"], "rad"),
    }
    figures = [["", "median", "95 %", "most"]]
    for name, (values, unit) in spreads.items():
        numbers = ("-" if value is None else f"{value:.2f} {unit}" for value in values.values())
        figures.append([name, *numbers])
    errors = [["tracking error", "most"]]
    errors += [[joint, f"{error:.4f}"] for joint, error in result["tracking_error"].items()]
    reasons = [f"door {f['door']}: {f['reason']}" for f in result["failures"]]
    return "\n\n".join([*map(columns, (rows, figures, errors)), *reasons])
