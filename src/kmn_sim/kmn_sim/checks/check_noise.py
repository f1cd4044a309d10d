"""Compare the simulated Kinect with real frames, scene by scene: the same camera, table and box."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_perception.configuration import resources
from kmn_perception.estimate import Status
from kmn_perception.experiments.experiment import TABLETOP, load_pipeline
from kmn_perception.experiments.labelled_frame import TABLE, LabelledFrame, read_frames
from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.noisy_sensor import NoisySensor
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.pipeline import MorphPipeline
from kmn_perception.scene.camera_pose import NoCameraPoseError
from kmn_perception.scene.depth_view import DepthView
from kmn_sim.checks.noise_statistics import inverse_step, missing_runs, plane_noise
from kmn_sim.checks.settings import NoiseCheckSettings


class Frame(NamedTuple):
    """A depth image (height, width), metres, and where table and box are in it."""

    depth: NDArray[np.float32]
    table: NDArray[np.bool_]
    box: NDArray[np.bool_]


class Twins(NamedTuple):
    """A real frame and the simulated one of the same scene."""

    real: Frame
    simulated: Frame


def twins(
    frames: Sequence[LabelledFrame], settings: NoiseCheckSettings, seed: int
) -> Iterator[Twins]:
    """Yield real frames with their simulated twins; frames without an estimate are left out."""
    sensor, camera = DepthSensor.load(settings.camera), Camera.load(settings.camera)
    pipeline = load_pipeline(TABLETOP)
    for number, frame in enumerate(frames):
        real = Frame(frame.depth, frame.labels == TABLE, frame.labels == frame.objects[0])
        scene = scene_of(real, camera, pipeline)
        if scene is not None:
            yield Twins(real, simulate(*scene, settings.table, NoisySensor(sensor, seed + number)))


def scene_of(
    frame: Frame, camera: Camera, pipeline: MorphPipeline
) -> tuple[Camera, NDArray[np.float64]] | None:
    """Return the camera, with its pose, and the box's cuboids (B, 4, 4), None if not found."""
    points = depth_to_points(frame.depth, camera)
    try:
        pose = pipeline.camera_pose(DepthView(points, camera))
    except NoCameraPoseError:
        return None
    camera = replace(camera, pose=pose)
    seen = points[frame.box & np.isfinite(frame.depth)] @ pose[:3, :3].T + pose[:3, 3]
    floor = pipeline.settings.background.plane_margin
    estimate = pipeline.estimator.estimate(Observation(seen.astype(np.float32), camera, floor))
    if estimate.status != Status.OK:
        return None
    return camera, pipeline.bodies(estimate)


def simulate(
    camera: Camera, box: NDArray[np.float64], table_size: Sequence[float], sensor: NoisySensor
) -> Frame:
    """Return what the simulated sensor measures of a box on a table, in whole millimetres."""
    table = np.diag([*table_size, 1.0])
    table[2, 3] = -table_size[2] / 2.0
    exact = render(np.concatenate([table[None], box]), camera)
    is_box = render(box, camera) == exact
    depth = np.round(1e3 * sensor.measure(exact, camera.fx)) / 1e3
    return Frame(depth.astype(np.float32), np.isfinite(exact) & ~is_box, is_box)


def noise(images: Sequence[Frame], settings: NoiseCheckSettings) -> dict[str, float]:
    """Return the noise about the table by distance, and the steps of the depth."""
    patches = [plane_noise(image.depth, image.table, settings.patch) for image in images]
    means, deviations = (np.concatenate(parts) for parts in zip(*patches, strict=True))
    result = {}
    for distance in settings.distances:
        near = np.abs(means - distance) < settings.reach
        result[f"noise at {distance:g} m [mm]"] = 1e3 * float(np.median(deviations[near]))
    steps = [inverse_step(image.depth, *settings.levels) for image in images]
    result["step of 1 / depth [1/km]"] = 1e3 * float(np.median(steps))
    return result


def missing(pairs: Sequence[Twins], min_width: int) -> list[dict[str, float]]:
    """Return what is missing beside the boxes, of the rows that both images of a pair show."""
    results: list[dict[str, float]] = [{}, {}]
    for side, step in (("left", -1), ("right", 1)):
        runs = np.concatenate(
            [
                [missing_runs(f.depth, f.box, f.table, step, min_width) for f in pair]
                for pair in pairs
            ],
            axis=1,
        )
        for result, known in zip(results, runs[:, (runs >= 0).all(axis=0)], strict=True):
            for name, percentile in (("median", 50.0), ("90 %", 90.0)):
                value = float(np.percentile(known, percentile))
                result[f"missing to the {side}, {name} [px]"] = value
            result[f"missing to the {side}, mean [px]"] = float(known.mean())
    return results


def compare(count: int, seed: int) -> dict[str, dict[str, float]]:
    """Return the statistics ``real`` and ``simulated`` of at most so many frames."""
    frames = read_frames(resources.share_directory() / "data" / "kinect_boxes")[:count]
    settings = NoiseCheckSettings.load()
    pairs = list(tqdm(twins(frames, settings, seed), total=len(frames), unit="frame"))
    return {
        name: {**noise(images, settings), **beside}
        for name, images, beside in zip(
            Twins._fields, zip(*pairs, strict=True), missing(pairs, settings.min_width), strict=True
        )
    }


def arguments() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="check_noise", description=__doc__)
    parser.add_argument("--frames", type=whole_number(1), default=17, help="at most (default 17)")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of the noise")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    return parser.parse_args()


def main() -> int:
    """Run the executable ``check_noise``."""
    options = arguments()
    result = compare(options.frames, options.seed)
    rows = [["statistic", *result]]
    for name in result["real"]:
        rows.append([name, *(f"{values[name]:.2f}" for values in result.values())])
    print(columns(rows))
    if options.json:
        write_json(options.json, result)
    return 0
