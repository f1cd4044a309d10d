"""What an estimate of a door is worth, given the truth."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.evaluation.doors.errors import DoorErrors, errors
from kmn_perception.evaluation.doors.label import DoorLabel
from kmn_perception.evaluation.doors.settings import DoorErrorSettings
from kmn_perception.model.room_model import RoomModel


class Verdict(Enum):
    """How an estimate agrees with the truth."""

    RIGHT = "right"
    IMPRECISE = "imprecise"  # too far off to be of use, as its deviations say
    LIE = "lie"  # farther off than its deviations say, or there is no such door or handle
    REFUSED = "refused"

    @property
    def is_wrong(self) -> bool:
        """Whether a door is found that is not so."""
        return self in (Verdict.IMPRECISE, Verdict.LIE)


class Outcome(NamedTuple):
    """What a method says of a frame, and what that is worth.

    Attributes
    ----------
    status, reason
        Of the estimate.
    errors
        None unless a door is found, and there is one.
    faults
        The quantities that are wrong; ``handle`` or ``door``: there is none.
    """

    status: DoorStatus
    reason: str
    verdict: Verdict
    errors: DoorErrors | None
    faults: tuple[str, ...] = ()


def judge(
    estimate: DoorEstimate, label: DoorLabel | None, model: RoomModel, limits: DoorErrorSettings
) -> Outcome:
    """Judge an estimate by a label that knows all of the door; None where there is no door."""
    status, reason = estimate.status, estimate.reason
    if not estimate.found:
        return Outcome(status, reason, Verdict.REFUSED, None)
    if label is None:
        return Outcome(status, reason, Verdict.LIE, None, ("door",))
    off = errors(estimate, label, model, limits)
    lies, far_off = off.broken_promises(limits), off.far_off(limits)
    if estimate.handle_side and label.handle is None:
        lies = (*lies, "handle")
    verdict = Verdict.LIE if lies else Verdict.IMPRECISE if far_off else Verdict.RIGHT
    return Outcome(status, reason, verdict, off, tuple(dict.fromkeys((*far_off, *lies))))
