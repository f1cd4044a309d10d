"""Images beside the depth: grey values in the pixels of a `DepthView`, or what is wrong."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CameraInfo, Image

from kmn_perception.model.camera import Camera
from kmn_perception.model.distortion import Distortion, resample
from kmn_perception.ros.messages.errors import MessageError
from kmn_perception.ros.messages.reading import (
    camera_from_info,
    check_length,
    check_rows,
    distortion_from_info,
    is_distorted,
)
from kmn_perception.scene.depth_view import DepthView

TO_GREY = {"mono8": None, "rgb8": cv2.COLOR_RGB2GRAY, "bgr8": cv2.COLOR_BGR2GRAY}
TO_COLOUR = {"mono8": cv2.COLOR_GRAY2RGB, "rgb8": None, "bgr8": cv2.COLOR_BGR2RGB}
SAME = 1e-3  # pixels; intrinsics that differ by less are the same


def grey_from_image(image: Image) -> NDArray[np.float32]:
    """Read an image: (height, width) grey values, 0 to 1 (ITU-R BT.601 weights of the colours).

    Raises
    ------
    MessageError
        If it is malformed, or of another encoding than ``mono8``, ``rgb8`` and ``bgr8``.
    """
    grey = _converted(image, TO_GREY)
    return grey.reshape(grey.shape[:2]).astype(np.float32) / np.float32(255.0)


def colour_from_image(image: Image) -> NDArray[np.uint8]:
    """Read an image: (height, width, 3) red, green and blue; raises as `grey_from_image`."""
    return _converted(image, TO_COLOUR)


def _converted(image: Image, conversions: Mapping[str, int | None]) -> NDArray[np.uint8]:
    """Return the pixels (height, width[, channels]) of an image after its encoding's conversion."""
    if image.width * image.height == 0:
        raise MessageError("image_empty", "the image has no pixels")
    if image.encoding not in conversions:
        raise MessageError(
            "image_encoding",
            f"the image has encoding '{image.encoding}', expected {', '.join(conversions)}",
        )
    conversion = conversions[image.encoding]
    channels = 1 if image.encoding == "mono8" else 3
    check_rows("image", "step", image.step, image.width * channels)
    check_length("image", image.data, image.step, image.height)
    raw: NDArray[np.uint8] = np.ndarray(
        (image.height, image.width, channels),
        np.uint8,
        image.data,
        strides=(image.step, channels, 1),
    )
    return raw if conversion is None else cv2.cvtColor(raw, conversion).astype(np.uint8, copy=False)


def grey_in_view(
    image: Image, info: CameraInfo | None, view: DepthView, rectify: bool = True
) -> NDArray[np.float32]:
    """Return the grey values (height, width) in the pixels of organised points, 0 to 1.

    Parameters
    ----------
    image, info
        The image, of the optical centre of the depth camera. Without a description of its own it is
        registered: its pixels are those of the points.
    view
        The points, with their camera unless the image is registered.
    rectify
        Rectify an image whose ``info`` describes a distortion; else it is rectified already.

    Raises
    ------
    MessageError
        If the image or its description is malformed, or they do not match.
    """
    grey = grey_from_image(image)
    size, expected = (image.width, image.height), view.points.shape[1::-1]
    if info is None:
        if size != expected:
            raise MessageError(
                "image_size",
                f"the image has {_pixels(size)} pixels, the depth {_pixels(expected)}, and no "
                "image/camera_info came; expected the same size, registered to the depth, or the "
                "image's own camera_info",
            )
        return grey
    distorted = rectify and is_distorted(info)
    lens = (
        distortion_from_info(info)
        if distorted
        else Distortion("plumb_bob", (0.0,) * 5, camera_from_info(info))
    )
    described = lens.camera.width, lens.camera.height
    if size != described:
        raise MessageError(
            "image_size",
            f"the image has {_pixels(size)} pixels, its camera_info {_pixels(described)}; expected "
            "the same size: the camera_info is of another resolution or of another camera",
        )
    if view.camera is None:
        if size == expected and not distorted:
            return grey
        raise MessageError(
            "image_camera",
            "the image has its own camera_info and the points are those of a cloud; expected "
            "depth/image and depth/camera_info, or an image registered to the cloud",
        )
    if not distorted and _is_same(lens.camera, view.camera):
        return grey
    return resample(grey, lens, view.camera)


def _is_same(a: Camera, b: Camera) -> bool:
    """Tell whether two cameras have the same pixels."""
    first, second = (np.array([c.width, c.height, c.fx, c.fy, c.cx, c.cy]) for c in (a, b))
    return bool((np.abs(first - second) < SAME).all())


def _pixels(size: tuple[int, ...]) -> str:
    return f"{size[0]} x {size[1]}"
