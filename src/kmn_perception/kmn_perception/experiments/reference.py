"""Reference poses and sizes of labelled cartons by plane fits; for evaluation only."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.evaluation.visible_fraction import visible_fraction
from kmn_perception.experiments.contour import Contour, Edge, Plane, find_contour, find_edge
from kmn_perception.experiments.faces import TOP, Faces, axial_noise, box_axes, fit_faces
from kmn_perception.experiments.labelled_frame import TABLE, LabelledFrame
from kmn_perception.experiments.settings import ContourSettings, ExperimentSettings, FaceSettings
from kmn_perception.experiments.upright_box import QUARTER, UprightBox
from kmn_perception.model.camera import Camera
from kmn_perception.model.rendering import depth_to_points, render
from kmn_perception.scene.support_plane import SupportPlane, pose_above

TABLE_STEPS = 5
QUARTER_TURN = [2, 3, 1, 0, TOP]  # the sides -x, +x, -y, +y, top after a quarter turn of the axes


@dataclass(frozen=True, eq=False)
class Reference:
    """A labelled carton as measured.

    Attributes
    ----------
    label
        In the frame.
    box
        In the world of `References.camera`; it stands on z = 0. A side that is not in view lies
        where the labelled points end.
    yaw_deviation
        Standard deviation, radians.
    side_deviations
        (5,) standard deviations of the sides -x, +x, -y, +y, top (of the box's own axes), metres;
        infinite for sides that are not in view.
    visible
        Share of its silhouette that is labelled; of a box with sides that are not in view, the
        silhouette of the part that is known.
    """

    label: int
    box: UprightBox
    yaw_deviation: float
    side_deviations: NDArray[np.float64]
    visible: float

    @property
    def in_view(self) -> NDArray[np.bool_]:
        """(5,) the sides whose place is seen."""
        return np.isfinite(self.side_deviations)

    @property
    def sizes_in_view(self) -> NDArray[np.bool_]:
        """(3,) the sizes whose sides are both seen; the bottom stands on the table."""
        seen = self.in_view
        return np.array([seen[0] & seen[1], seen[2] & seen[3], seen[TOP]])

    def as_near(self, box: UprightBox) -> Reference:
        """Return the same, described with its axes as near as they can be to another box's."""
        same, sides = self.box.as_near(box), self.side_deviations
        for _ in range(round((same.yaw - self.box.yaw) / QUARTER) % 4):
            sides = sides[QUARTER_TURN]
        return replace(self, box=same, side_deviations=sides)

    def seen_from(self, pose: NDArray[np.float64], other: NDArray[np.float64]) -> Reference:
        """Return the same in another world, given the camera's pose (4, 4) in this one and that.

        Both stand on the same support, so that they differ by next to nothing but a turn about z
        and a shift.
        """
        change = other @ np.linalg.inv(pose)
        centre = change[:3, :3] @ self.box.centre + change[:3, 3]
        yaw = self.box.yaw + float(np.arctan2(change[1, 0], change[0, 0]))
        return replace(self, box=replace(self.box, centre=centre, yaw=yaw))

    def parameters(self, unseen: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return centre x, y, yaw and sizes x, y, z (6,) with their covariance (6, 6).

        Parameters
        ----------
        unseen
            Standard deviation of a side that is not in view, metres.
        """
        box = self.box
        mean = np.array([*box.centre[:2], box.yaw, *box.size])
        deviations = np.where(self.in_view, self.side_deviations, unseen)
        axes = box_axes(box.yaw)[:2, :2]
        slope = np.zeros((6, 6))  # by yaw and the five sides
        slope[2, 0] = 1.0
        for axis in range(2):
            below, above = 1 + 2 * axis, 2 + 2 * axis
            slope[:2, below] = slope[:2, above] = axes[axis] / 2.0
            slope[3 + axis, below], slope[3 + axis, above] = -1.0, 1.0
        slope[5, 1 + TOP] = 1.0
        scaled = slope * [self.yaw_deviation, *deviations]
        return mean, scaled @ scaled.T


class References(NamedTuple):
    """All cartons of a frame, and the camera with its pose above the table."""

    camera: Camera
    boxes: list[Reference]


def measure(
    frame: LabelledFrame, settings: ExperimentSettings, heading: NDArray[np.float64]
) -> References:
    """Measure every labelled carton of a frame that shows an upright face.

    The table is z = 0 and gives gravity. The faces in view give yaw and planes, at right angles.
    Where the face beyond is not in view, a side is where the faces beside it end in the image.

    Parameters
    ----------
    heading
        (4, 4) pose whose ground position and heading the camera is given, which no frame shows.
    """
    measured = np.isfinite(frame.depth)
    points = depth_to_points(frame.depth, frame.camera(settings)).astype(np.float64)
    table = _fit_table(points[(frame.labels == TABLE) & measured], settings.faces)
    camera = replace(frame.camera(settings), pose=pose_above(table, heading))
    world = points @ camera.pose[:3, :3].T + camera.position
    boxes = []
    for label in frame.objects:
        mask = (frame.labels == label) & measured
        faces = fit_faces(world, frame.depth.astype(np.float64), mask, settings.faces)
        if faces is not None:
            contour = find_contour(mask, frame.depth, camera, settings.contour)
            box = _reference(label, world[mask], mask, faces, contour, camera, settings)
            boxes += [] if box is None else [box]
    return References(camera, boxes)


def _fit_table(points: NDArray[np.float64], settings: FaceSettings) -> SupportPlane:
    """Fit a plane to points (N, 3) in the optical frame, each by its own noise."""
    exact = 1.0 / axial_noise(points[:, 2])
    weight = exact.copy()
    for _ in range(TABLE_STEPS):
        centre = np.average(points, axis=0, weights=weight**2)
        offsets = (points - centre) * weight[:, None]
        normal = np.linalg.eigh(offsets.T @ offsets)[1][:, 0]
        residual = (points - centre) @ normal * exact
        weight = exact * (np.abs(residual) < settings.outlier)
    if normal @ centre > 0.0:
        normal = -normal
    return SupportPlane(normal, float(-normal @ centre))


def _reference(
    label: int,
    points: NDArray[np.float64],
    mask: NDArray[np.bool_],
    faces: Faces,
    contour: Contour,
    camera: Camera,
    settings: ExperimentSettings,
) -> Reference | None:
    """Return what the faces and the contour tell of an object; None if that is no box."""
    offsets, deviations = _sides(faces, contour, camera, settings.contour)
    axes = faces.axes
    ends = (points - [*faces.origin, 0.0]) @ axes.T
    for side in np.flatnonzero(np.isnan(offsets)):
        extreme = np.max if side % 2 or side == TOP else np.min
        offsets[side], deviations[side] = extreme(ends[:, side // 2]), np.inf
    low, high = np.array([offsets[0], offsets[2], 0.0]), np.array([*offsets[[1, 3]], offsets[TOP]])
    centre = (low + high) / 2.0 @ axes + [*faces.origin, 0.0]
    if (high <= low).any():
        return None
    box = UprightBox(centre, high - low, faces.yaw)
    silhouette = np.isfinite(render(box.unit_cube[None], camera))
    share = float((mask & silhouette).sum() / max(silhouette.sum(), 1))
    visible = share * visible_fraction(box.unit_cube[None], camera)
    return Reference(label, box, faces.yaw_deviation, deviations, visible)


def _sides(
    faces: Faces, contour: Contour, camera: Camera, settings: ContourSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return place and standard deviation of the sides (5,); NaN for those that are not seen.

    A side is where its face is, and where the faces beside it end. One that faces the camera also
    ends at the sides behind, whose places are known by then: this helps most with sides that are
    too narrow for a face, or that the sensor has mostly rounded off.
    """
    offsets, deviations = np.full(5, np.nan), np.full(5, np.nan)
    measured: list[list[Edge]] = [
        [Edge(*face)] if np.isfinite(face[0]) else []
        for face in zip(faces.offsets, faces.deviations, strict=True)
    ]
    for side in range(5):
        measured[side] += _ends(side, faces.offsets, faces, contour, camera, settings)
        if measured[side]:
            offsets[side], deviations[side] = _combine(measured[side])
    behind = np.where(np.isnan(faces.offsets), offsets, np.nan)
    for side in range(TOP):
        seen = _ends(side, behind, faces, contour, camera, settings)
        if seen and _faces_camera(side, seen[0].coordinate, faces, camera):
            offsets[side], deviations[side] = _combine([*measured[side], *seen])
    return offsets, deviations


def _faces_camera(side: int, offset: float, faces: Faces, camera: Camera) -> bool:
    eye = camera.position[:2] - faces.origin
    sign = 1.0 if side % 2 else -1.0
    return bool(sign * (faces.axes[side // 2, :2] @ eye - offset) > 0.0)


def _ends(
    side: int,
    planes: NDArray[np.float64],
    faces: Faces,
    contour: Contour,
    camera: Camera,
    settings: ContourSettings,
) -> list[Edge]:
    """Return where the planes beside a side end, as its coordinates along its axis of the box."""
    axis, sign = faces.axes[side // 2], 1.0 if side % 2 or side == TOP else -1.0
    start = axis[:2] @ faces.origin
    found = []
    for other in np.flatnonzero(np.isfinite(planes)):
        if other // 2 != side // 2:
            normal = faces.axes[other // 2]
            plane = Plane(normal, float(planes[other] + normal[:2] @ faces.origin))
            edge = find_edge(contour, camera, plane, sign * axis, settings)
            if edge is not None:
                found.append(Edge(sign * edge.coordinate - start, edge.deviation))
    return found


def _combine(measured: list[Edge]) -> Edge:
    """Return the mean of all that shows a side; where they disagree, its deviation is as large."""
    coordinates, deviations = np.array(measured).T
    weights = deviations**-2.0
    mean = np.average(coordinates, weights=weights)
    scatter = np.average((coordinates - mean) ** 2, weights=weights)
    return Edge(float(mean), float(np.sqrt(1.0 / weights.sum() + scatter)))
