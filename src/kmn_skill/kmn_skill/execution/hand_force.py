"""The force of the hand on what it holds, where somebody measures it."""

from __future__ import annotations

import math
import threading
from collections import deque

import numpy as np
from numpy.typing import NDArray

SPAN = 0.1  # seconds of which the mean is taken: a hand that sets in motion what it holds jerks
MAX_SAMPLES = 1000  # that are kept


class HandForce:
    """Keeps the newest forces; thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._kept: deque[tuple[float, NDArray[np.float64]]] = deque(maxlen=MAX_SAMPLES)

    def put(self, time: float, force: NDArray[np.float64]) -> None:
        """Keep a force (3,) at a time (s), newtons in the frame that the robot moves in."""
        with self._lock:
            self._kept.append((time, force))

    def along(self, way: NDArray[np.float64], now: float) -> float:
        """Return the mean force along a way (3,) of length 1 of late, N; NaN where nobody told it.

        Parameters
        ----------
        now
            Time until which it is taken, seconds.
        """
        with self._lock:
            recent = [force for time, force in self._kept if now - SPAN <= time <= now]
        return float(np.mean(recent, axis=0) @ way) if recent else math.nan
