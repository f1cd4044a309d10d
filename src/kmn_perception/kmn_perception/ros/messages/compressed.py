"""Compressed images, as image_transport has them, become raw ones, or say what is wrong."""

from __future__ import annotations

import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import CompressedImage, Image

from kmn_perception.ros.messages.errors import MessageError
from kmn_perception.ros.messages.formats import DEPTH_TYPES
from kmn_perception.ros.messages.rvl import decode_rvl
from kmn_perception.ros.messages.writing import image_from_pixels

CONFIG = struct.Struct("<i2f")  # the head of compressedDepth: kind, and two numbers A and B
INVERSE_DEPTH = 0  # the kind of A / (pixel - B) = depth
SIZE = struct.Struct("<2I")  # the head of RVL: width and height
PNG, RVL = "compressedDepth png", "compressedDepth rvl"
DEPTH_CODINGS = {"compressedDepth": PNG, PNG: PNG, RVL: RVL}  # the first one is an older name
MAX_PIXELS = 2**26  # beyond which a size is taken for damaged
IMAGE_ENCODINGS = {("uint8", 1): "mono8", ("uint8", 3): "bgr8"}


def raw_depth(image: Image | CompressedImage) -> Image:
    """Return a depth image as it is, or decompressed (transport ``compressedDepth``).

    ``16UC1`` is a PNG or RVL of the very pixels; ``32FC1`` one of quantised inverse depths.

    Raises
    ------
    MessageError
        If it is malformed.
    """
    if isinstance(image, Image):
        return image
    encoding, _, coding = (part.strip() for part in image.format.partition(";"))
    if encoding not in DEPTH_TYPES or coding not in DEPTH_CODINGS:
        raise MessageError(
            "compressed_format",
            f"the compressed depth image has format '{image.format}', expected '16UC1' or '32FC1', "
            f"then '; {PNG}' or '; {RVL}'",
        )
    data = bytes(image.data)
    if len(data) <= CONFIG.size:
        raise MessageError(
            "compressed_header",
            f"the compressed depth image has {len(data)} bytes, expected more than the "
            f"{CONFIG.size} of its header",
        )
    decode = _depth_from_png if DEPTH_CODINGS[coding] == PNG else _depth_from_rvl
    pixels = decode(data[CONFIG.size :])
    if encoding == "16UC1":
        return image_from_pixels(pixels, encoding, image.header)
    kind, a, b = CONFIG.unpack_from(data)
    if kind != INVERSE_DEPTH or not (0.0 < a < np.inf and abs(b) < np.inf):
        raise MessageError(
            "compressed_header",
            f"the header of the compressed depth image has kind {kind} and quantisation {a:g}, "
            f"{b:g}; expected kind {INVERSE_DEPTH} and finite numbers, the first one positive",
        )
    with np.errstate(divide="ignore"):
        depth = np.float32(a) / (pixels.astype(np.float32) - np.float32(b))
    depth[pixels == 0] = np.nan
    return image_from_pixels(depth, encoding, image.header)


def raw_image(image: Image | CompressedImage) -> Image:
    """Return an image as it is, or decompressed (transport ``compressed``: JPEG or PNG).

    Raises
    ------
    MessageError
        If it is malformed, or has not 1 or 3 channels of 8 bits.
    """
    if isinstance(image, Image):
        return image
    if "compressedDepth" in image.format:
        raise MessageError(
            "compressed_format",
            f"the compressed image has format '{image.format}', which is that of depth; expected "
            "a JPEG or PNG image",
        )
    pixels = _decode(bytes(image.data), "image")
    channels = pixels.shape[2] if pixels.ndim == 3 else 1
    kind = pixels.dtype.name, channels
    if kind not in IMAGE_ENCODINGS:
        raise MessageError(
            "compressed_data",
            f"the compressed image holds {channels} channel(s) of {kind[0]}, expected 1 or 3 of "
            "uint8",
        )
    encoding = IMAGE_ENCODINGS[kind]
    if encoding == "bgr8" and "compressed rgb8" in image.format:  # whose red was coded as blue
        encoding = "rgb8"
    return image_from_pixels(pixels, encoding, image.header)


def _depth_from_png(data: bytes) -> NDArray[np.uint16]:
    pixels = _decode(data, "depth image")
    if pixels.dtype != np.uint16 or pixels.ndim != 2:
        raise MessageError(
            "compressed_data",
            f"the compressed depth image holds an array {pixels.shape} of {pixels.dtype}, expected "
            "one channel of uint16",
        )
    return pixels


def _depth_from_rvl(data: bytes) -> NDArray[np.uint16]:
    width, height = SIZE.unpack_from(data) if len(data) >= SIZE.size else (0, 0)
    pixels = None
    if 0 < width * height <= MAX_PIXELS:
        pixels = decode_rvl(data[SIZE.size :], width * height)
    if pixels is None:
        raise MessageError(
            "compressed_data",
            f"the compressed depth image is damaged: no RVL of {width} x {height} pixels",
        )
    return pixels.reshape(height, width)


def _decode(data: bytes, what: str) -> NDArray[Any]:
    """Return the pixels of a PNG or JPEG file, as they are in it."""
    pixels = None
    try:
        if data:
            pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # of an absurd size
        pixels = None
    if pixels is None:
        raise MessageError(
            "compressed_data",
            f"the {len(data)} bytes of the compressed {what} are damaged, or no image file",
        )
    return pixels
