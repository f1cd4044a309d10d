"""Measure in rendered rooms what is known of a door after one frame, and after several."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import whole_number
from kmn_perception.command_line.columns import NONE, columns
from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_perception.doors.door_estimate import DoorEstimate
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.frame_fusion import FrameFusion
from kmn_perception.doors.geometry import DOOR
from kmn_perception.doors.resting import RestingCamera
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame
from kmn_perception.evaluation.doors.error_statistics import coverage
from kmn_perception.evaluation.doors.errors import UNITS
from kmn_perception.evaluation.doors.label import describe
from kmn_perception.evaluation.doors.outcome import Outcome, judge
from kmn_perception.evaluation.doors.settings import DoorErrorSettings
from kmn_perception.model.room_model import RoomModel
from kmn_perception.network.threads import use_one_thread
from kmn_perception.network.weights import WeightsError
from kmn_perception.rooms import frame as rendered
from kmn_perception.rooms.label import label
from kmn_perception.rooms.sequence import make_sequence

AFTER = (1, 3, 10, 30)  # frames
SHOWN = {  # name of a column, and the quantities whose errors it holds
    "edges mm": ("left", "right"), "width mm": ("width",), "yaw deg": ("yaw",),
    "handle mm": ("handle_up", "handle_along"), "opening deg": ("opening",),
}  # fmt: skip
CONFIDENCE = 0.95


class Camera(NamedTuple):
    """How the camera moves to the right, metres a frame, and whether its pose is known."""

    name: str
    step: float
    is_known: bool


CAMERAS = (Camera("resting", 0.0, False), Camera("moving", 0.01, True))


class RoomFrames(NamedTuple):
    """What comes out for a room: what is known after each of ``AFTER``, and each frame alone."""

    fused: list[Outcome]
    alone: list[Outcome]
    estimates: list[DoorEstimate]


class FusionMeasurement:
    """Finds the door in each frame of a room, and fuses them."""

    def __init__(self) -> None:
        self._finder = DoorFinder.load()
        self._model = RoomModel.load(self._finder.settings.model)
        self._limits = DoorErrorSettings.load()

    def measure(self, seed: int, frames: int, camera: Camera) -> RoomFrames:
        """Return what is found in a room; raise ``RuntimeError`` if a camera has no place there."""
        fusion, resting = FrameFusion(frames), RestingCamera(DoorSettings.load().fusion.resting)
        result = RoomFrames([], [], [])
        for number, seen in enumerate(make_sequence(seed, frames, camera.step), start=1):
            frame, pose = _as_found(seen), seen.room.camera.pose
            if camera.is_known:
                frame = frame._replace(up=pose[2, :3].copy(), height=float(pose[2, 3]))
            found = self._finder.find(frame)
            rests = resting.rests(frame)
            fused = fusion.add(found, pose if camera.is_known else None, rests)
            truth = describe(Section(label(seen, "", {}), "")).label
            result.alone.append(judge(found, truth, self._model, self._limits))
            if number in AFTER:
                result.fused.append(judge(fused, truth, self._model, self._limits))
            if found.handle_side:
                result.estimates.append(found.in_world(pose))
        return result


def _as_found(seen: rendered.Frame) -> Frame:
    grey = seen.images.grey.astype(np.float32) / np.float32(255.0)
    return Frame(np.nan_to_num(seen.depth).astype(np.float32), grey, seen.room.camera)


def fusion_table(results: Sequence[RoomFrames]) -> str:
    """Return what is known after some frames: errors' and deviations' medians, and coverage."""
    rows = [["frames", "found", "wrong", *SHOWN, f"within {100 * CONFIDENCE:.0f} %"]]
    alone = [one for result in results for one in result.alone]
    rows.append(["each alone", *_cells(alone, len(results[0].alone))])
    for i, number in enumerate(AFTER[: len(results[0].fused)]):
        rows.append([str(number), *_cells([result.fused[i] for result in results], 1)])
    return columns(rows)


def _cells(outcomes: Sequence[Outcome], frames: int) -> list[str]:
    found = [one for one in outcomes if one.errors is not None]
    errors = [one.errors for one in found if one.errors is not None]
    wrong = sum(one.verdict.is_wrong for one in found)
    cells = [f"{len(found) / frames:.4g}", f"{wrong / frames:.3g}"]
    for names in SHOWN.values():
        rows = [list(UNITS).index(name) for name in names]
        values = np.abs([one.values[rows] for one in errors]).ravel()
        stated = np.array([one.stated[rows] for one in errors]).ravel()
        known = np.isfinite(values)
        medians = [f"{np.median(x[known]):.2f}" for x in (values, stated)] if known.any() else []
        cells.append(" / ".join(medians) or NONE)
    share = coverage(errors, CONFIDENCE)
    return [*cells, NONE if share is None else f"{100 * share:.0f} %"]


def shares_table(results: Sequence[RoomFrames]) -> str:
    """Return the share of the stated variances by which the frames of a room do not differ."""
    shares: list[NDArray[np.float64]] = []
    for result in results:
        if len(result.estimates) > 1:
            values = np.array([one.values for one in result.estimates])
            stated = np.array([np.diag(one.covariance) for one in result.estimates])
            shares.append(1.0 - values.var(axis=0, ddof=1) / stated.mean(axis=0))
    if not shares:
        return ""
    rows = [["shared by frames", *DOOR]]
    for name, percent in (("median", 50), ("lower quartile", 25)):
        rows.append([name, *(f"{x:.2f}" for x in np.percentile(shares, percent, axis=0))])
    return columns(rows)


def arguments(command: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="evaluate_fusion", description=__doc__)
    parser.add_argument("--doors", type=whole_number(1), default=20, help="rooms (default 20)")
    parser.add_argument(
        "--frames", type=whole_number(1), default=AFTER[-1],
        help=f"of each room (default {AFTER[-1]})",
    )  # fmt: skip
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the first room")
    return parser.parse_args(command)


def main(command: Sequence[str] | None = None) -> int:
    """Run the executable ``evaluate_fusion``."""
    options = arguments(command)
    use_one_thread()
    try:
        measurement = FusionMeasurement()
        for camera in CAMERAS:
            results: list[RoomFrames] = []
            seeds = count(options.seed)
            with tqdm(total=options.doors, desc=camera.name, unit="room") as bar:
                while len(results) < options.doors:
                    try:
                        results.append(measurement.measure(next(seeds), options.frames, camera))
                    except RuntimeError:  # no place for the camera
                        continue
                    bar.update()
            print(f"{camera.name} camera: doors; errors / deviations, medians")
            print(fusion_table(results), shares_table(results), sep="\n\n", end="\n\n")
    except (ConfigurationError, OSError, WeightsError) as error:
        print(f"evaluate_fusion: {error}", file=sys.stderr)
        return 1
    return 0
