"""Labels of door frames: what is known of the door, in the camera's optical frame."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.model.camera import Camera

COLOUR_DISTORTION = ("D_plumb_bob_colour_only", "D")
SIDES = ("left", "right")  # as seen


class Known(NamedTuple):
    """A number, and its standard deviation."""

    value: float
    deviation: float


class Edge(NamedTuple):
    """A vertical edge of the panel.

    Attributes
    ----------
    top, bottom
        (3,) two points of it, metres.
    deviation
        Across it, metres.
    visible
        Whether some of it is in view.
    """

    top: NDArray[np.float64]
    bottom: NDArray[np.float64]
    deviation: float
    visible: bool


class DoorLabel(NamedTuple):
    """The reference of a door; ``None`` where the label does not know it.

    Attributes
    ----------
    normal, up, right
        (3,) unit axes of the panel as it stands: towards the camera, up, to the right as seen.
    centre
        (3,) a point of the panel's front, metres.
    yaw_deviation, distance_deviation
        Of the panel's plane: degrees, metres.
    edges
        Left and right.
    width, top
        Of the panel, and of its top above the floor, metres.
    handle, handle_deviation
        (3,) middle of the handle, and its deviations along the optical frame's axes, metres.
    handle_side
        ``left`` or ``right`` as seen; empty without a handle.
    opening
        Size of the opening angle, degrees.
    camera_pose
        (4, 4) optical frame in a world whose origin lies on the floor below the camera.
    panel
        (N, 2) polygon on the panel in pixels of the depth image; (0, 2) if there is none.
    """

    normal: NDArray[np.float64]
    up: NDArray[np.float64]
    right: NDArray[np.float64]
    centre: NDArray[np.float64]
    yaw_deviation: float
    distance_deviation: float
    edges: tuple[Edge | None, Edge | None]
    width: Known | None
    top: Known | None
    handle: NDArray[np.float64] | None
    handle_deviation: NDArray[np.float64]
    handle_side: str
    opening: Known | None
    camera_pose: NDArray[np.float64]
    panel: NDArray[np.float64]

    @property
    def edges_in_view(self) -> bool:
        """Whether both edges are in view, at least in part."""
        return all(edge is not None and edge.visible for edge in self.edges)


class FrameDescription(NamedTuple):
    """What the JSON file beside the images says.

    Attributes
    ----------
    camera
        Of the depth image, and of the undistorted colour image.
    distortion
        (4,) or (5,) of the colour image's lens, plumb_bob; empty without.
    registration
        (2,) columns and rows by which the undistorted colour image is to be moved, pixels, to lie
        on the calibrated depth.
    label
        None where no door is to be found.
    """

    camera: Camera
    distortion: NDArray[np.float64]
    registration: NDArray[np.float64]
    label: DoorLabel | None


def describe_camera(name_or_path: str | Path) -> FrameDescription:
    """Return the description of frames of a camera in ``config/cameras`` that have no label.

    Raises
    ------
    FileNotFoundError, ConfigurationError
        If its file is missing or wrong.
    """
    camera = Camera.load(name_or_path)
    section = Section.load(resources.find("config/cameras", name_or_path))
    key = "colour_distortion"
    distortion = np.array(section.numbers(key) if key in section else [])
    return FrameDescription(camera, distortion, np.zeros(2), None)


def read_description(file: Path) -> FrameDescription:
    """Read ``NAME.json``.

    Raises
    ------
    ConfigurationError
        If it is not JSON, or a key is missing or wrong; the text names file and key.
    OSError
        If it cannot be read.
    """
    return describe(Section.load_json(file))


def describe(section: Section) -> FrameDescription:
    """Return the description of a frame from what its file says; see `read_description`."""
    intrinsics = section.section("intrinsics")
    matrix = intrinsics.table("K", 3)
    if len(matrix) != 3:
        raise intrinsics.error(f"'K' must be 3 rows of 3 numbers, found {matrix!r}")
    camera = Camera(
        intrinsics.whole_number("width", 1, 16384),
        intrinsics.whole_number("height", 1, 16384),
        *(matrix[0][0], matrix[1][1], matrix[0][2], matrix[1][2]),
        pose=np.eye(4),
    )
    lens = next((key for key in COLOUR_DISTORTION if key in intrinsics), None)
    distortion = np.array(intrinsics.numbers(lens) if lens else [])
    shift = [0.0, 0.0]
    if "registration" in section:
        shift = section.section("registration").numbers("depth_px_minus_undistorted_colour_px", 2)
    no_door = "door" in section and section.values["door"] is None
    label = None if no_door else _label(section)
    return FrameDescription(camera, distortion, np.array(shift), label)


def _label(section: Section) -> DoorLabel:
    metric = section.section("reference").section("metric")
    plane, seen = metric.section("panel_plane"), section.section("annotations").section("edges")
    handle = metric.section("handle")
    has_handle = handle.values.get("centre") is not None
    middle = handle.section("centre")
    pose = metric.section("world").table("T_world_camera", 4)
    polygons = section.section("annotations").section("polygons")
    has_panel = polygons.values.get("panel") is not None
    panel = polygons.section("panel").table("depth_px", 2) if has_panel else []
    left, right = (_edge(metric.section("edges_3d"), seen, side) for side in SIDES)
    return DoorLabel(
        normal=np.array(plane.numbers("normal_towards_camera", 3)),
        up=np.array(metric.numbers("up", 3)),
        right=np.array(metric.numbers("right", 3)),
        centre=np.array(plane.numbers("centre", 3)),
        yaw_deviation=plane.number("sd_yaw_deg", 0.0),
        distance_deviation=plane.number("sd_offset_m", 0.0),
        edges=(left, right),
        width=_known(metric, "width"),
        top=_known(metric, "top_above_floor"),
        handle=np.array(middle.numbers("p", 3)) if has_handle else None,
        handle_deviation=np.array(middle.numbers("sd", 3) if has_handle else [0.0] * 3),
        handle_side=section.text("handle_side", SIDES) if has_handle else "",
        opening=_known(metric, "opening_angle_deg"),
        camera_pose=np.array(pose),
        panel=np.array(panel).reshape(-1, 2),
    )


def _edge(edges: Section, seen: Section, side: str) -> Edge | None:
    if edges.values.get(side) is None:
        return None
    edge = edges.section(side)
    top, bottom = (np.array(edge.numbers(end, 3)) for end in ("top", "bottom"))
    visible = bool(seen.values.get(side)) and bool(seen.section(side).values.get("visible"))
    return Edge(top, bottom, edge.number("sd_lateral_m", 0.0), visible)


def _known(section: Section, key: str) -> Known | None:
    if section.values.get(key) is None:
        return None
    known = section.section(key)
    return Known(known.number("value"), known.number("sd", 0.0))
