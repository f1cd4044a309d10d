"""The recordings of a simulation that runs: one after the other, none of which can stop it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from kmn_sim.sensors.recording import Recorder, RecordingError
from kmn_sim.sensors.settings import RecordingSettings
from kmn_sim.world.runner import Runner
from kmn_sim.world.simulation import Simulation


class Recordings:
    """Takes the pictures of a recording in the thread of the simulation.

    Parameters
    ----------
    runner
        Runs the simulation.
    settings
        How the pictures are taken and kept.
    lose
        Is told of a recording that could not be written, in either thread.
    """

    def __init__(
        self, runner: Runner, settings: RecordingSettings, lose: Callable[[RecordingError], None]
    ) -> None:
        self._runner, self._settings, self._lose = runner, settings, lose
        self._recorder: Recorder | None = None
        self._task = runner.every(1.0, self._take_picture)

    def prepare(self, file: str, rate: float) -> Recorder | None:
        """Open a recording with so many pictures a simulated second; none without a file's name.

        Raises
        ------
        RecordingError
            If the file cannot be written.
        """
        return Recorder(Path(file), rate, self._settings) if file else None

    def exchange(self, recorder: Recorder | None, rate: float) -> None:
        """Complete the recording that is being made, if any, and go on with a prepared one."""

        def exchange(simulation: Simulation) -> Recorder | None:
            before, self._recorder = self._recorder, recorder
            self._take_picture(simulation)  # so that no recording is empty
            self._task.period = 1.0 / rate
            self._task.due = simulation.time + self._task.period
            return before

        self._complete(self._runner.call(exchange))

    def close(self) -> None:
        """Complete the recording that is being made, after the simulation has ended."""
        self._complete(self._recorder)

    def _take_picture(self, simulation: Simulation) -> None:
        if self._recorder is None:
            return
        try:
            self._recorder.take(simulation)
        except RecordingError as error:
            self._recorder = None
            self._lose(error)

    def _complete(self, recorder: Recorder | None) -> None:
        try:
            if recorder is not None:
                recorder.close()
        except RecordingError as error:
            self._lose(error)
