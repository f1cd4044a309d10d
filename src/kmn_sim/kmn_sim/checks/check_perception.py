"""Score morph_node on simulated scenes, live through the topics, against the ground truth."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.noisy_sensor import SENSORS
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_sim.checks.scene_client import SceneEstimate, scene_client
from kmn_sim.checks.settings import PerceptionCheckSettings


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog="check_perception", description=__doc__)
    shipped = parameter_values("sim_node")["model"]
    parser.add_argument("--model", default=shipped, help="name or file (default %(default)s)")
    parser.add_argument("--scenes", type=whole_number(1), default=20, help="default 20")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of scenes and noise")
    parser.add_argument("--noise", choices=("none", *SENSORS), default="none", help="default none")
    parser.add_argument("--room", action="store_true", help="the door stands in a room")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    return parser.parse_args(argv)


def whole_scenes(
    model: KinematicModel, seed: int, count: int, margin: float
) -> Iterator[NDArray[np.float64]]:
    """Draw morphing parameters (n + m,) of objects that are wholly in the camera's view."""
    generator = np.random.default_rng(seed)
    while count:
        values = model.sample(generator, 1)[0]
        if in_view(model.unit_cubes(*model.split(values)), model.camera, margin):
            count -= 1
            yield values


def in_view(unit_cubes: NDArray[np.float64], camera: Camera, margin: float) -> bool:
    """Tell whether all corners of cuboids (B, 4, 4) lie in the image, off its border in pixels."""
    signs = np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3, [1.0]), axis=-1).reshape(8, 4)
    corners = camera.world_to_camera @ unit_cubes @ signs.T
    x, y, z, _ = np.moveaxis(corners, 1, 0)
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    inside = (u > margin) & (u < camera.width - 1 - margin)
    inside &= (v > margin) & (v < camera.height - 1 - margin) & (z > camera.near)
    return bool(inside.all())


def errors(model: KinematicModel, answer: SceneEstimate) -> NDArray[np.float64]:
    """Return the absolute errors (n + m,) of an answer, of an equivalent object where nearer."""
    estimate = model.nearest_equivalent(answer.estimate, answer.truth)
    return np.abs(estimate - answer.truth)


def check(options: argparse.Namespace) -> dict[str, Any]:
    """Show the scenes, print their errors as they come, and return all as written to JSON."""
    model, settings = KinematicModel.load(options.model), PerceptionCheckSettings.load()
    names = [parameter.name for parameter in model.parameters]
    drawn = whole_scenes(model, options.seed, options.scenes, settings.margin)
    scenes = []
    sim = {"noise": options.noise, "seed": options.seed, "room": options.room}
    with scene_client(model, options.model, sim, settings) as client:
        print(columns([["scene", *names, "status", "ms"]]), flush=True)
        for number, values in enumerate(drawn):
            room = {"seed": options.seed + number} if options.room else {}
            answer = client.show(values, **room)
            error = errors(model, answer)
            texts = [f"{number:5d}", *(f"{e:.4f}" for e in error)]
            texts += [answer.reason or "OK", f"{1e3 * answer.latency:.0f}"]
            print("  ".join(texts), flush=True)
            scenes.append(
                {
                    "truth": answer.truth.tolist(),
                    "estimate": [float(e) if np.isfinite(e) else None for e in answer.estimate],
                    "error": [float(e) if np.isfinite(e) else None for e in error],
                    "status": answer.status,
                    "reason": answer.reason,
                    "latency_ms": 1e3 * answer.latency,
                    "within": bool(answer.status == 0 and (error <= settings.tolerance).all()),
                }
            )
    return {
        "model": model.name,
        "parameters": names,
        "seed": options.seed,
        "noise": options.noise,
        "room": options.room,
        "tolerance": settings.tolerance,
        "within": sum(scene["within"] for scene in scenes),
        "scenes": scenes,
    }


def summary(result: dict[str, Any]) -> str:
    """Return the table of errors over the scenes."""
    scenes = result["scenes"]
    table = np.array([[np.nan if e is None else e for e in s["error"]] for s in scenes])
    rows = [["error", *result["parameters"]]]
    for name, statistic in (("mean", np.nanmean), ("median", np.nanmedian), ("largest", np.nanmax)):
        rows.append([name, *(f"{value:.4f}" for value in statistic(table, axis=0))])
    return (
        f"{columns(rows)}\n{result['within']} of {len(scenes)} scenes are OK with all errors "
        f"within {result['tolerance']:g}"
    )


def main() -> int:
    """Run the executable ``check_perception``."""
    options = arguments(own_arguments())
    with ros_session("check_perception"):
        result = check(options)
    print(summary(result))
    if options.json:
        write_json(options.json, result)
    return 0 if result["within"] == len(result["scenes"]) else 1
