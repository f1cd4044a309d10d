"""Conversions between ROS messages and arrays: the one place where the two meet."""

from __future__ import annotations

import array
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point, Quaternion, Vector3
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.rendering import depth_to_points
from kmn_perception.model.rotation import quaternion_from_matrix

if TYPE_CHECKING:  # the estimator brings torch, which those who only read clouds do not need
    from kmn_perception.estimator import Estimate

COORDINATES = ("x", "y", "z")
COORDINATE_TYPES = {PointField.FLOAT32: "f4", PointField.FLOAT64: "f8"}
DEPTH_TYPES = {"32FC1": "f4", "16UC1": "u2"}  # REP-118: metres, NaN for none; mm, 0 for none
MM_PER_M = 1000.0
VALID_COLOUR = ColorRGBA(r=0.18, g=0.84, b=0.42, a=0.5)
INVALID_COLOUR = ColorRGBA(r=0.94, g=0.38, b=0.24, a=0.5)


class MessageError(ValueError):
    """A message that cannot be used; the text says what was found and what was expected.

    Attributes
    ----------
    reason
        Short key to count it by, e.g. ``truncated``.
    """

    def __init__(self, reason: str, text: str) -> None:
        super().__init__(text)
        self.reason = reason


def points_from_cloud(cloud: PointCloud2, max_range: float) -> NDArray[np.float32]:
    """Read the points of a cloud.

    Parameters
    ----------
    cloud
        Organised or not, with fields x, y, z of FLOAT32 or FLOAT64 in either byte order, metres.
    max_range
        Coordinates beyond it, in metres, and infinite ones (REP-117) count as not measured.

    Returns
    -------
    points
        (height, width, 3) or, of an unorganised cloud (height 1), (N, 3) points, metres, in the
        cloud's frame; NaN where nothing was measured.

    Raises
    ------
    MessageError
        If the cloud is empty or malformed, or holds no point that was measured.
    """
    fields = {field.name: field for field in cloud.fields}
    _check_layout(cloud, fields)
    points = np.empty((cloud.height, cloud.width, 3), dtype=np.float32)
    order = ">" if cloud.is_bigendian else "<"
    with np.errstate(over="ignore"):  # a FLOAT64 beyond FLOAT32 becomes infinite: not measured
        for axis, name in enumerate(COORDINATES):
            points[..., axis] = np.ndarray(
                (cloud.height, cloud.width),
                order + COORDINATE_TYPES[fields[name].datatype],
                cloud.data,
                fields[name].offset,
                (cloud.row_step, cloud.point_step),
            )
    reach = np.maximum(np.abs(points[..., 0]), np.abs(points[..., 1]))
    np.maximum(reach, np.abs(points[..., 2]), out=reach)
    missing = ~_measured(reach, max_range)
    for axis in range(3):  # several times faster than all three at once
        points[..., axis][missing] = np.nan
    return points if cloud.height > 1 else points[0]


def points_from_depth(image: Image, info: CameraInfo, max_range: float) -> NDArray[np.float32]:
    """Read the points of a depth image.

    Parameters
    ----------
    image
        Rectified depth along the optical axis (REP-118): ``32FC1`` in metres or ``16UC1`` in
        millimetres; NaN, infinity and 0 mean not measured.
    info
        The camera, of the image's size.
    max_range
        Depths beyond it, in metres, count as not measured.

    Returns
    -------
    points
        (height, width, 3) points in the optical frame, metres; NaN where nothing was measured.

    Raises
    ------
    MessageError
        If either message is malformed, they do not match, or no pixel was measured.
    """
    depth = depth_from_image(image, max_range)
    camera = camera_from_info(info)
    if (image.width, image.height) != (camera.width, camera.height):
        raise MessageError(
            "size_mismatch",
            f"the depth image has {image.width} x {image.height} pixels, "
            f"its camera_info {info.width} x {info.height}; expected the same size: "
            "the camera_info is of another resolution or of another camera",
        )
    return depth_to_points(depth, camera)


def depth_from_image(image: Image, max_range: float) -> NDArray[np.float32]:
    """Read a depth image, see `points_from_depth`: (height, width) metres, NaN for none."""
    if image.width * image.height == 0:
        raise MessageError("empty", "the depth image has no pixels")
    if image.encoding not in DEPTH_TYPES:
        raise MessageError(
            "encoding",
            f"the depth image has encoding '{image.encoding}', expected "
            "'32FC1' (metres) or '16UC1' (millimetres)",
        )
    dtype = np.dtype(DEPTH_TYPES[image.encoding]).newbyteorder(">" if image.is_bigendian else "<")
    _check_rows("depth image", "step", image.step, image.width * dtype.itemsize)
    _check_length("depth image", image.data, image.step, image.height)
    raw: NDArray[np.generic] = np.ndarray(
        (image.height, image.width), dtype, image.data, strides=(image.step, dtype.itemsize)
    )
    depth = raw.astype(np.float32)
    if dtype.kind == "u":
        depth /= np.float32(MM_PER_M)
    if np.count_nonzero(depth < 0.0) > depth.size / 2:
        raise MessageError(
            "flipped_z",
            "most of the depth image is negative: z is flipped; expected depth along the optical "
            "axis, forward",
        )
    depth[~(depth > 0.0)] = np.nan
    depth[~_measured(depth, max_range)] = np.nan
    return depth


def camera_from_info(info: CameraInfo) -> Camera:
    """Read the intrinsics of a rectified image; the pose is the identity.

    They are those of the projection matrix P, which describes the rectified image. Where a driver
    leaves P zero, the camera matrix K stands in for it. Distortion D is not applied.

    Raises
    ------
    MessageError
        If focal lengths are not positive or the principal point is not finite.
    """
    p, k = info.p, info.k
    fx, fy, cx, cy = (p[0], p[5], p[2], p[6]) if p[0] != 0.0 else (k[0], k[4], k[2], k[5])
    if not (0.0 < fx < np.inf and 0.0 < fy < np.inf and np.isfinite((cx, cy)).all()):
        raise MessageError(
            "focal_length",
            f"camera_info has fx = {fx:g}, fy = {fy:g}, cx = {cx:g}, cy = {cy:g}; "
            "expected positive focal lengths and a finite principal point, in pixels",
        )
    return Camera(info.width, info.height, fx, fy, cx, cy, np.eye(4))


def cloud_from_points(points: NDArray[np.float32], header: Header) -> PointCloud2:
    """Make a cloud of x, y, z FLOAT32 of points (height, width, 3) or (N, 3); NaN for none."""
    height, width = points.shape[:2] if points.ndim == 3 else (1, len(points))
    fields = [
        PointField(name=name, offset=4 * axis, datatype=PointField.FLOAT32, count=1)
        for axis, name in enumerate(COORDINATES)
    ]
    return PointCloud2(
        header=header,
        height=height,
        width=width,
        fields=fields,
        is_bigendian=False,
        point_step=12,
        row_step=12 * width,
        data=_bytes(points.astype("<f4", copy=False)),
        is_dense=False,
    )


def image_from_depth(depth: NDArray[np.float32], encoding: str, header: Header) -> Image:
    """Make a depth image (REP-118) of depth (height, width) in metres, NaN for none.

    Depth that ``16UC1`` cannot hold (beyond 65.535 m) becomes 0, none.
    """
    pixels = depth
    if encoding == "16UC1":
        with np.errstate(invalid="ignore"):
            pixels = np.rint(depth * np.float32(MM_PER_M))
            pixels = np.where((pixels > 0) & (pixels <= np.iinfo(np.uint16).max), pixels, 0)
    data = pixels.astype(f"<{DEPTH_TYPES[encoding]}", copy=False)
    height, width = depth.shape
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=width * data.itemsize,
        data=_bytes(data),
    )


def info_from_camera(camera: Camera, header: Header) -> CameraInfo:
    """Describe a camera without distortion."""
    fx, fy, cx, cy = float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy)
    return CameraInfo(
        header=header,
        height=camera.height,
        width=camera.width,
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def parameters_from_estimate(
    model: KinematicModel,
    estimate: Estimate,
    header: Header,
    number: int = 0,
    truncated: bool = False,
) -> MorphingParameters:
    """Make the message of an estimate; the header names the world frame.

    Parameters
    ----------
    number
        Of the object, 0 where there is but one.
    truncated
        Whether the image's border cuts the object.
    """
    return MorphingParameters(
        header=header,
        model=model.name,
        id=number,
        truncated=truncated,
        theta_names=[parameter.name for parameter in model.theta],
        theta=estimate.theta.tolist(),
        gamma_names=[parameter.name for parameter in model.gamma],
        gamma=estimate.gamma.tolist(),
        covariance=estimate.covariance.ravel().tolist(),
        transform=estimate.transform.ravel(),
        iterations=estimate.iterations,
        converged=bool(estimate.converged),
        residual=float(estimate.residual),
        points_used=estimate.points_used,
        status=int(estimate.status),
        reason=estimate.reason,
    )


def markers_from_estimates(
    model: KinematicModel, estimates: Sequence[Estimate], header: Header
) -> MarkerArray:
    """Draw the bodies of the estimated models as cubes, which replace the former ones.

    They are green where the estimate is valid, else red; without an object there are none.
    """
    markers = [Marker(header=header, ns=model.name, action=Marker.DELETEALL)]
    for estimate in estimates:
        if np.isfinite(estimate.theta).all() and np.isfinite(estimate.gamma).all():
            colour = INVALID_COLOUR if estimate.reason else VALID_COLOUR
            for cube in model.unit_cubes(estimate.theta, estimate.gamma):
                markers.append(cube_marker(model.name, len(markers) - 1, cube, colour, header))
    return MarkerArray(markers=markers)


def cube_marker(
    namespace: str, number: int, cube: NDArray[np.float64], colour: ColorRGBA, header: Header
) -> Marker:
    """Draw a unit cube's map (4, 4) as a cube."""
    marker = Marker(header=header, ns=namespace, id=number, type=Marker.CUBE, action=Marker.ADD)
    size = np.linalg.norm(cube[:3, :3], axis=0)
    x, y, z, w = quaternion_from_matrix(cube[:3, :3] / size).tolist()
    marker.pose.position = Point(**dict(zip("xyz", cube[:3, 3].tolist(), strict=True)))
    marker.pose.orientation = Quaternion(x=x, y=y, z=z, w=w)
    marker.scale = Vector3(**dict(zip("xyz", size.tolist(), strict=True)))
    marker.color = colour
    return marker


def _bytes(values: NDArray[np.generic]) -> array.array[int]:
    """Pack an array as rclpy takes it without a check of every single byte."""
    packed = array.array("B")
    packed.frombytes(np.ascontiguousarray(values).data.cast("B"))
    return packed


def _check_layout(cloud: PointCloud2, fields: dict[str, PointField]) -> None:
    """Raise if x, y and z cannot be read from the cloud's data."""
    if cloud.width * cloud.height == 0:
        raise MessageError("empty", "the cloud is empty: it has no points")
    if missing := [name for name in COORDINATES if name not in fields]:
        raise MessageError(
            "missing_fields",
            f"the cloud lacks the fields {', '.join(missing)}; it has "
            f"{', '.join(fields) or 'none'}, expected x, y, z",
        )
    for name in COORDINATES:
        field = fields[name]
        if field.datatype not in COORDINATE_TYPES:
            raise MessageError(
                "datatype",
                f"the cloud's field {name} has datatype {field.datatype}, expected "
                f"{PointField.FLOAT32} (FLOAT32) or {PointField.FLOAT64} (FLOAT64)",
            )
        end = field.offset + np.dtype(COORDINATE_TYPES[field.datatype]).itemsize
        if end > cloud.point_step:
            raise MessageError(
                "point_step",
                f"the cloud's field {name} ends at byte {end} of a point, "
                f"but point_step is {cloud.point_step}",
            )
    _check_rows("cloud", "row_step", cloud.row_step, cloud.width * cloud.point_step)
    _check_length("cloud", cloud.data, cloud.row_step, cloud.height)


def _check_rows(what: str, name: str, step: int, row_length: int) -> None:
    if step < row_length:
        raise MessageError(
            "row_step", f"the {what}'s {name} is {step}, expected {row_length} bytes or more"
        )


def _check_length(what: str, data: array.array[int], step: int, height: int) -> None:
    if len(data) != step * height:
        reason = "truncated" if len(data) < step * height else "excess_data"
        raise MessageError(
            reason,
            f"the {what} has {len(data)} bytes of data, expected {step * height}: "
            f"{height} rows of {step} bytes",
        )


def _measured(reach: NDArray[np.float32], max_range: float) -> NDArray[np.bool_]:
    """Tell which points were measured, by their largest coordinate; raise if none was."""
    measured = reach <= max_range
    if not measured.any():
        if np.isfinite(reach).any():
            raise MessageError(
                "huge_values",
                f"no point lies within {max_range:g} m, the nearest at {np.nanmin(reach):g} m; "
                "expected metres; if these are millimetres, divide by 1000",
            )
        raise MessageError("no_finite_points", f"none of the {reach.size} points was measured")
    return measured
