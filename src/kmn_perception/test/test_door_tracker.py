"""A door that was found is measured where it was while nothing moves, and searched when it does."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from importlib import import_module
from pkgutil import iter_modules

import numba
import numpy as np
import pytest

import kmn_perception.doors
from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.doors.door_estimate import DoorStatus
from kmn_perception.doors.door_finder import DoorFinder, Sighting
from kmn_perception.doors.door_tracker import DoorTracker
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame
from kmn_perception.rooms import frame as rooms
from kmn_perception.rooms.sequence import make_sequence
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.pipeline_loading import load_pipeline

SEED = 6100  # of a room whose door is in view
SEARCHES = DoorSettings.load().tracking.searches
SECOND = 10**9


def at(number: int) -> int:
    """Return the stamp of a frame at 30 Hz, nanoseconds."""
    return SECOND + number * SECOND // 30


class CountingFinder(DoorFinder):
    """Counts its searches."""

    searches = 0

    def search(self, frame: Frame) -> Sighting:
        """Search as the finder does."""
        self.searches += 1
        return super().search(frame)


@pytest.fixture
def finder() -> CountingFinder:
    loaded = DoorFinder.load()
    return CountingFinder(loaded.settings, loaded.network)


@cache
def frames(count: int, step: float = 0.0) -> list[Frame]:
    return [as_seen(seen) for seen in make_sequence(SEED, count, step)]


def as_seen(seen: rooms.Frame) -> Frame:
    grey = seen.images.grey.astype(np.float32) / np.float32(255.0)
    return Frame(np.nan_to_num(seen.depth).astype(np.float32), grey, seen.room.camera)


def test_every_frame_of_a_resting_camera_is_measured_and_few_are_searched(
    finder: CountingFinder,
) -> None:
    tracker, count = DoorTracker(1), SEARCHES + 3
    found = [tracker.find(finder, f, None, at(i)) for i, f in enumerate(frames(count))]
    assert finder.searches == SEARCHES
    assert {door.status for door in found} == {DoorStatus.OK}
    assert len({door.values.tobytes() for door in found}) == len(found)
    for door, frame in zip(found[SEARCHES:], frames(count)[SEARCHES:], strict=True):
        searched = finder.find(frame)
        off = np.abs(door.values - searched.values)
        assert (off <= np.sqrt(np.diag(searched.covariance))).all()


@pytest.mark.parametrize("later", [0, SECOND // 2, 3 * SECOND])
def test_the_search_is_made_anew_after_a_time_and_where_no_time_is_known(
    finder: CountingFinder, later: int
) -> None:
    tracker, seen = DoorTracker(1), frames(SEARCHES + 3)
    for i, frame in enumerate(seen[:-1]):
        tracker.find(finder, frame, None, at(i))
    assert finder.searches == SEARCHES
    tracker.find(finder, seen[-1], None, later)
    assert finder.searches == SEARCHES + 1


def test_searches_that_doubt_are_repeated(finder: CountingFinder) -> None:
    tracker, seen = DoorTracker(1), frames(SEARCHES + 3)
    sure = finder.settings
    unsure = replace(sure, verdict=replace(sure.verdict, min_panel=1.0))  # no panel is so flat
    for i, frame in enumerate(seen):
        finder.settings = unsure if i == SEARCHES - 1 else sure
        tracker.find(finder, frame, None, at(i))
    assert finder.searches == len(seen)


def test_a_camera_that_moves_searches(finder: CountingFinder) -> None:
    tracker = DoorTracker(1)
    seen = frames(SEARCHES + 1, step=0.02)
    for i, frame in enumerate(seen):
        tracker.find(finder, frame, None, at(i))
    assert finder.searches == len(seen)


def test_a_door_that_does_not_show_where_it_was_is_noticed(finder: CountingFinder) -> None:
    first, second = frames(2)
    last = finder.search(first)
    assert finder.look_again(second, last) is not None
    assert finder.look_again(second._replace(depth=np.zeros_like(second.depth)), last) is None
    hidden = second._replace(depth=np.minimum(second.depth, np.float32(0.8)))  # somebody before it
    assert finder.look_again(hidden, last) is None
    assert second.grey is not None
    blank = second._replace(grey=np.full_like(second.grey, 0.5))
    assert finder.look_again(blank, last) is None


def test_another_pose_of_the_camera_is_not_that_of_the_sighting(finder: CountingFinder) -> None:
    frame = frames(1)[0]
    pose = frame.camera.pose
    known = frame._replace(up=pose[2, :3].copy(), height=float(pose[2, 3]))
    last = finder.search(known)
    assert finder.look_again(known, last) is not None
    assert finder.look_again(known._replace(height=float(pose[2, 3]) + 0.01), last) is None
    assert finder.look_again(frame, last) is None


def test_nothing_is_compiled_for_the_first_frame() -> None:
    parameters = {**parameter_values("morph_node"), "model": "room_door"}
    load_pipeline(MorphNodeSettings.check(parameters))
    before = compiled_signatures()
    assert DoorFinder.load().find(frames(1)[0]).status is DoorStatus.OK
    assert compiled_signatures() == before


def compiled_signatures() -> dict[str, int]:
    modules = [
        import_module(f"{kmn_perception.doors.__name__}.{found.name}")
        for found in iter_modules(kmn_perception.doors.__path__)
    ]
    return {
        f"{module.__name__}.{name}": len(value.signatures)
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, numba.core.registry.CPUDispatcher)
    }
