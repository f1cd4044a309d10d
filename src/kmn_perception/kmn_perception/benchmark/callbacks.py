"""Whole callbacks of morph_node, from message to messages: a door in its wall, boxes on a table."""

from __future__ import annotations

import cProfile
import io
import pstats
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import cycle, islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header
from tqdm import tqdm

from kmn_perception.benchmark.scene import boxes_on_a_table
from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.doors.door_tracker import DoorTracker
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.model.camera import Camera
from kmn_perception.pipeline_interface import Pipeline
from kmn_perception.rooms.sequence import make_sequence
from kmn_perception.ros.messages import (
    image_from_depth,
    info_from_camera,
    markers_from_estimates,
    parameters_from_estimate,
    view_from_image,
)
from kmn_perception.ros.messages.grey import grey_in_view
from kmn_perception.ros.messages.writing import image_from_pixels
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.pipeline_loading import load_pipeline
from kmn_perception.ros.stamps import stamp_of

# A camera that rests before a door, at 30 Hz; the same frames, each by itself; larger ones; boxes.
CASES = ("door", "door_searched", "door_1280x720", "boxes")
SHOWN = 40  # functions
ROOM = 6100  # seed of a room whose door is in view
RATE = 30.0  # Hz
DISTINCT = 4  # frames whose noise differs; they come again and again
LARGE = 1280, 720
DOOR = {"camera_pose": "support_plane", "calibration": "calibrated"}
TABLETOP = "morph_node_tabletop"  # file of parameters


class Seen(NamedTuple):
    """What the camera sends of an exposure; without grey for boxes."""

    depth: NDArray[np.float32]
    grey: NDArray[np.uint8] | None
    camera: Camera


def measure(repetitions: int) -> dict[str, dict[str, float]]:
    """Return median and 95th percentile of the time that the ``CASES`` take of one core."""
    result = {}
    cases = _cases(repetitions)
    for name in tqdm(CASES, "callbacks", unit=" cases", mininterval=1.0):
        times = cases[name]()
        result[name] = {
            "median_ms": float(np.median(times)),
            "p95_ms": float(np.percentile(times, 95)),
        }
    return result


def profile(name: str, repetitions: int) -> str:
    """Return in which functions one of the ``CASES`` spends its time, the costliest first."""
    case, profiler = _cases(repetitions)[name], cProfile.Profile(time.thread_time)
    case()  # the first time loads and compiles
    profiler.runcall(case)
    text = io.StringIO()
    pstats.Stats(profiler, stream=text).strip_dirs().sort_stats("tottime").print_stats(SHOWN)
    return text.getvalue()


def _cases(repetitions: int) -> dict[str, Callable[[], list[float]]]:
    in_walls = {**parameter_values("morph_node"), **DOOR, "model": DoorSettings.load().model}
    doors = load_pipeline(MorphNodeSettings.check(in_walls))
    boxes = load_pipeline(MorphNodeSettings.check(parameter_values("morph_node", TABLETOP)))
    small, large = (list(door_frames(size)) for size in (None, LARGE))
    on_table = [Seen(boxes_on_a_table(boxes.model), None, boxes.model.camera)]
    return {
        "door": lambda: _times(doors, small, repetitions, DoorTracker(1)),
        "door_searched": lambda: _times(doors, small, repetitions, None),
        "door_1280x720": lambda: _times(doors, large, repetitions, DoorTracker(1)),
        "boxes": lambda: _times(boxes, on_table, repetitions, None),
    }


def door_frames(size: tuple[int, int] | None = None) -> Iterator[Seen]:
    """Yield the exposures of a camera that rests before a door, of so many columns and rows."""
    camera = Camera.load("d455")
    for frame in make_sequence(ROOM, DISTINCT, camera=camera.resized(*size) if size else camera):
        yield Seen(frame.depth, frame.images.grey, frame.room.camera)


def _times(
    pipeline: Pipeline, frames: Sequence[Seen], repetitions: int, past: DoorTracker | None
) -> list[float]:
    """Return the milliseconds of this thread for each frame, but for those that warm up."""
    times = []
    for number, seen in enumerate(islice(cycle(frames), repetitions + len(frames))):
        header = Header(frame_id="camera", stamp=stamp_of(1.0 + number / RATE))
        image = image_from_depth(seen.depth, "16UC1", header)
        grey = None if seen.grey is None else image_from_pixels(seen.grey, "mono8", header)
        info = info_from_camera(seen.camera, header)
        started = time.thread_time()
        _callback(pipeline, image, grey, info, past)
        times.append(1e3 * (time.thread_time() - started))
    return times[len(frames) :]


def _callback(
    pipeline: Pipeline, image: Image, grey: Image | None, info: CameraInfo, past: DoorTracker | None
) -> None:
    """Do what morph_node does with a frame."""
    view = view_from_image(image, info, max_range=10.0)
    if grey is not None:
        view = replace(view, intensity=grey_in_view(grey, info, view))
    found = pipeline.estimate_all(view, None, past)
    for number, one in enumerate(found):
        parameters_from_estimate(one.estimate, image.header, number, one.truncated)
    markers_from_estimates([(o.estimate, pipeline.bodies(o.estimate)) for o in found], image.header)
