"""Reads recordings by decoders that did not write them."""

from __future__ import annotations

from pathlib import Path

import cv2
from PIL import Image, ImageSequence

BROWSER_CODECS = (b"avc1", b"h264")  # H.264, as decoders name it


def duration(file: Path) -> float:
    """Decode a recording that browsers play, and return how long it is, seconds."""
    if file.suffix == ".gif":  # in which pictures that are equal are one
        with Image.open(file) as pictures:
            return 1e-3 * sum(page.info["duration"] for page in ImageSequence.Iterator(pictures))
    content = file.read_bytes()
    assert content.index(b"moov") < content.index(b"mdat"), "its index does not come first"
    video = cv2.VideoCapture(str(file))
    assert int(video.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little") in BROWSER_CODECS
    pixels = int(video.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)).to_bytes(4, "little")
    assert pixels == b"I420"  # planar 4:2:0
    count = 0
    while video.read()[0]:
        count += 1
    assert count == int(video.get(cv2.CAP_PROP_FRAME_COUNT))
    return count / float(video.get(cv2.CAP_PROP_FPS))
