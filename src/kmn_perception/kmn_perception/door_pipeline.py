"""From what a camera measured to the door in its wall that it sees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.door_tracker import DoorTracker
from kmn_perception.doors.geometry import DOOR
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame
from kmn_perception.estimate import Estimate, Quantity, Status
from kmn_perception.estimator import EstimatorSettings
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.observation import Observation
from kmn_perception.model.rendering import render_bodies
from kmn_perception.model.room_model import HINGE, OPENING, RoomModel
from kmn_perception.model.surface_distance import surface_distances
from kmn_perception.model.transformation import transform_points
from kmn_perception.pipeline_interface import CalibrationState, ObjectEstimate, PipelineSettings
from kmn_perception.scene.camera_pose import CameraPose, find_camera_pose
from kmn_perception.scene.depth_view import DepthView

STATUSES = {
    DoorStatus.OK: Status.OK,
    DoorStatus.HANDLE_NOT_SEEN: Status.HANDLE_NOT_SEEN,
    DoorStatus.AMBIGUOUS: Status.AMBIGUOUS,
    DoorStatus.NO_DOOR: Status.NO_OBJECT,
}
SURROUNDINGS = ("recess",)  # of the finder's parameters
SIGNIFICANT = 3.0  # deviations
ENOUGH = 5000  # points for the median of their distances
REFERENCE = 2.0  # metres, at which the error of a sensor is told


class DoorPipeline:
    """Finds the door, and puts it into the world.

    Attributes
    ----------
    room, finder, settings
        May be replaced between two estimates; of the settings the camera's pose counts.
    """

    def __init__(self, room: RoomModel, finder: DoorFinder, settings: PipelineSettings) -> None:
        self.room, self.finder, self.settings = room, finder, settings

    @classmethod
    def load(
        cls, model: str | Path, weights_file: str | Path, settings: PipelineSettings
    ) -> DoorPipeline:
        """Load a model with surroundings, and its network, see `DoorFinder.load`.

        Raises
        ------
        FileNotFoundError, ConfigurationError
            If a file is missing or wrong.
        ValueError
            If the model has other parameters than those that are found.
        WeightsError
            If the weights are missing, corrupt, or of another network.
        """
        room = RoomModel.load(model)
        names = tuple(parameter.name for parameter in room.model.parameters)
        if names != DOOR[: len(names)] or OPENING not in DOOR[len(names) :]:
            raise ValueError(
                f"model '{model}' has the parameters {', '.join(names)}, expected "
                f"{', '.join(DOOR[:7])}, as a door in a wall is found by"
            )
        return cls(room, _calibrated(DoorFinder.load(weights_file), settings), settings)

    @property
    def model(self) -> KinematicModel:
        """The door."""
        return self.room.model

    @property
    def uses_image(self) -> bool:
        """Grey values show edges and handle."""
        return True

    def configured(self, settings: PipelineSettings, estimator: EstimatorSettings) -> DoorPipeline:
        """Return the pipeline with other settings, which shares model and finder."""
        return DoorPipeline(self.room, _calibrated(self.finder, settings), settings)

    def warm_up(self) -> None:
        """Compile and load all that the first estimate needs, so that it is not slow."""
        camera = self.model.camera
        recessed = self.room.nuisances(recess=0.1)
        _, cubes = self.room.cubes(self.model.prototype, recessed)
        depth, bodies = render_bodies(cubes, camera)
        view = DepthView.of_depth(depth, camera)
        grey = np.float32(0.4) + np.float32(0.2) * (bodies % 4).astype(np.float32)  # all edges show
        self.estimate_all(view)
        self.estimate_all(replace(view, intensity=grey))

    def estimate_all(
        self, view: DepthView, max_objects: int | None = None, past: DoorTracker | None = None
    ) -> list[ObjectEstimate]:
        """Estimate the door that the frame shows best; where there is none, tell why."""
        pose = self._known_pose(view)
        view = view.placed(np.eye(4) if pose is None else pose, self.settings.scene.intrinsics)
        camera = view.camera
        if camera is None:
            return [
                self._none(
                    view,
                    "found points without the rows and columns of a pinhole camera; "
                    "expected a depth image or an organised cloud",
                )
            ]
        depth = np.where(view.valid, view.depth(), np.float32(0.0))
        frame = Frame(depth, view.intensity, camera)
        if pose is not None:
            low, high = self.finder.settings.floor.heights
            if not low <= pose[2, 3] <= high:
                return [
                    self._none(
                        view,
                        f"the given pose of the camera is {pose[2, 3]:.2f} m above "
                        f"the floor z = 0, expected {low:g} to {high:g} m",
                    )
                ]
            frame = frame._replace(up=pose[2, :3].copy(), height=float(pose[2, 3]))
        if past is None:
            found = self.finder.find(frame)
        else:
            found = past.find(self.finder, frame, pose, view.stamp)
        if found.status is DoorStatus.NO_DOOR:
            return [self._none(view, found.reason, _sensor_error(found, self.finder.settings))]
        found = found if pose is None else found.in_world(pose)
        camera = replace(camera, pose=found.camera_pose)
        return [self._placed(found, replace(view, camera=camera), camera)]

    def bodies(self, estimate: Estimate) -> NDArray[np.float64]:
        """Return panel and, where it was seen, handle as maps (B, 4, 4) of the unit cube."""
        if not np.isfinite([*estimate.theta, *estimate.gamma]).all():
            return np.empty((0, 4, 4))
        values = np.concatenate([estimate.theta, estimate.gamma])
        opening = estimate.positions.get(HINGE, 0.0)
        side = "left" if estimate.mirrored else "right"
        return self.room.door_bodies(values, opening, estimate.alternative, side)

    def _known_pose(self, view: DepthView) -> NDArray[np.float64] | None:
        """Return the pose (4, 4) of the camera if it is known without the floor in view."""
        source = self.settings.camera_pose
        if source is CameraPose.SUPPORT_PLANE and view.pose is None and not view.in_world:
            return None
        given, canonical = self.settings.given_pose, self.model.camera.pose
        return find_camera_pose(view, source, given, canonical, self.settings.plane)

    def _none(self, view: DepthView, reason: str, sensor_error: str = "") -> ObjectEstimate:
        """Return what a frame without a door holds."""
        none = Estimate.none(self.model, 0, Status.NO_OBJECT, reason)
        empty = Observation(np.empty((0, 3), np.float32), self.model.camera)
        estimate = replace(none, sensor_error=sensor_error)
        return ObjectEstimate(estimate, empty, np.zeros_like(view.valid), False)

    def _verdict(self, found: DoorEstimate, is_open: bool) -> tuple[Status, str]:
        """Return what a door is worth as one of the model, and why it is not OK."""
        kind, known = found.handle_kind, self.room.handles
        if found.status is DoorStatus.OK and kind not in known:
            return Status.HANDLE_NOT_SEEN, (
                f"the handle is a {kind}, of which model '{self.model.name}' knows nothing "
                f"(known: {', '.join(known)})"
            )
        if found.status is DoorStatus.HANDLE_NOT_SEEN and is_open and not found.hinge_is_known:
            return Status.AMBIGUOUS, (
                f"the door is open by {np.degrees(abs(found.value(OPENING))):.0f} deg, and without "
                "a handle in sight it is not known which side is hinged"
            )
        return STATUSES[found.status], found.reason

    def _placed(self, found: DoorEstimate, view: DepthView, camera: Camera) -> ObjectEstimate:
        """Return a door that was found, in the world of its camera's pose."""
        values, covariance = found.values[:7], found.covariance[:7, :7]
        theta, gamma = self.model.split(values)
        side = found.latch_side
        opening = found.value(OPENING)
        deviation = max(found.deviation(OPENING), self.finder.settings.fit.closed)
        is_open = abs(opening) > SIGNIFICANT * deviation
        status, reason = self._verdict(found, is_open)
        kind = found.handle_kind if found.handle_kind in self.room.handles else ""
        mask, truncated = _panel_pixels(found, view, camera)
        points = view.points[mask]
        if not view.in_world:
            points = transform_points(camera.pose, points)
        estimate = Estimate(
            model=self.model,
            theta=theta,
            gamma=gamma,
            covariance=covariance,
            transform=self.room.pose(values, side),
            iterations=0,
            converged=status in (Status.OK, Status.HANDLE_NOT_SEEN),
            residual=np.nan,
            points_used=len(points),
            status=status,
            reason=reason,
            alternative=kind,
            mirrored=side == "left",
            joints=(Quantity(HINGE, opening, deviation),),
            surroundings=tuple(
                Quantity(name, found.value(name), found.deviation(name)) for name in SURROUNDINGS
            ),
            sensor_error=_sensor_error(found, self.finder.settings),
        )
        if len(points):
            some = points[:: max(1, len(points) // ENOUGH)]
            distances = surface_distances(self.bodies(estimate), some)
            estimate = replace(estimate, residual=float(np.median(distances)))
        return ObjectEstimate(estimate, Observation(points, camera), mask, truncated)


def _calibrated(finder: DoorFinder, settings: PipelineSettings) -> DoorFinder:
    """Return the finder for a sensor as well calibrated as the settings say."""
    shipped = DoorSettings.load()
    delivered = settings.calibration is CalibrationState.DELIVERED
    return finder.with_calibration(shipped.delivered if delivered else shipped.calibration)


def _panel_pixels(
    found: DoorEstimate, view: DepthView, camera: Camera
) -> tuple[NDArray[np.bool_], bool]:
    """Return the measured pixels (height, width) of the panel, and whether it leaves the image."""
    corners = found.corners[[0, 1, 3, 2]]  # around it
    z = np.maximum(corners[:, 2:], camera.near)
    pixels = (corners / z @ camera.matrix.T)[:, :2]
    size = np.array([camera.width, camera.height])
    truncated = bool(((pixels < -0.5) | (pixels > size - 0.5)).any())
    outline = np.clip(np.rint(pixels), -2.0 * size, 3.0 * size).astype(np.int32)
    image = np.zeros((camera.height, camera.width), np.uint8)
    cv2.fillConvexPoly(image, outline, 1)
    return (image > 0) & view.valid, truncated


def _sensor_error(found: DoorEstimate, settings: DoorSettings) -> str:
    """Return what the frame tells about the sensor's error, or nothing if it is not significant."""
    offset, deviation = found.disparity_offset
    if not abs(offset) > max(SIGNIFICANT * deviation, settings.calibration.offset):
        return ""
    error = 1.0 / (1.0 + REFERENCE * offset) - 1.0
    return (
        f"depth is too {'large' if error > 0.0 else 'small'} by about {100.0 * abs(error):.0f} % "
        f"at {REFERENCE:g} m: inverse depths are off by {offset:+.4f} 1/m"
    )
