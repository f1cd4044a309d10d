"""Find the doors in frames of a depth camera, and compare them with labels and with baselines."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from kmn_perception.command_line.arguments import output_folder
from kmn_perception.configuration.hashes import short_hash
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.evaluation.doors.label import describe_camera
from kmn_perception.experiments.doors.experiment import MODES, DoorExperiment, DoorResult
from kmn_perception.experiments.doors.frames import DEPTHS, FrameFiles, find_frames
from kmn_perception.experiments.doors.pictures import Pictures
from kmn_perception.experiments.doors.statistics import statistics
from kmn_perception.experiments.doors.tables import frame_table, in_view, method_table
from kmn_perception.experiments.labelled_frame import FrameError
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.network.weights import WeightsError
from kmn_perception.sharing.experiment import ExperimentCommand, SharedExperiment

WORTHWHILE = 3  # frames of a process; for fewer its start, some seconds, does not pay


def parser() -> argparse.ArgumentParser:
    """Return the parser of what is to be evaluated."""
    parser = argparse.ArgumentParser(prog="evaluate_doors", description=__doc__)
    parser.add_argument(
        "folder", type=Path,
        help="with NAME_d.png (16 bits, mm) or NAME_raw.png (the same, as the sensor delivers it), "
        "and where there are, NAME_colour.jpg and NAME.json (label; without it, no door is there)",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=output_folder, help="folder to write a picture of each frame to"
    )
    parser.add_argument(
        "--depth", choices=DEPTHS, default=DEPTHS[0],
        help="which depth image: NAME_d.png, or where it is missing NAME_raw.png; or NAME_raw.png "
        "with the deviations of a sensor as it is delivered (default calibrated)",
    )  # fmt: skip
    parser.add_argument(
        "--camera", help="of frames without a NAME.json: a name in config/cameras, or a file"
    )
    return parser


class DoorFrames:
    """Evaluates one frame of some after the other."""

    def __init__(self, frames: Sequence[FrameFiles]) -> None:
        self._frames = frames
        self._experiment = DoorExperiment(ExperimentSettings.load(), DoorSettings.load())

    def __call__(self, index: int) -> DoorResult:
        """Return the result of a frame."""
        return self._experiment.run(self._frames[index].read())


def prepare(options: argparse.Namespace) -> SharedExperiment[DoorResult]:
    """Return the experiment that the options tell."""
    settings = ExperimentSettings.load()
    without_json = describe_camera(options.camera or settings.doors.camera)
    frames = find_frames(options.folder, options.depth, without_json)

    def conclude(results: list[DoorResult]) -> tuple[str, Any]:
        summary = statistics(results, settings)
        texts = [frame_table(results, mode) for mode in MODES]
        texts += [method_table(summary), in_view(results)]
        if options.out:
            pictures = Pictures(options.out)
            for files, result in zip(frames, results, strict=True):
                pictures.add(files.read(), result)
            texts.append(f"pictures: {pictures.save_all()}")
        return "\n\n".join(texts), summary

    return SharedExperiment(
        title="frames",
        unit="frames",
        items=len(frames),
        kind=DoorResult,
        make=partial(DoorFrames, frames),
        conclude=conclude,
        worthwhile=WORTHWHILE,
        depends_on={"frames": short_hash(*(file for each in frames for file in each.files))},
    )


COMMAND = ExperimentCommand(
    package="kmn_perception",
    name="evaluate_doors",
    parser=parser,
    prepare=prepare,
    expected=(ConfigurationError, FrameError, WeightsError),
    outputs=("out",),
)


def main(argv: Sequence[str] | None = None) -> None:
    """Run the executable ``evaluate_doors``."""
    COMMAND.start(argv)
