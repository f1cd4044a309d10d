"""Numbers for objects that stay the same from frame to frame, by where they are in the world."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(eq=False)
class _Track:
    number: int
    centre: NDArray[np.float64]
    last_seen: int


class ObjectTracker:
    """Gives each object the number of the nearest one of the frames before, or a new one.

    Attributes
    ----------
    max_distance
        An object whose centre moved further than this between two frames is another one, metres.
    memory
        Frames for which an object that is not seen keeps its number.
    """

    def __init__(self, max_distance: float, memory: int) -> None:
        self.max_distance, self.memory = max_distance, memory
        self._tracks: list[_Track] = []
        self._frame, self._next = 0, 1

    def update(self, centres: Sequence[NDArray[np.floating]]) -> list[int]:
        """Return the numbers, from 1 on, of a frame's objects with these centres (3,), metres."""
        self._frame += 1
        oldest = self._frame - self.memory
        self._tracks = [track for track in self._tracks if track.last_seen >= oldest]
        pairs = [
            (float(np.linalg.norm(centre - track.centre)), i, track)
            for i, centre in enumerate(centres)
            for track in self._tracks
        ]
        found: dict[int, _Track] = {}
        for distance, i, track in sorted(pairs, key=lambda pair: pair[0]):
            if distance <= self.max_distance and i not in found and track not in found.values():
                found[i] = track
        return [self._follow(found.get(i), centre) for i, centre in enumerate(centres)]

    def _follow(self, track: _Track | None, centre: NDArray[np.floating]) -> int:
        """Move a track, or begin one; return its number."""
        if track is None:
            track = _Track(self._next, np.empty(3), 0)
            self._tracks.append(track)
            self._next += 1
        track.centre, track.last_seen = centre.astype(np.float64), self._frame
        return track.number
