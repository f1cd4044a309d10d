"""Frames of a depth camera: clouds and depth images become a `DepthView`, or say what is wrong."""

from __future__ import annotations

import array

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header

from kmn_perception.model.camera import Camera
from kmn_perception.model.distortion import Distortion, rectify
from kmn_perception.ros.messages.errors import MessageError
from kmn_perception.ros.messages.formats import (
    COORDINATE_TYPES,
    COORDINATES,
    DEPTH_TYPES,
    MM_PER_M,
)
from kmn_perception.scene.depth_view import DepthView


def view_from_cloud(cloud: PointCloud2, max_range: float, world_frame: str) -> DepthView:
    """Read a cloud, see `points_from_cloud`; one in the world frame needs no camera pose."""
    points = points_from_cloud(cloud, max_range)
    in_world = cloud.header.frame_id == world_frame
    return DepthView(points, None, in_world, cloud.header.frame_id, _nanoseconds(cloud.header))


def view_from_image(
    image: Image, info: CameraInfo, max_range: float, rectify_depth: bool = True
) -> DepthView:
    """Read a depth image.

    Parameters
    ----------
    image
        Depth along the optical axis (REP-118): ``32FC1`` in metres or ``16UC1`` in millimetres;
        NaN, infinity and 0 mean not measured.
    info
        The camera; see `camera_from_info`.
    max_range
        Depths beyond it, in metres, count as not measured.
    rectify_depth
        Rectify the image where ``info`` describes a distortion; else it is rectified already.

    Returns
    -------
    view
        Points in the optical frame with the camera whose pixels they are.

    Raises
    ------
    MessageError
        If either message is malformed, they do not match, or no pixel was measured.
    """
    depth = depth_from_image(image, max_range)
    camera = camera_from_info(info)
    if (image.width, image.height) != (camera.width, camera.height):
        described = f"its camera_info {camera.width} x {camera.height}"
        if (camera.width, camera.height) != (info.width, info.height):
            described += f" (of {info.width} x {info.height}, after region of interest and binning)"
        raise MessageError(
            "size_mismatch",
            f"the depth image has {image.width} x {image.height} pixels, {described}; expected the "
            "same size: the camera_info is of another resolution or of another camera",
        )
    if rectify_depth and is_distorted(info):
        depth = rectify(depth, distortion_from_info(info), camera)
        if not np.isfinite(depth).any():
            raise MessageError("no_finite_points", "no pixel is left of the rectified depth image")
    view = DepthView.of_depth(depth, camera)
    return DepthView(
        view.points, camera, frame=image.header.frame_id, stamp=_nanoseconds(image.header)
    )


def points_from_cloud(cloud: PointCloud2, max_range: float) -> NDArray[np.float32]:
    """Read the points of a cloud.

    Parameters
    ----------
    cloud
        Organised or not, with fields x, y, z of FLOAT32 or FLOAT64 in either byte order, metres.
    max_range
        Coordinates beyond it, in metres, and infinite ones (REP-117) count as not measured, as do
        points at the origin, by which several drivers mark pixels without a measurement.

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
    reach[reach == 0.0] = np.nan
    missing = ~_measured(reach, max_range)
    for axis in range(3):  # several times faster than all three at once
        points[..., axis][missing] = np.nan
    return points if cloud.height > 1 else points[0]


def depth_from_image(image: Image, max_range: float) -> NDArray[np.float32]:
    """Read a depth image, see `view_from_image`: (height, width) metres, NaN for none."""
    if image.width * image.height == 0:
        raise MessageError("empty", "the depth image has no pixels")
    if image.encoding not in DEPTH_TYPES:
        raise MessageError(
            "encoding",
            f"the depth image has encoding '{image.encoding}', expected "
            "'32FC1' (metres) or '16UC1' (millimetres)",
        )
    dtype = np.dtype(DEPTH_TYPES[image.encoding]).newbyteorder(">" if image.is_bigendian else "<")
    check_rows("depth image", "step", image.step, image.width * dtype.itemsize)
    check_length("depth image", image.data, image.step, image.height)
    raw: NDArray[np.generic] = np.ndarray(
        (image.height, image.width), dtype, image.data, strides=(image.step, dtype.itemsize)
    )
    depth = raw.astype(np.float32)
    if dtype.kind == "u":
        depth /= np.float32(MM_PER_M)
    negative = np.isfinite(depth) & (depth < 0.0)  # -inf: nearer than the sensor's range (REP-117)
    if np.count_nonzero(negative) > depth.size / 2:
        raise MessageError(
            "flipped_z",
            "most of the depth image is negative: z is flipped; expected depth along the optical "
            "axis, forward",
        )
    depth[~(depth > 0.0)] = np.nan
    depth[~_measured(depth, max_range)] = np.nan
    return depth


def is_distorted(info: CameraInfo) -> bool:
    """Tell whether a description is that of an image which still has to be rectified.

    Where a rotation ``r`` is given, too, the depth was computed in the rectified images of a stereo
    pair.
    """
    turned = any(info.r) and not np.allclose(info.r, np.eye(3).ravel())
    return any(info.d) and not turned


def camera_from_info(info: CameraInfo) -> Camera:
    """Read the intrinsics of a rectified image; the pose is the identity.

    They are those of the projection matrix P, which describes the rectified image. Where a driver
    leaves P zero, the camera matrix K stands in for it. Both are of the full resolution: the image
    is the region of interest, of which ``binning`` pixels along each axis became one.

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
    roi, bx, by = info.roi, max(info.binning_x, 1), max(info.binning_y, 1)
    return Camera(
        width=(roi.width or info.width) // bx,
        height=(roi.height or info.height) // by,
        fx=fx / bx,
        fy=fy / by,
        cx=(cx - roi.x_offset + 0.5) / bx - 0.5,  # the centre of several pixels lies between them
        cy=(cy - roi.y_offset + 0.5) / by - 0.5,
        pose=np.eye(4),
    )


def distortion_from_info(info: CameraInfo) -> Distortion:
    """Read the distortion of a raw image, for the region of interest and binning that it has.

    Raises
    ------
    MessageError
        If the model or the number of its coefficients is not known.
    """
    raw = CameraInfo(
        width=info.width, height=info.height, k=info.k,
        roi=info.roi, binning_x=info.binning_x, binning_y=info.binning_y,
    )  # fmt: skip
    try:
        return Distortion(info.distortion_model, tuple(info.d), camera_from_info(raw))
    except ValueError as error:
        text = f"camera_info: {error}; or rectify the image (image_proc) and set rectify:=false"
        raise MessageError("distortion", text) from error


def _nanoseconds(header: Header) -> int:
    return header.stamp.sec * 10**9 + header.stamp.nanosec


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
    check_rows("cloud", "row_step", cloud.row_step, cloud.width * cloud.point_step)
    check_length("cloud", cloud.data, cloud.row_step, cloud.height)


def check_rows(what: str, name: str, step: int, row_length: int) -> None:
    """Raise if the bytes from row to row are fewer than those of a row."""
    if step < row_length:
        raise MessageError(
            "row_step", f"the {what}'s {name} is {step}, expected {row_length} bytes or more"
        )


def check_length(what: str, data: array.array[int], step: int, height: int) -> None:
    """Raise if there are not as many bytes as rows need."""
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
