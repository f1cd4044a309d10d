"""Recordings of a run: a file appears under its name when it is complete, or not at all."""

from __future__ import annotations

import secrets
from contextlib import suppress
from pathlib import Path

from kmn_sim.sensors.encoders import ENCODERS
from kmn_sim.sensors.settings import RecordingSettings
from kmn_sim.sensors.snapshot import snapshot
from kmn_sim.world.simulation import Simulation

FORMATS = tuple(ENCODERS)


class RecordingError(OSError):
    """A recording that cannot be begun or is lost; the text names the file and the reason."""


class Recorder:
    """Takes pictures of a simulation and writes a recording of them.

    It is written aside, under a hidden name in the same folder, and moved when it is complete.

    Parameters
    ----------
    file
        Path with one of the endings ``FORMATS``.
    rate
        Pictures a second.

    Raises
    ------
    RecordingError
        If the file cannot be written.
    """

    def __init__(self, file: Path, rate: float, settings: RecordingSettings) -> None:
        self._file, self._settings = file, settings
        self._part = file.with_name(f".{file.stem}-{secrets.token_hex(4)}.part")
        if file.is_dir():
            raise RecordingError(f"cannot record to '{file}': it is a folder, expected a file")
        try:
            self._part.touch(exist_ok=False)
            self._encoder = ENCODERS[file.suffix](self._part, rate, settings)
        except OSError as error:
            self._remove_part()
            raise RecordingError(f"cannot record to '{file}': {_reason(error)}") from error

    def take(self, simulation: Simulation) -> None:
        """Add a picture of the present; if that fails, the recording has ended.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        picture = snapshot(simulation, self._settings, self._settings.recording)
        try:
            self._encoder.add(picture)
        except OSError as error:
            with suppress(OSError):
                self._encoder.close()
            raise self._lost(error) from error

    def close(self) -> None:
        """Complete the file and give it its name.

        Raises
        ------
        RecordingError
            If it cannot be written.
        """
        try:
            self._encoder.close()
            self._part.replace(self._file)
        except OSError as error:
            raise self._lost(error) from error

    def _lost(self, error: OSError) -> RecordingError:
        self._remove_part()
        return RecordingError(f"the recording '{self._file}' is lost: {_reason(error)}")

    def _remove_part(self) -> None:
        with suppress(OSError):  # its folder may be gone
            self._part.unlink()


def _reason(error: OSError) -> str:
    """Return what went wrong, without the hidden name."""
    return error.strerror or str(error)
