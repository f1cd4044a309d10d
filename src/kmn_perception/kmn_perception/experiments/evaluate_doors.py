"""Find the doors in frames of a depth camera, and compare them with labels and with baselines."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, output_folder, write_json
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.evaluation.doors.label import describe_camera
from kmn_perception.experiments.doors.experiment import MODES, DoorExperiment
from kmn_perception.experiments.doors.frames import DEPTHS, find_frames
from kmn_perception.experiments.doors.pictures import Pictures
from kmn_perception.experiments.doors.statistics import statistics
from kmn_perception.experiments.doors.tables import frame_table, in_view, method_table
from kmn_perception.experiments.labelled_frame import FrameError
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.network.threads import use_one_thread
from kmn_perception.network.weights import WeightsError


def arguments(command: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="evaluate_doors", description=__doc__)
    parser.add_argument(
        "folder", type=Path,
        help="with NAME_d.png (16 bits, mm) or NAME_raw.png (the same, as the sensor delivers it), "
        "and where there are, NAME_colour.jpg and NAME.json (label; without it, no door is there)",
    )  # fmt: skip
    parser.add_argument("--json", type=output_file, help="file to write the statistics to")
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
    return parser.parse_args(command)


def main(command: Sequence[str] | None = None) -> int:
    """Run the executable ``evaluate_doors``."""
    options = arguments(command)
    try:
        _report(options)
    except (ConfigurationError, FrameError, OSError, WeightsError) as error:
        print(f"evaluate_doors: {error}", file=sys.stderr)
        return 1
    return 0


def _report(options: argparse.Namespace) -> None:
    """Evaluate the frames, print the tables, and write what was asked for."""
    use_one_thread()
    settings = ExperimentSettings.load()
    without_json = describe_camera(options.camera or settings.doors.camera)
    frames = find_frames(options.folder, options.depth, without_json)
    experiment = DoorExperiment(settings, DoorSettings.load())
    pictures = Pictures(options.out) if options.out else None
    results = []
    for files in tqdm(frames, "frames", unit="frame"):
        frame = files.read()
        results.append(experiment.run(frame))
        if pictures:
            pictures.add(frame, results[-1])
    summary = statistics(results, settings)
    for mode in MODES:
        print(frame_table(results, mode), end="\n\n")
    print(method_table(summary), in_view(results), sep="\n\n")
    if pictures:
        print(f"pictures: {pictures.save_all()}")
    if options.json:
        write_json(options.json, summary)
