"""The experiment on frames of doors: each with depth alone, with colour, and by the baselines."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame
from kmn_perception.evaluation.doors.errors import DoorErrors, DoorPlace, compare, errors
from kmn_perception.evaluation.doors.label import DoorLabel
from kmn_perception.evaluation.doors.settings import DoorErrorSettings
from kmn_perception.experiments.doors.baselines import BASELINES
from kmn_perception.experiments.doors.frames import DoorFrame
from kmn_perception.experiments.doors.masked_pipeline import masked_pipeline
from kmn_perception.experiments.experiment import load_pipeline
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.model.room_model import RoomModel

WITH_COLOUR, WITHOUT_NETWORK, DEPTH_ALONE = "with_colour", "without_network", "depth_alone"
MODES = (WITH_COLOUR, WITHOUT_NETWORK, DEPTH_ALONE)
MASKED = "masked_pipeline"


class Outcome(NamedTuple):
    """What a method says of a frame.

    Attributes
    ----------
    found
        Whether it says that there is a door.
    errors
        None of a door that is not found, or not there.
    wrong
        Whether it is found, and is not there, or not so.
    """

    found: bool
    errors: DoorErrors | None
    wrong: bool


class DoorResult(NamedTuple):
    """What came out for a frame.

    Attributes
    ----------
    name, label
        Of the frame.
    estimates, outcomes, seconds
        By mode; the seconds are those of one core, the minimum of some repetitions.
    baselines
        By name.
    """

    name: str
    label: DoorLabel | None
    estimates: dict[str, DoorEstimate]
    outcomes: dict[str, Outcome]
    seconds: dict[str, float]
    baselines: dict[str, Outcome]


class DoorExperiment:
    """Runs everything on one frame after the other.

    Attributes
    ----------
    settings, doors
        Of the experiment, and of the finder on calibrated depth.
    """

    def __init__(self, settings: ExperimentSettings, doors: DoorSettings) -> None:
        self.settings, self.doors = settings, doors
        self._limits = DoorErrorSettings.load()
        self.model, self.network = RoomModel.load(doors.model), DoorFinder.load().network
        self.pipeline = load_pipeline()

    def run(self, frame: DoorFrame) -> DoorResult:
        """Return the result of a frame."""
        doors = self.doors
        if frame.delivered:
            doors = replace(doors, calibration=doors.delivered)
        depth, camera = np.nan_to_num(frame.depth), frame.description.camera
        seen = {
            WITH_COLOUR: Frame(depth, frame.grey, camera),
            WITHOUT_NETWORK: Frame(depth, frame.grey, camera),
            DEPTH_ALONE: Frame(depth, None, camera),
        }
        finders = {
            WITH_COLOUR: DoorFinder(doors, self.network),
            WITHOUT_NETWORK: DoorFinder(doors),
            DEPTH_ALONE: DoorFinder(doors, self.network),
        }
        found = {mode: self._find(finders[mode], seen[mode]) for mode in MODES}
        estimates = {mode: estimate for mode, (estimate, _) in found.items()}
        places = {name: find(seen[WITH_COLOUR], doors) for name, find in BASELINES.items()}
        places[MASKED] = masked_pipeline(frame, self.pipeline, self.model)
        return DoorResult(
            frame.name,
            frame.label,
            estimates,
            {mode: self._judge(estimate, frame) for mode, estimate in estimates.items()},
            {mode: seconds for mode, (_, seconds) in found.items()},
            {name: self._judge_place(place, frame) for name, place in places.items()},
        )

    def _find(self, finder: DoorFinder, seen: Frame) -> tuple[DoorEstimate, float]:
        seconds = []
        for _ in range(self.settings.repetitions):
            start = time.process_time()
            estimate = finder.find(seen)
            seconds.append(time.process_time() - start)
        return estimate, min(seconds)

    def _judge(self, estimate: DoorEstimate, frame: DoorFrame) -> Outcome:
        off = None
        if estimate.found and frame.label is not None:
            off = errors(estimate, frame.label, self.model, self._limits)
        return self._outcome(estimate.found, off)

    def _judge_place(self, place: DoorPlace | None, frame: DoorFrame) -> Outcome:
        off = None
        if place is not None and frame.label is not None:
            values = compare(place, frame.label)
            unknown = np.full_like(values, np.nan)
            off = DoorErrors(values, unknown, unknown)
        return self._outcome(place is not None, off)

    def _outcome(self, found: bool, off: DoorErrors | None) -> Outcome:
        return Outcome(found, off, found and (off is None or off.is_wrong(self._limits)))
