"""The node that estimates morphing parameters from clouds or depth images."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import torch
from diagnostic_msgs.msg import DiagnosticStatus
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.estimator import Estimate, MorphEstimator, Status
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.pipeline import MorphPipeline, ObjectEstimate
from kmn_perception.ros.frame_statistics import FrameStatistics
from kmn_perception.ros.mailbox import Mailbox
from kmn_perception.ros.messages import (
    MessageError,
    markers_from_estimates,
    parameters_from_estimate,
    points_from_cloud,
    points_from_depth,
)
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.node_program import run_node
from kmn_perception.ros.parameters import declare_parameters, read_parameters
from kmn_perception.ros.reports import REPORT_PERIOD, ThrottledWarnings, report_periodically
from kmn_perception.ros.sensor_watch import SensorWatch
from kmn_perception.scene.tracking import ObjectTracker

QUEUE_DEPTH = 10  # of the publishers


class Frame(NamedTuple):
    """A message that waits for its estimation.

    ``read`` returns its points, given the maximal range, or raises `MessageError`; ``received``
    is in seconds of the monotonic clock; ``info`` is the description of a depth image.
    """

    header: Header
    read: Callable[[float], NDArray[np.float32]]
    received: float
    info: CameraInfo | None = None


class DetectedObject(NamedTuple):
    """An object's estimate, its number (0 for one alone) and whether the image cuts it."""

    estimate: Estimate
    number: int
    truncated: bool


class FrameEstimates(NamedTuple):
    """The objects of a frame, with what their messages need."""

    model: KinematicModel
    header: Header
    objects: list[DetectedObject]

    def parameters(self) -> list[MorphingParameters]:
        """Return the message of each object."""
        return [
            parameters_from_estimate(self.model, found.estimate, self.header, *found[1:])
            for found in self.objects
        ]

    def markers(self) -> MarkerArray:
        """Return the message that shows all objects."""
        estimates = [found.estimate for found in self.objects]
        return markers_from_estimates(self.model, estimates, self.header)


class Active(NamedTuple):
    """What the node works with at present; replaced as a whole when parameters change."""

    settings: MorphNodeSettings
    pipeline: MorphPipeline


class MorphNode(Node):
    """Estimates the newest frame in a thread of its own; the executor only takes messages.

    Thus service, parameters and diagnostics are served however fast the frames come.

    Raises
    ------
    ParameterException, ParameterError
        If a parameter is wrong.
    OSError, ConfigurationError, WeightsError
        If model or weights cannot be loaded.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("morph_node", **options)
        settings = MorphNodeSettings.check(declare_parameters(self, "morph_node"))
        self._active = Active(settings, _load(settings))
        self._statistics = FrameStatistics()
        self._sensor = SensorWatch(REPORT_PERIOD)
        self._mailbox: Mailbox[Frame] = Mailbox()
        self._tracker = ObjectTracker(settings.object_distance, settings.pipeline.objects.memory)
        self._camera_info: CameraInfo | None = None
        self._image_without_info: Image | None = None
        self._last_source, self._last_stamp = "", 0
        self._sequence: dict[str, int] = {}
        self._warnings = ThrottledWarnings(self)
        self._connect(ReliabilityPolicy[settings.reliability.upper()])
        self.add_on_set_parameters_callback(self._on_parameters)
        # A daemon, so that an interrupt in this very moment does not leave the process waiting.
        self._worker = threading.Thread(target=self._work, name="estimation", daemon=True)
        self._worker.start()
        self.get_logger().info(f"estimating morphing parameters of model '{settings.model}'")

    def destroy_node(self) -> None:
        """End the estimation thread and the node."""
        self._mailbox.close()
        self._worker.join()
        super().destroy_node()

    def _connect(self, reliability: ReliabilityPolicy) -> None:
        self._parameters_publisher = self.create_publisher(
            MorphingParameters, "morphing_parameters", QUEUE_DEPTH
        )
        self._model_publisher = self.create_publisher(MarkerArray, "morphed_model", QUEUE_DEPTH)
        newest = QoSProfile(depth=1, reliability=reliability)
        # Taken in this order where several came: an image after the camera_info published with it.
        # rclpy calls with the message's info too, of which its annotations know nothing.
        self.create_subscription(CameraInfo, "depth/camera_info", self._on_camera_info, newest)
        self.create_subscription(Image, "depth/image", self._on_image, newest)  # type: ignore[arg-type]
        self.create_subscription(PointCloud2, "points", self._on_points, newest)  # type: ignore[arg-type]
        self.create_service(EstimateMorphing, "estimate_morphing", self._on_estimate)
        report_periodically(self, self._report)

    def _on_points(self, cloud: PointCloud2, info: Mapping[str, Any]) -> None:
        self._count_lost("points", info)
        self._submit("points", cloud.header, partial(points_from_cloud, cloud))

    def _on_image(self, image: Image, info: Mapping[str, Any]) -> None:
        """Submit an image with the newest camera_info, or keep it until the first one comes."""
        self._count_lost("depth/image", info)
        if self._camera_info is not None:
            self._submit_image(image, self._camera_info)
            return
        if self._image_without_info is not None:
            self._refuse("no_camera_info", "depth/image came without depth/camera_info")
        self._image_without_info = image

    def _on_camera_info(self, camera_info: CameraInfo) -> None:
        self._camera_info = camera_info
        image, self._image_without_info = self._image_without_info, None
        if image is not None:
            self._submit_image(image, camera_info)

    def _count_lost(self, topic: str, info: Mapping[str, Any]) -> None:
        """Count the messages of a topic's publisher between this one and the one before."""
        number = info["publication_sequence_number"]
        self._statistics.lose(max(0, number - self._sequence.get(topic, number) - 1))
        self._sequence[topic] = number

    def _submit_image(self, image: Image, info: CameraInfo) -> None:
        self._submit("depth/image", image.header, partial(points_from_depth, image, info), info)

    def _submit(
        self,
        source: str,
        header: Header,
        read: Callable[[float], NDArray[np.float32]],
        info: CameraInfo | None = None,
    ) -> None:
        """Hand the newest frame to the estimation thread."""
        stamp = header.stamp.sec * 10**9 + header.stamp.nanosec
        last_source, last_stamp = self._last_source, self._last_stamp
        self._last_source, self._last_stamp = source, stamp
        if stamp == last_stamp != 0 and source != last_source:
            return  # one exposure, published both as cloud and as image
        if stamp < last_stamp:
            self._statistics.count_clock_jump()
            self._warnings.warn(
                "clock_jump", f"stamps went back from {last_stamp / 1e9} s to {stamp / 1e9} s"
            )
        replaced = self._mailbox.put(Frame(header, read, time.monotonic(), info))
        self._statistics.receive(replaced)

    def _on_estimate(
        self, request: EstimateMorphing.Request, response: EstimateMorphing.Response
    ) -> EstimateMorphing.Response:
        read = partial(points_from_cloud, request.points)
        self._statistics.receive(replaced=False)
        answer = self._answer(Frame(request.points.header, read, time.monotonic()), False)
        response.parameters = answer.parameters()[0]
        return response

    def _work(self) -> None:
        """Estimate and publish frame after frame until the mailbox is closed."""
        while (frame := self._mailbox.take()) is not None:
            answer = self._answer(frame, self._active.settings.objects == "all")
            if self.context.ok():
                for parameters in answer.parameters():
                    self._parameters_publisher.publish(parameters)
                self._model_publisher.publish(answer.markers())

    def _answer(self, frame: Frame, all_objects: bool) -> FrameEstimates:
        """Estimate a frame; whatever is wrong with it becomes the reason of the answer."""
        settings, pipeline = self._active
        model = pipeline.estimator.model
        header = Header(stamp=frame.header.stamp, frame_id=settings.world_frame)
        try:
            points = frame.read(settings.max_range)
            in_world = frame.header.frame_id == settings.world_frame
            if not in_world:
                for mistake in self._sensor.look(points, frame.header.frame_id, frame.info):
                    self._warnings.warn(mistake.key, mistake.text)
            objects = pipeline.estimate_all(points, in_world, None if all_objects else 1)
        except MessageError as error:
            self._refuse(error.reason, str(error))
            return FrameEstimates(model, header, [_none(model, str(error))])
        except Exception as error:  # a node never dies of a message
            self._refuse("internal_error", traceback.format_exc())
            return FrameEstimates(model, header, [_none(model, repr(error))])
        for found in objects:
            status, reason = found.estimate.status, found.estimate.reason
            if status is not Status.OK:
                self._warnings.warn(status.name, f"{status.name}: {reason}")
        latency = time.monotonic() - frame.received
        results = [(found.estimate.status.name, found.estimate.reason) for found in objects]
        self._statistics.use(results, latency)
        numbers = self._number(objects) if all_objects else [0]
        return FrameEstimates(
            model,
            header,
            [
                DetectedObject(o.estimate, number, o.truncated)
                for o, number in zip(objects, numbers, strict=True)
            ],
        )

    def _number(self, objects: Sequence[ObjectEstimate]) -> list[int]:
        """Return the objects' numbers, which are those of the frames before."""
        self._tracker.max_distance = self._active.settings.object_distance
        seen = [found.observation.points for found in objects]
        numbers = iter(self._tracker.update([p.mean(axis=0) for p in seen if len(p)]))
        return [next(numbers) if len(p) else 0 for p in seen]

    def _refuse(self, reason: str, text: str) -> None:
        self._statistics.refuse(reason, text)
        self._warnings.warn(reason, f"message refused, {reason}: {text}")

    def _report(self) -> list[DiagnosticStatus]:
        name = self.get_fully_qualified_name()
        frames = self._statistics.report(f"{name}: frames", REPORT_PERIOD)
        return [frames, self._sensor.report(f"{name}: sensor")]

    def _on_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Take over changed parameters together, or refuse them with the reason."""
        before, pipeline = self._active
        try:
            settings = MorphNodeSettings.check(read_parameters(self, "morph_node", parameters))
            if (settings.model, settings.weights) != (before.model, before.weights):
                pipeline = _load(settings)
        except (OSError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        loaded = pipeline.estimator
        estimator = MorphEstimator(
            loaded.model, loaded.network, settings.estimator, loaded.refinement
        )
        self._active = Active(settings, MorphPipeline(estimator, settings.pipeline))
        return SetParametersResult(successful=True)


def _none(model: KinematicModel, reason: str) -> DetectedObject:
    """Return what a frame that cannot be read holds."""
    return DetectedObject(Estimate.none(model, 0, Status.NO_OBJECT, reason), 0, False)


def _load(settings: MorphNodeSettings) -> MorphPipeline:
    """Load model and weights, ready for the first frame."""
    torch.set_num_threads(1)  # more are slower for these small networks
    estimator = MorphEstimator.load(settings.model, settings.weights, settings.estimator)
    pipeline = MorphPipeline(estimator, settings.pipeline)
    pipeline.warm_up()
    return pipeline


def main() -> int:
    """Run the executable ``morph_node``; being stopped is its normal end."""
    return run_node("morph_node", __doc__, MorphNode)
