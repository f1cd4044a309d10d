"""Tells people the phases of a goal as they come."""

from __future__ import annotations


class Narrator:
    """Prints what is being done, when it changes."""

    def __init__(self) -> None:
        self._told = ""

    def tell(self, phase: str, progress: float, position: float) -> None:
        """Print the phase, if it is another one, and how far the object is open (m or rad)."""
        if phase != self._told:
            self._told = phase
            opened = round(position, 2) + 0.0  # never -0
            print(f"  {phase:7s} {100 * progress:3.0f} %   open by {opened:5.2f}", flush=True)
