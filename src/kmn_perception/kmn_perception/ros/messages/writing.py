"""Messages that a depth camera publishes, made of arrays."""

from __future__ import annotations

import array

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image, PointCloud2, PointField
from std_msgs.msg import Header

from kmn_perception.model.camera import Camera
from kmn_perception.ros.messages.formats import COORDINATES, DEPTH_TYPES, MM_PER_M


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
    return image_from_pixels(pixels.astype(DEPTH_TYPES[encoding], copy=False), encoding, header)


def image_from_pixels(pixels: NDArray[np.generic], encoding: str, header: Header) -> Image:
    """Make an image of pixels (height, width) or (height, width, channels) of the encoding."""
    data = pixels.astype(pixels.dtype.newbyteorder("<"), copy=False)
    height, width = pixels.shape[:2]
    return Image(
        header=header,
        height=height,
        width=width,
        encoding=encoding,
        is_bigendian=0,
        step=data.nbytes // height,
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


def _bytes(values: NDArray[np.generic]) -> array.array[int]:
    """Pack an array as rclpy takes it without a check of every single byte."""
    packed = array.array("B")
    packed.frombytes(np.ascontiguousarray(values).reshape(-1).view(np.uint8).data)
    return packed
