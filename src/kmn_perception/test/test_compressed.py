"""Compressed images: against files packed here from the specifications of PNG, RVL and transport.

No code is shared with OpenCV's decoder and ours.
"""

from __future__ import annotations

import array
import struct
import zlib
from collections.abc import Callable, Iterator
from itertools import groupby
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from sensor_msgs.msg import CompressedImage, Image

from kmn_perception.ros.messages import MessageError, depth_from_image
from kmn_perception.ros.messages.compressed import raw_depth, raw_image
from kmn_perception.ros.messages.grey import grey_from_image

GREY, RGB = 0, 2  # kinds of colour in a PNG
MM = np.array([[0, 1, 255, 256, 1234], [65535, 700, 0, 42, 9]], dtype=np.uint16)
A, B = 10100.0, -1009.0  # quantisation 100, 10 m at most: A = 100 * 101, B = 1 - A / 10
HEAD = struct.pack("<i2f", 0, A, B)
PNG_16, RVL_16 = "16UC1; compressedDepth png", "16UC1; compressedDepth rvl"
PNG_32 = "32FC1; compressedDepth png"


def png(pixels: NDArray[Any], colour: int = GREY) -> bytes:
    """Pack a PNG file without filters."""

    def chunk(name: bytes, data: bytes) -> bytes:
        checked = name + data
        return struct.pack(">I", len(data)) + checked + struct.pack(">I", zlib.crc32(checked))

    height, width = pixels.shape[:2]
    size = struct.pack(">2I5B", width, height, 8 * pixels.itemsize, colour, 0, 0, 0)
    rows = b"".join(b"\0" + row.astype(row.dtype.newbyteorder(">")).tobytes() for row in pixels)
    parts = chunk(b"IHDR", size) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


def rvl(pixels: NDArray[np.uint16]) -> bytes:
    """Pack runs and differences: groups of four bits, eight to a word, the first one highest."""
    numbers: list[int] = []
    last, runs = (
        0,
        [(zero, list(run)) for zero, run in groupby(pixels.ravel().tolist(), (0).__eq__)],
    )
    if not runs[0][0]:
        runs.insert(0, (True, []))
    for zero, run in runs:
        numbers.append(len(run))
        for pixel in () if zero else run:
            numbers.append(2 * (pixel - last) if pixel >= last else 2 * (last - pixel) - 1)
            last = pixel
    if runs[-1][0]:
        numbers.append(0)

    def groups(number: int) -> Iterator[str]:
        while number > 7:
            yield f"{8 + number % 8:x}"
            number //= 8
        yield f"{number:x}"

    digits = "".join(group for number in numbers for group in groups(number))
    digits += "0" * (-len(digits) % 8)
    words = [int(digits[i : i + 8], 16) for i in range(0, len(digits), 8)]
    height, width = pixels.shape
    return struct.pack(f"<2I{len(words)}I", width, height, *words)


def message(kind: str, data: bytes) -> CompressedImage:
    made = CompressedImage(format=kind, data=array.array("B", data))
    made.header.frame_id, made.header.stamp.sec = "camera", 5
    return made


def pixels_of(image: Image) -> NDArray[np.uint16]:
    return np.frombuffer(bytes(image.data), "<u2").reshape(image.height, image.width)


@pytest.mark.parametrize("kind", [PNG_16, "16UC1; compressedDepth", "16UC1;compressedDepth png"])
def test_millimetres_in_a_png_come_through_exactly(kind: str) -> None:
    image = raw_depth(message(kind, HEAD + png(MM)))
    assert (image.encoding, image.header.frame_id, image.header.stamp.sec) == ("16UC1", "camera", 5)
    np.testing.assert_array_equal(pixels_of(image), MM)
    depth = depth_from_image(image, 100.0)
    np.testing.assert_allclose(depth, np.where(MM > 0, MM / 1000.0, np.nan), rtol=1e-6)


def test_an_example_of_rvl_that_was_packed_by_hand() -> None:
    """Two zeros, two others: +5 (10, as 2 + 8 and 1) and +0; one zero, no other."""
    data = struct.pack("<3I", 5, 1, 0x22A10100)
    pixels = pixels_of(raw_depth(message(RVL_16, HEAD + data)))
    assert pixels.tolist() == [[0, 0, 5, 5, 0]]


@given(arrays(np.uint16, st.tuples(st.integers(1, 9), st.integers(1, 9))))
def test_rvl_comes_through_exactly(pixels: NDArray[np.uint16]) -> None:
    image = raw_depth(message(RVL_16, HEAD + rvl(pixels)))
    np.testing.assert_array_equal(pixels_of(image), pixels)


@pytest.mark.parametrize("pack", [png, rvl])
def test_quantised_inverse_depths_are_metres_again(pack: Callable[..., bytes]) -> None:
    depth = np.array([[0.5, 1.0, 2.5], [5.0, 9.9, np.nan]])
    inverse = np.where(np.isnan(depth), 0.0, A / depth + B).astype(np.uint16)
    kind = PNG_32 if pack is png else PNG_32.replace("png", "rvl")
    image = raw_depth(message(kind, HEAD + pack(inverse)))
    assert image.encoding == "32FC1"
    read = depth_from_image(image, 100.0)
    np.testing.assert_array_equal(np.isnan(read), np.isnan(depth))
    np.testing.assert_allclose(read[0], depth[0], atol=1e-3)  # a step at 2.5 m is 0.6 mm
    exact = A / (inverse[1, 1] - B)
    assert read[1, 1] == pytest.approx(exact, rel=1e-6)


BROKEN: dict[str, tuple[str, bytes, str, str]] = {
    "other transport": ("16UC1; png compressed", png(MM), "compressed_format", "'16UC1; png comp"),
    "no encoding": ("compressedDepth png", HEAD + png(MM), "compressed_format", "expected '16UC1'"),
    "other encoding": ("mono16; compressedDepth", HEAD + png(MM), "compressed_format", "mono16"),
    "other coding": ("16UC1; compressedDepth zstd", HEAD + png(MM), "compressed_format", "zstd"),
    "nothing": (PNG_16, b"", "compressed_header", "has 0 bytes, expected more than the 12"),
    "header only": (RVL_16, HEAD, "compressed_header", "has 12 bytes"),
    "other kind": (PNG_32, b"\1" + HEAD[1:] + png(MM), "compressed_header", "kind 1"),
    "zero quantisation": (PNG_32, bytes(12) + png(MM), "compressed_header", "quantisation 0, 0"),
    "NaN": (
        PNG_32, struct.pack("<i2f", 0, A, float("nan")) + png(MM), "compressed_header", "nan"
    ),
    "no header": (PNG_16, png(MM), "compressed_data", "damaged, or no image file"),
    "cut off": (PNG_16, HEAD + png(MM)[:-30], "compressed_data", "damaged"),
    "bit flipped": (PNG_16, HEAD + png(MM).replace(b"IDATx", b"IDATy"), "compressed_data", "damag"),
    "8 bits": (PNG_16, HEAD + png(MM.astype(np.uint8)), "compressed_data", "of uint8, expected"),
    "RVL cut off": (RVL_16, HEAD + rvl(MM)[:-4], "compressed_data", "no RVL of 5 x 2 pixels"),
    "RVL without size": (RVL_16, HEAD + b"abc", "compressed_data", "no RVL of 0 x 0 pixels"),
    "RVL absurdly large": (
        RVL_16, HEAD + struct.pack("<2I", 2**31, 2**31) + bytes(8), "compressed_data", "of 21"
    ),
    "RVL too long a run": (
        RVL_16, HEAD + struct.pack("<3I", 2, 2, 0x70000000), "compressed_data", "2 x 2"
    ),
    "RVL empty runs": (RVL_16, HEAD + struct.pack("<3I", 2, 2, 0), "compressed_data", "2 x 2"),
    "RVL negative": (
        RVL_16, HEAD + struct.pack("<3I", 1, 1, 0x01100000), "compressed_data", "1 x 1"
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_depth_image_is_refused_with_the_reason(case: str) -> None:
    kind, data, reason, text = BROKEN[case]
    with pytest.raises(MessageError, match="compressed depth image") as error:
        raw_depth(message(kind, data))
    assert error.value.reason == reason
    assert text in str(error.value)


@given(st.binary(max_size=60))
def test_no_bytes_do_harm_to_rvl(data: bytes) -> None:
    try:
        image = raw_depth(message(RVL_16, HEAD + data))
    except MessageError as error:
        assert error.reason.startswith("compressed_")
    else:
        assert len(image.data) == 2 * image.width * image.height


COLOURS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [10, 20, 30]]], dtype=np.uint8)
WEIGHTS = np.array([0.299, 0.587, 0.114])  # ITU-R BT.601, of red, green and blue


@pytest.mark.parametrize("kind", ["png", "rgb8; png compressed bgr8"])
def test_the_colours_of_a_png_are_grey_values(kind: str) -> None:
    grey = grey_from_image(raw_image(message(kind, png(COLOURS, RGB))))
    np.testing.assert_allclose(grey, COLOURS @ WEIGHTS / 255.0, atol=1 / 255)


def test_colours_that_were_coded_in_the_other_order_are_read_so() -> None:
    image = raw_image(message("rgb8; png compressed rgb8", png(COLOURS[..., ::-1].copy(), RGB)))
    np.testing.assert_allclose(grey_from_image(image), COLOURS @ WEIGHTS / 255.0, atol=1 / 255)


def test_grey_values_of_a_png_come_through_exactly_and_of_a_jpeg_nearly() -> None:
    grey = np.add.outer(np.arange(32), np.arange(48)).astype(np.uint8)
    exact = raw_image(message("mono8; png compressed mono8", png(grey)))
    np.testing.assert_array_equal(grey_from_image(exact), grey.astype(np.float32) / 255)
    _, file = cv2.imencode(".jpg", grey, (cv2.IMWRITE_JPEG_QUALITY, 95))
    nearly = raw_image(message("mono8; jpeg compressed mono8", file.tobytes()))
    np.testing.assert_allclose(grey_from_image(nearly), grey / 255.0, atol=4 / 255)


@pytest.mark.parametrize(
    ("kind", "data", "reason", "text"),
    [
        (PNG_16, HEAD + png(MM), "compressed_format", "which is that of depth"),
        ("jpeg", b"\xff\xd8 no picture", "compressed_data", "no image file"),
        ("jpeg", b"", "compressed_data", "the 0 bytes"),
        ("16UC1; png compressed", png(MM), "compressed_data", "1 channel(s) of uint16, expected"),
    ],
)
def test_a_broken_image_is_refused_with_the_reason(
    kind: str, data: bytes, reason: str, text: str
) -> None:
    with pytest.raises(MessageError, match="compressed image") as error:
        raw_image(message(kind, data))
    assert error.value.reason == reason
    assert text in str(error.value)
