"""The node that estimates morphing parameters from clouds or depth images."""

from __future__ import annotations

import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticStatus
from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from std_msgs.msg import Header
from visualization_msgs.msg import MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing
from kmn_perception.doors.door_tracker import DoorTracker
from kmn_perception.estimate import Estimate, Status
from kmn_perception.pipeline_interface import ObjectEstimate, Pipeline
from kmn_perception.ros.camera_poses import CameraPoses
from kmn_perception.ros.camera_subscriptions import CameraSubscriptions
from kmn_perception.ros.frame_estimates import DetectedObject, FrameEstimates
from kmn_perception.ros.frame_receiver import Frame, FrameReceiver, read_cloud
from kmn_perception.ros.frame_statistics import FrameStatistics
from kmn_perception.ros.image_receiver import ImageReceiver
from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.node_program import run_node
from kmn_perception.ros.object_publisher import ObjectPublisher
from kmn_perception.ros.overridable_node import OverridableNode
from kmn_perception.ros.parameters import declare_parameters, read_parameters
from kmn_perception.ros.pipeline_loading import load_pipeline
from kmn_perception.ros.reports import (
    REPORT_PERIOD,
    ChangeWarnings,
    ThrottledWarnings,
    report_periodically,
)
from kmn_perception.ros.sensor_watch import SensorWatch
from kmn_perception.scene.sensor_diagnosis import DiagnosisSettings
from kmn_perception.scene.tracking import ObjectTracker

QUEUE_DEPTH = 10  # of the publishers
POSE = {"camera_position", "camera_quaternion"}  # parameters that change as the camera moves


class Active(NamedTuple):
    """What the node works with at present; replaced as a whole when parameters change."""

    settings: MorphNodeSettings
    pipeline: Pipeline
    past: DoorTracker

    @classmethod
    def begin(cls, settings: MorphNodeSettings, pipeline: Pipeline) -> Active:
        """Begin with no frame in the past."""
        return cls(settings, pipeline, DoorTracker(settings.fused_frames))


class MorphNode(OverridableNode):
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
        self._active = Active.begin(settings, load_pipeline(settings))
        self._statistics = FrameStatistics()
        scene = settings.pipeline.scene
        self._sensor = SensorWatch(REPORT_PERIOD, DiagnosisSettings.load(), scene.intrinsics)
        self._tracker = ObjectTracker(settings.object_distance, scene.memory)
        self._warnings, self._failures = ThrottledWarnings(self), ChangeWarnings(self)
        self._connect()
        subscriptions = CameraSubscriptions(self, ReliabilityPolicy[settings.reliability.upper()])
        self._frames = FrameReceiver(
            self,
            subscriptions,
            lambda: self._active.settings,
            self._statistics,
            self._warnings,
        )
        self._images = ImageReceiver(self, subscriptions, settings.image_transport, self._warnings)
        self._cameras = CameraPoses(self, self._warnings)
        self._listen()
        self.add_on_set_parameters_callback(self._on_parameters)
        # A daemon, so that an interrupt in this very moment does not leave the process waiting.
        self._worker = threading.Thread(target=self._work, name="estimation", daemon=True)
        self._worker.start()
        self.get_logger().info(f"estimating morphing parameters of model '{settings.model}'")

    def destroy_node(self) -> None:
        """End the estimation thread and the node."""
        self._frames.close()
        self._cameras.close()
        self._worker.join()
        super().destroy_node()

    def _connect(self) -> None:
        self._parameters_publisher = self.create_publisher(
            MorphingParameters, "morphing_parameters", QUEUE_DEPTH
        )
        self._model_publisher = self.create_publisher(MarkerArray, "morphed_model", QUEUE_DEPTH)
        self._objects = ObjectPublisher(self)
        self.create_service(EstimateMorphing, "estimate_morphing", self._on_estimate)
        report_periodically(self, self._report)

    def _listen(self) -> None:
        """Subscribe to images and transforms only where they are used."""
        settings, pipeline, _ = self._active
        self._images.listen(settings.use_image and pipeline.uses_image)
        self._cameras.configure(settings)

    def _on_estimate(
        self, request: EstimateMorphing.Request, response: EstimateMorphing.Response
    ) -> EstimateMorphing.Response:
        read = partial(read_cloud, request.points)
        self._statistics.receive(replaced=False)
        frame = Frame(request.points.header, read, time.monotonic())
        answer = self._answer(frame, all_objects=False, is_single=True)
        response.parameters = answer.parameters()[0]
        return response

    def _work(self) -> None:
        """Estimate and publish frame after frame until the mailbox is closed."""
        while (frame := self._frames.take()) is not None:
            answer = self._answer(frame, self._active.settings.objects == "all")
            if self.context.ok():
                for parameters in answer.parameters():
                    self._parameters_publisher.publish(parameters)
                self._model_publisher.publish(answer.markers())
                max_change = self._active.settings.description_change
                self._objects.publish(answer.holding(), answer.header, max_change)

    def _answer(self, frame: Frame, all_objects: bool, is_single: bool = False) -> FrameEstimates:
        """Estimate a frame; whatever is wrong with it becomes the reason of the answer.

        A single one waits for neither image nor transforms, and has no past.
        """
        settings, pipeline, past = self._active
        header = Header(stamp=frame.header.stamp, frame_id=settings.frame)

        def left_of(delay: float) -> float:
            return 0.0 if is_single else delay - (time.monotonic() - frame.received)

        try:
            view = frame.read(settings)
            if view.in_world:
                header.frame_id = settings.world_frame
            if not view.in_world:
                for mistake in self._sensor.look(view, self._frames.camera_info):
                    self._warnings.warn(mistake.key, mistake.text)
            view = self._cameras.add_to(view, settings, left_of(settings.transform_delay))
            view, lack = self._images.add_to(view, settings, left_of(settings.image_delay))
            number = None if all_objects else 1
            objects = pipeline.estimate_all(view, number, None if is_single else past)
            objects = [_with_lack(found, lack) for found in objects]
            self._sensor.keep_error(objects[0].estimate.sensor_error)
            seen = objects[0].observation
            if len(seen.points):
                self._cameras.tell(view, seen.camera.pose, header)
        except MessageError as error:
            self._refuse(error.reason, str(error))
            return FrameEstimates(pipeline, header, [_none(pipeline, str(error))])
        except Exception as error:  # a node never dies of a message
            self._refuse("internal_error", traceback.format_exc())
            return FrameEstimates(pipeline, header, [_none(pipeline, repr(error))])
        self._warn_of({found.estimate.status: found.estimate.reason for found in objects})
        latency = time.monotonic() - frame.received
        results = [(found.estimate.status.name, found.estimate.reason) for found in objects]
        self._statistics.use(results, latency, sum(found.left_out for found in objects))
        numbers = self._number(objects) if all_objects else [0]
        return FrameEstimates(
            pipeline,
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

    def _warn_of(self, reasons: Mapping[Status, str]) -> None:
        """Log each status of a frame's objects that is not OK, unless the last frame had it."""
        for status in Status:
            if status not in reasons:
                self._failures.clear(status.name)
            elif status is not Status.OK:
                self._failures.warn(status.name, "", f"{status.name}: {reasons[status]}")

    def _refuse(self, reason: str, text: str) -> None:
        self._statistics.refuse(reason, text)
        self._warnings.warn(reason, f"message refused, {reason}: {text}")

    def _report(self) -> list[DiagnosticStatus]:
        self._frames.refuse_early_image(REPORT_PERIOD)
        name = self.get_fully_qualified_name()
        frames = self._statistics.report(f"{name}: frames", REPORT_PERIOD)
        images = self._images.report(f"{name}: image")
        sensor = self._sensor.report(f"{name}: sensor")
        return [frames, sensor, images, self._cameras.report(f"{name}: transforms")]

    def _on_parameters(self, parameters: Sequence[Parameter]) -> SetParametersResult:
        """Take over changed parameters together, or refuse them with the reason."""
        before, pipeline, past = self._active
        try:
            settings = MorphNodeSettings.check(read_parameters(self, "morph_node", parameters))
            if (settings.model, settings.weights) != (before.model, before.weights):
                pipeline = load_pipeline(settings)
        except (OSError, ValueError) as error:
            return SetParametersResult(successful=False, reason=str(error))
        pipeline = pipeline.configured(settings.pipeline, settings.estimator)
        self._active = Active.begin(settings, pipeline)
        if {parameter.name for parameter in parameters} <= POSE:
            self._active = Active(settings, pipeline, past)
        self._listen()
        return SetParametersResult(successful=True)


def _none(pipeline: Pipeline, reason: str) -> DetectedObject:
    """Return what a frame that cannot be read holds."""
    return DetectedObject(Estimate.none(pipeline.model, 0, Status.NO_OBJECT, reason), 0, False)


def _with_lack(found: ObjectEstimate, lack: str) -> ObjectEstimate:
    """Add what was lacking to the reason of an estimate that is not OK."""
    estimate = found.estimate
    if not lack or estimate.status is Status.OK:
        return found
    return found._replace(estimate=replace(estimate, reason=f"{estimate.reason}; {lack}"))


def main() -> int:
    """Run the executable ``morph_node``; being stopped is its normal end."""
    return run_node("morph_node", __doc__, MorphNode)
