"""The sensor diagnosis of a node: now and then, and reported in ``/diagnostics``."""

from __future__ import annotations

import time
from contextlib import suppress

from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import CameraInfo

from kmn_perception.ros.messages import MessageError, camera_from_info
from kmn_perception.ros.reports import make_status
from kmn_perception.scene.depth_view import DepthView
from kmn_perception.scene.sensor_diagnosis import (
    Description,
    Diagnosis,
    DiagnosisSettings,
    diagnose,
)
from kmn_perception.scene.settings import IntrinsicsSettings


class SensorWatch:
    """Keeps the newest diagnosis.

    Parameters
    ----------
    period
        Seconds between two diagnoses at least: one takes milliseconds, and mistakes stay.
    """

    def __init__(
        self, period: float, settings: DiagnosisSettings, intrinsics: IntrinsicsSettings
    ) -> None:
        self._period, self._next = period, 0.0
        self._settings, self._intrinsics = settings, intrinsics
        self._newest: list[Diagnosis] = []
        self._error = ""

    def look(self, view: DepthView, info: CameraInfo | None) -> list[Diagnosis]:
        """Return what is likely to be wrong, or nothing if that was told just before.

        Parameters
        ----------
        view
            What was measured, not in the world frame.
        info
            The newest description of the camera, if one came.
        """
        now = time.monotonic()
        if now < self._next:
            return []
        self._next = now + self._period
        described = _description(view, info)
        self._newest = diagnose(view.points, described, self._settings, self._intrinsics)
        return self._newest

    def keep_error(self, text: str) -> None:
        """Keep what an estimate tells about the sensor's error, or that it tells none."""
        self._error = text

    def report(self, name: str) -> DiagnosticStatus:
        """Return the newest diagnosis under the name of who reports."""
        newest = self._newest.copy()
        if self._error:
            newest.append(Diagnosis("calibration", self._error))
        message = "; ".join(found.text for found in newest) or "nothing wrong was recognised"
        return make_status(name, bool(newest), message, {found.key: found.text for found in newest})


def _description(view: DepthView, info: CameraInfo | None) -> Description:
    """Return what is said about the sensor; of a cloud's only if it is of the cloud's frame."""
    if info is None or (view.camera is None and info.header.frame_id != view.frame):
        return Description(frame=view.frame)
    camera = view.camera
    if camera is None:
        with suppress(MessageError):  # is refused where it is used
            camera = camera_from_info(info)
    return Description(camera, view.frame, info.header.frame_id)
