"""What becomes of hostile content."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import NamedTuple

REFUSED, ACCEPTED, ANSWERED, SENT = "refused", "accepted", "answered", "sent"
VERDICTS = (REFUSED, ACCEPTED, ANSWERED, SENT)


PLACE = " at "  # stands before file and line


class Fault(NamedTuple):
    """What a reader or a node did that it must not do.

    Attributes
    ----------
    again
        How it is seen again.
    """

    kind: str
    text: str
    again: str
    file: Path

    @property
    def place(self) -> str:
        """What faults of one cause have in common."""
        what, *more = self.text.splitlines()[0].partition(PLACE)
        return f"{self.kind}: {what}{''.join(more).split(': ')[0]}"[:200]


class Outcome(NamedTuple):
    """How often what became of the cases of a kind, and the faults."""

    kind: str
    cases: int
    counts: Counter[str]
    faults: list[Fault]
