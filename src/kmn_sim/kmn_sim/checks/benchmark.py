"""Measure how fast the simulation runs, its renderers, and the way to morph_node's estimate."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from std_msgs.msg import Header

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.node_process import ProcessError
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_sim.checks.check_perception import whole_scenes
from kmn_sim.checks.scene_client import scene_client
from kmn_sim.checks.settings import BenchmarkSettings, PerceptionCheckSettings, TouchPoint
from kmn_sim.control.trajectory import Command, Waypoint
from kmn_sim.ros.messages import ENCODINGS, image_from_colour
from kmn_sim.sensors.depth_camera import DepthCamera
from kmn_sim.world.renderer import RENDERERS
from kmn_sim.world.scenario import Scenario
from kmn_sim.world.settings import WorldSettings
from kmn_sim.world.simulation import Simulation


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog="benchmark", description=__doc__)
    parser.add_argument("--scenes", type=whole_number(1), default=20, help="default 20")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    return parser.parse_args(argv)


def real_time_factor(
    simulation: Simulation, camera: DepthCamera | None, settings: BenchmarkSettings
) -> float:
    """Return the simulated seconds in one second, of a robot that touches the door."""
    simulation.build(simulation.scenario)
    touch(simulation, settings.touch)
    frame_steps = round(1.0 / (settings.camera_rate * simulation.step_time))
    start = time.perf_counter()
    for step in range(round(settings.duration / simulation.step_time)):
        simulation.step()
        if camera is not None and step % frame_steps == 0:
            camera.capture(simulation)
    return settings.duration / (time.perf_counter() - start)


def touch(simulation: Simulation, points: Sequence[TouchPoint]) -> None:
    """Drive the robot with outstretched arm against the door."""
    names, state = tuple(simulation.robot.limits), simulation.robot.state()
    position = dict(zip(names, state.positions.tolist(), strict=True))
    waypoints = []
    for point in points:
        position |= point.joints
        waypoints.append(Waypoint(point.time, tuple(position.values())))
    simulation.controllers.accept(Command(names, waypoints), simulation.time)
    simulation.run(points[-1].time)
    assert simulation.mechanism is not None
    bodies = simulation.robot.body, simulation.mechanism.body
    if not simulation.physics.getContactPoints(*bodies):
        raise ProcessError("the robot does not touch the door")


def milliseconds(work: Callable[[], object], repetitions: int) -> float:
    """Return the median duration of some work that is done again and again."""
    work()
    durations = []
    for _ in range(repetitions):
        start = time.perf_counter()
        work()
        durations.append(1e3 * (time.perf_counter() - start))
    return float(np.median(durations))


def benchmark(scenes: int) -> dict[str, Any]:
    """Return all measurements, as written to JSON."""
    settings, check_settings = BenchmarkSettings.load(), PerceptionCheckSettings.load()
    model, world = KinematicModel.load(settings.model), WorldSettings.load()
    scenario, camera = Scenario(model, model.prototype), DepthCamera(model.camera)
    factors, depth_ms, image_ms = {}, {}, {}
    for wanted in RENDERERS:
        simulation = Simulation(scenario, world, renderer=wanted)
        name = simulation.renderer.name
        depth_ms[name] = milliseconds(
            lambda: camera.capture(simulation),  # noqa: B023
            settings.frames,
        )
        colour = camera.expose(simulation).colour
        for encoding in ENCODINGS:
            image_ms[f"{name}_{encoding}"] = milliseconds(
                lambda: image_from_colour(colour, encoding, Header()),  # noqa: B023
                settings.frames,
            )
        if wanted == RENDERERS[0]:
            factors["physics"] = real_time_factor(simulation, None, settings)
            factors["with_camera"] = real_time_factor(simulation, camera, settings)
        simulation.close()
    drawn = whole_scenes(model, 0, scenes, check_settings.margin)
    with scene_client(model, settings.model, {}, check_settings) as client:
        latencies = [1e3 * client.show(values).latency for values in drawn]
    return {
        "real_time_factor": factors,
        "depth_ms": depth_ms,
        "image_ms": image_ms,  # in addition: the colours are rendered with the depth
        "end_to_end_ms": {
            "median": float(np.median(latencies)),
            "p95": float(np.percentile(latencies, 95.0)),
        },
    }


def report(result: dict[str, Any]) -> str:
    """Return the table of a benchmark."""
    rows = [["measurement", "value"]]
    for name, values in result.items():
        rows += [[f"{name} {key}", f"{value:.2f}"] for key, value in values.items()]
    return columns(rows)


def main() -> int:
    """Run the executable ``benchmark``."""
    options = arguments(own_arguments())
    with ros_session("benchmark"):
        result = benchmark(options.scenes)
    print(report(result))
    if options.json:
        write_json(options.json, result)
    return 0
