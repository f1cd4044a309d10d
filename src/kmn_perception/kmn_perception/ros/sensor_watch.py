"""The sensor diagnosis of a node: now and then, and reported in ``/diagnostics``."""

from __future__ import annotations

import time

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo

from kmn_perception.ros.messages import camera_from_info
from kmn_perception.ros.reports import make_status
from kmn_perception.scene.sensor_diagnosis import (
    Description,
    Diagnosis,
    DiagnosisSettings,
    diagnose,
)


class SensorWatch:
    """Keeps the newest diagnosis.

    Parameters
    ----------
    period
        Seconds between two diagnoses at least: one takes milliseconds, and mistakes stay.
    """

    def __init__(self, period: float) -> None:
        self._period, self._next = period, 0.0
        self._settings = DiagnosisSettings.load()
        self._newest: list[Diagnosis] = []

    def look(
        self, points: NDArray[np.float32], frame_id: str, info: CameraInfo | None
    ) -> list[Diagnosis]:
        """Return what is likely to be wrong, or nothing if that was told just before.

        Parameters
        ----------
        points
            As for `diagnose`.
        frame_id
            Of what was measured.
        info
            The description that the points were made with, if there is one.
        """
        now = time.monotonic()
        if now < self._next:
            return []
        self._next = now + self._period
        described = Description(frame=frame_id)
        if info is not None:
            described = Description(camera_from_info(info), frame_id, info.header.frame_id)
        self._newest = diagnose(points, described, self._settings)
        return self._newest

    def report(self, name: str) -> DiagnosticStatus:
        """Return the newest diagnosis under the name of who reports."""
        newest = self._newest
        message = "; ".join(found.text for found in newest) or "nothing wrong was recognised"
        return make_status(name, bool(newest), message, {found.key: found.text for found in newest})
