"""Estimate the boxes in labelled depth frames, and compare them with plane fits to the labels."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, output_folder, write_json
from kmn_perception.configuration.resources import share_directory
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.experiments.experiment import TABLETOP, FrameResult, load_pipeline, run
from kmn_perception.experiments.labelled_frame import (
    FrameError,
    check_frames,
    read_camera,
    read_frames,
)
from kmn_perception.experiments.pictures import draw
from kmn_perception.experiments.settings import ExperimentSettings
from kmn_perception.experiments.statistics import (
    details,
    method_table,
    object_table,
    statistics,
)
from kmn_perception.network.weights import WeightsError
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.visualization.overlay import save_pictures


def evaluate(
    folder: Path, pipeline: MorphPipeline, settings: ExperimentSettings
) -> list[FrameResult]:
    """Return the result of every frame of a folder.

    Raises
    ------
    FrameError, ConfigurationError
        If the folder's files are not as expected, or not of the camera's shape.
    """
    frames = read_frames(folder)
    settings = replace(settings, camera=read_camera(folder, settings))
    check_frames(frames, settings)
    progress = tqdm(run(frames, pipeline, settings), "frames", len(frames), unit="frame")
    return list(progress)


def main() -> int:
    """Run the executable ``evaluate_frames``."""
    parser = argparse.ArgumentParser(prog="evaluate_frames", description=__doc__)
    parser.add_argument(
        "folder", type=Path, nargs="?", default=share_directory() / "data" / "kinect_boxes",
        help="with NAME_d.png (16 bits, mm) and NAME_l.png (labels); default: the shipped ones",
    )  # fmt: skip
    parser.add_argument("--json", type=output_file, help="file to write the statistics to")
    parser.add_argument(
        "--out", type=output_folder, help="folder to write a picture of each frame to"
    )
    options = parser.parse_args()
    try:
        _report(options)
    except (ConfigurationError, FrameError, OSError, WeightsError) as error:
        print(f"evaluate_frames: {error}", file=sys.stderr)
        return 1
    return 0


def _report(options: argparse.Namespace) -> None:
    """Evaluate the frames, print the tables, and write what was asked for."""
    settings, pipeline = ExperimentSettings.load(), load_pipeline(TABLETOP)
    results = evaluate(options.folder, pipeline, settings)
    summary = statistics(results, settings)
    print(object_table(results), method_table(summary), sep="\n\n")
    print("", details(summary), sep="\n")
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        overlays = draw(results, pipeline.model)
        print(f"pictures: {save_pictures(overlays, len(results), options.out)}")
    if options.json:
        write_json(options.json, summary)
