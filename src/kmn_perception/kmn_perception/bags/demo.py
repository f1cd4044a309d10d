"""Show the estimation on real Kinect clouds: a bag, morph_node in another process, pictures."""

from __future__ import annotations

import argparse
import math
import os
import shutil
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.time import Time
from visualization_msgs.msg import Marker, MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_perception.bags.example_bag import CAMERA, load_frames, make_example_bag
from kmn_perception.bags.replay import Replay
from kmn_perception.command_line.arguments import output_folder
from kmn_perception.configuration import resources
from kmn_perception.estimate import Status
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.pipeline_interface import PipelineSettings
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.node_process import (
    NoAnswerError,
    NodeProcess,
    ProcessClient,
    namespace_arguments,
)
from kmn_perception.ros.parameters import declare_parameters
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_perception.scene.segmentation import segment
from kmn_perception.scene.support_plane import find_support_plane, pose_above
from kmn_perception.visualization.overlay import Overlay, ShownObject, save_pictures

POINTS, PARAMETERS, MARKERS = "/points", "morphing_parameters", "morphed_model"
RATE = 2.0  # frames a second
REQUIRED = 15  # of the 17 frames with all objects valid
START_TIMEOUT = 120.0  # seconds for morph_node to load and compile
ANSWER_TIMEOUT = 20.0  # seconds for the parameters of one frame
NOTHING: NDArray[np.float64] = np.empty((0, 4, 4))


class FoundObject(NamedTuple):
    """What morph_node made of an object.

    Attributes
    ----------
    parameters
        Its message.
    unit_cubes
        (B, 4, 4) bodies of the estimated model, see `KinematicModel.unit_cubes`; B = 0 if there
        is no estimate.
    """

    parameters: MorphingParameters
    unit_cubes: NDArray[np.float64]

    @property
    def status(self) -> Status:
        """What the parameters are worth."""
        return Status(self.parameters.status)

    def describe(self) -> str:
        """Return number, place, sides and status."""
        values = dict(zip(self.parameters.theta_names, self.parameters.theta, strict=True))
        texts = [f"object {self.parameters.id}"]
        for cube in self.unit_cubes:
            sides = 100.0 * np.linalg.norm(cube[:3, :3], axis=0)
            size = " x ".join(f"{side:4.1f}" for side in sides)
            yaw = math.degrees(values["yaw"])
            texts.append(f"x {values['x']:6.3f} m  y {values['y']:6.3f} m  yaw {yaw:5.1f}°")
            texts.append(f"{size} cm  residual {1e3 * self.parameters.residual:4.1f} mm")
        return "  ".join([*texts, self.status.name, self.parameters.reason])


class FrameReply(NamedTuple):
    """What morph_node made of a frame, and the seconds from its publication to the answer."""

    objects: list[FoundObject]
    latency: float

    @property
    def valid(self) -> int:
        """Number of objects whose parameters are valid."""
        return sum(found.status is Status.OK for found in self.objects)

    def describe(self) -> str:
        """Return how many objects are valid."""
        judged = "OK" if self.valid == len(self.objects) else f"{self.valid} OK"
        return f"{len(self.objects)} objects, {judged}"


class Listener:
    """Waits for the objects of one frame after the other."""

    def __init__(self, node: Node, model: KinematicModel, process: NodeProcess) -> None:
        self._node, self._model = node, model
        self._client = ProcessClient(node, [process])
        self._received: dict[int, list[MorphingParameters]] = {}
        self._drawn: dict[int, int] = {}
        node.create_subscription(MorphingParameters, PARAMETERS, self._receive, 100)
        node.create_subscription(MarkerArray, MARKERS, self._count, 10)

    def _receive(self, parameters: MorphingParameters) -> None:
        stamp = Time.from_msg(parameters.header.stamp).nanoseconds
        self._received.setdefault(stamp, []).append(parameters)

    def _count(self, shown: MarkerArray) -> None:
        """Count the bodies of a frame, by which it is known to be complete."""
        added = sum(marker.action == Marker.ADD for marker in shown.markers)
        self._drawn[Time.from_msg(shown.markers[0].header.stamp).nanoseconds] = added

    def wait_until_ready(self, replay: Replay) -> None:
        """Wait until morph_node listens and speaks."""
        self._client.wait(
            lambda: replay.wait_for_subscriber(0.0) and self._node.count_publishers(PARAMETERS),
            START_TIMEOUT,
            "morph_node",
        )

    def wait_for(self, stamp: int) -> FrameReply | None:
        """Return the answer to the frame of this stamp in nanoseconds, None if there is none."""
        start = time.monotonic()
        try:
            self._client.wait(lambda: self._is_complete(stamp), ANSWER_TIMEOUT, "morph_node")
        except NoAnswerError:
            return None
        latency = time.monotonic() - start
        return FrameReply(
            [self._found(parameters) for parameters in self._received[stamp]], latency
        )

    def _is_complete(self, stamp: int) -> bool:
        """Tell whether there is a message for each object that is drawn, or that there is none."""
        if stamp not in self._drawn or stamp not in self._received:
            return False
        bodies = sum(len(self._found(p).unit_cubes) for p in self._received[stamp])
        return bodies == self._drawn[stamp]

    def _found(self, parameters: MorphingParameters) -> FoundObject:
        cubes = NOTHING
        if np.isfinite([*parameters.theta, *parameters.gamma]).all():
            cubes = self._model.unit_cubes(parameters.theta, parameters.gamma)
        return FoundObject(parameters, cubes)


def node_arguments() -> list[str]:
    """Return the ROS arguments for all boxes on a table, in a namespace of its own."""
    file = resources.find("config/nodes", "morph_node_tabletop")
    alone = namespace_arguments(f"/demo_{os.getpid()}")  # whatever else runs is not disturbed
    parameters = ["-p", "reliability:=reliable", "-p", "objects:=all"]
    return ["--params-file", str(file), *parameters, *alone]


def estimate_frames(
    node: Node, model: KinematicModel, bag: Path, log: Path
) -> list[FrameReply | None]:
    """Replay the bag into morph_node, print its answers and return them; None for no answer.

    Raises
    ------
    ProcessError
        If morph_node does not start, or ends.
    """
    answers = []
    with NodeProcess("kmn_perception", "morph_node", node_arguments(), log) as process:
        listener = Listener(node, model, process)
        replay = Replay(node, bag, [POINTS], {POINTS: "points"})
        listener.wait_until_ready(replay)
        for number, message in enumerate(replay.play()):
            answer = listener.wait_for(message.stamp)
            answers.append(answer)
            if answer:
                milliseconds = f"{1e3 * answer.latency:4.0f} ms"
                print(f"frame {number:2d}", milliseconds, answer.describe(), sep="  ", flush=True)
                for found in answer.objects:
                    print(f"    {found.describe()}", flush=True)
            else:
                print(f"frame {number:2d}  no answer within {ANSWER_TIMEOUT:g} s", flush=True)
    return answers


def draw_frames(
    answers: Sequence[FrameReply | None], model: KinematicModel, settings: PipelineSettings
) -> Iterator[Overlay]:
    """Yield the picture of each frame: the points of its objects and the estimated models."""
    intrinsics = Camera.load(CAMERA)
    for number, (depth, answer) in enumerate(zip(load_frames(), answers, strict=True)):
        points = depth_to_points(depth, intrinsics)
        plane = find_support_plane(points, settings.plane)
        pose = model.camera.pose if plane is None else pose_above(plane, model.camera.pose)
        segments = segment(points, pose, pose[:3, 3], settings.background, settings.scene)
        seen = [ShownObject(segments.of_object(i), NOTHING, True) for i in range(segments.objects)]
        found = [
            ShownObject(
                segments.points[:0],
                found.unit_cubes,
                found.status is Status.OK,
                model.axes_among(len(found.unit_cubes)),
            )
            for found in (answer.objects if answer else [])
        ]
        yield Overlay(
            depth=depth,
            camera=replace(intrinsics, pose=pose),
            objects=[*seen, *found],
            title=f"frame {number}: {answer.describe() if answer else 'no answer'}",
        )


def run(folder: Path) -> int:
    """Run the demo in a folder; return the number of frames of which all objects are valid.

    Raises
    ------
    BagError, ProcessError
        If it cannot go on.
    """
    bag, log = folder / "kinect_boxes", folder / "morph_node.log"
    shutil.rmtree(bag, ignore_errors=True)
    make_example_bag(bag, RATE)
    node = Node("demo", cli_args=["--ros-args", *node_arguments()])
    settings = MorphNodeSettings.check(declare_parameters(node, "morph_node"))
    model = KinematicModel.load(settings.model)
    print(f"starting morph_node, which logs to {log}", flush=True)
    answers = estimate_frames(node, model, bag, log)
    overlays = draw_frames(answers, model, settings.pipeline)
    sheet = save_pictures(overlays, len(answers), folder)
    accepted = sum(bool(answer and answer.valid == len(answer.objects)) for answer in answers)
    boxes = sum(answer.valid for answer in answers if answer)
    print(
        f"{boxes} boxes found; {accepted} of {len(answers)} frames have status OK for all objects"
    )
    print(f"all frames: {sheet}\none by one: {folder / 'frame_00.png'} ...")
    return accepted


def main() -> int:
    """Run the executable ``demo_bag``."""
    parser = argparse.ArgumentParser(prog="demo_bag", description=__doc__)
    parser.add_argument(
        "--out",
        type=output_folder,
        default=Path("outputs/demo"),
        help="folder of the bag and the pictures",
    )
    options = parser.parse_args(own_arguments())
    with ros_session("demo_bag"):
        return 0 if run(options.out) >= REQUIRED else 1
