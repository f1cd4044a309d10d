"""What the search for doors finds in each rendered room: with a network, without, and in depth."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from kmn_perception.configuration import resources
from kmn_perception.configuration.hashes import short_hash
from kmn_perception.configuration.section import Section
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame
from kmn_perception.evaluation.comparison import Request
from kmn_perception.evaluation.doors.errors import DoorErrors
from kmn_perception.evaluation.doors.label import DoorLabel, describe
from kmn_perception.evaluation.doors.limit import errors_at_limit
from kmn_perception.evaluation.doors.outcome import Outcome, judge
from kmn_perception.evaluation.doors.settings import DoorErrorSettings, RoomEvaluationSettings
from kmn_perception.evaluation.methods import MethodError
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.model.room_model import RoomModel
from kmn_perception.network.weight_file import WeightsError
from kmn_perception.rooms import frame as rendered
from kmn_perception.rooms.label import label
from kmn_perception.rooms.sampling import NEGATIVES
from kmn_perception.rooms.settings import RoomSettings
from kmn_perception.training.samples import EVALUATION

NETWORK, NO_NETWORK, DEPTH_ALONE = "with_network", "without_network", "depth_alone"
ROOM_METHODS = (NETWORK, NO_NETWORK, DEPTH_ALONE)
NO_NOISE = "none"
ROOM_NOISES = (NO_NOISE, *SENSORS)
TRIES = 10  # seeds of a sample: in some rooms there is no place for the camera


class Traits(NamedTuple):
    """What may make a door hard to find.

    Attributes
    ----------
    recess, distance
        Metres; see `BinSettings`.
    view_angle
        Degrees.
    handle, state
        Kind of the handle; ``closed`` or ``ajar``.
    """

    recess: float
    distance: float
    view_angle: float
    handle: str
    state: str


class RoomSample(NamedTuple):
    """What came out for a room.

    Attributes
    ----------
    kind, seed
        Of the room.
    traits
        None without a door.
    observable
        Whether both upright edges of a door are seen.
    outcomes, seconds
        By method; the seconds are those of one core.
    limit
        Errors of who is told the edges, see `errors_at_limit`; None where they cannot be measured.
    """

    kind: str
    seed: int
    traits: Traits | None
    observable: bool
    outcomes: dict[str, Outcome]
    seconds: dict[str, float]
    limit: DoorErrors | None


class RoomComparison:
    """Compares the ways to find a door, in rooms that never trained.

    Parameters
    ----------
    doors
        Number of rooms with a door; the samples after them are negatives.

    Attributes
    ----------
    methods
        Names of those that are compared.
    left_out
        By method, why it is not compared.
    hashes
        Start of the sha256 sum of the network's weight file, by ``own``.

    Raises
    ------
    MethodError
        If a method that was named lacks something, or the request does not suit rooms.
    """

    def __init__(self, request: Request, doors: int) -> None:
        self.model = RoomModel.load(request.model)
        self.settings = RoomEvaluationSettings.load()
        self.noise = request.noise or self.settings.sensor
        self.left_out: dict[str, str] = {}
        self.hashes: dict[str, str] = {}
        _check(request, self.model.model.name)
        self._request, self._doors = request, doors
        # The truth is exact: an angle of 0 is 0.
        self._limits = replace(DoorErrorSettings.load(), opening_deviation=0.0)
        wanted, without = request.methods or ROOM_METHODS, DoorFinder(DoorSettings.load())
        self._best = finder = self._with_network() or without
        self._finders = {
            name: without if name == NO_NETWORK else finder
            for name in wanted
            if name not in self.left_out
        }
        self.methods = tuple(self._finders)
        self._is_warm = False

    def __call__(self, index: int) -> RoomSample:
        """Return what the methods say of a sample."""
        kind, number = "door", index
        if index >= self._doors:
            number = index - self._doors
            kind = NEGATIVES[number % len(NEGATIVES)]
        seed, frame = room_frame(self._request.seed, number, self.noise, kind)
        text = label(frame, kind, {})
        truth = describe(Section(text, kind)).label
        depth = np.nan_to_num(frame.depth).astype(np.float32)
        grey = frame.images.grey.astype(np.float32) / np.float32(255.0)
        outcomes, seconds = {}, {}
        for name, finder in self._finders.items():
            seen = Frame(depth, None if name == DEPTH_ALONE else grey, frame.room.camera)
            if not self._is_warm:
                finder.find(seen)  # what is compiled or loaded only once is not timed
            started = time.process_time()
            estimate = finder.find(seen)
            seconds[name] = time.process_time() - started
            outcomes[name] = judge(estimate, truth, self.model, self._limits)
        self._is_warm = True
        observable = truth is not None and truth.edges_in_view
        traits = None if truth is None else _traits(text, truth)
        limit = None
        if truth is not None and observable:
            seen = Frame(depth, grey, frame.room.camera)
            limit = errors_at_limit(self._best, seen, frame, truth, self.model, self._limits)
        return RoomSample(kind, seed, traits, observable, outcomes, seconds, limit)

    def _with_network(self) -> DoorFinder | None:
        """Return the finder; None where the shipped network is missing, and was not asked for."""
        given, methods = self._request.weights or DoorSettings.load().model, self._request.methods
        try:
            loaded = DoorFinder.load(given)
        except WeightsError as error:
            if self._request.weights:
                raise
            if methods is not None and NETWORK in methods and not self._request.lenient:
                raise MethodError(f"{NETWORK}: {error}") from error
            self.left_out[NETWORK] = str(error)
            return None
        self.hashes["own"] = short_hash(resources.find("weights", given, ".safetensors"))
        return loaded


def room_frame(seed: int, number: int, noise: str, kind: str) -> tuple[int, rendered.Frame]:
    """Return a frame that never trained, and its seed; those of training have 32 bits.

    Raises
    ------
    RuntimeError
        If in none of some rooms there is a place for the camera.
    """
    sensor = SENSORS.get(noise, NO_NOISE)
    sequence = np.random.SeedSequence((seed, number), spawn_key=EVALUATION)
    *seeds, last = (int(state) for state in sequence.generate_state(TRIES, np.uint64))
    for candidate in seeds:
        try:
            return candidate, rendered.make_frame(candidate, sensor, kind)
        except RuntimeError:
            continue
    return last, rendered.make_frame(last, sensor, kind)


def _check(request: Request, name: str) -> None:
    """Refuse what is not known of rooms."""
    expected = RoomSettings.load().model
    if name != expected:
        raise MethodError(f"rooms are rendered of the model '{expected}', found '{name}'")
    if request.noise not in (None, *ROOM_NOISES):
        raise MethodError(
            f"rooms are seen with the noise {', '.join(ROOM_NOISES)}, found '{request.noise}'"
        )
    unknown = [method for method in request.methods or () if method not in ROOM_METHODS]
    if unknown:
        raise MethodError(
            f"methods for '{name}' are {', '.join(ROOM_METHODS)}, found {', '.join(unknown)}"
        )
    if request.paper_weights is not None:
        raise MethodError(f"the paper has no network for '{name}'")


def _traits(text: Mapping[str, Any], truth: DoorLabel) -> Traits:
    return Traits(
        recess=abs(text["door"]["nuisance"]["recess"]),
        distance=float(np.linalg.norm(truth.centre)),
        view_angle=text["reference"]["metric"]["panel_plane"]["view_angle_deg"],
        handle=text["handle_kind"],
        state=text["state"],
    )
