"""Encoders of recordings: animated GIF, and H.264 as browsers play it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any, Protocol

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from kmn_sim.sensors.settings import RecordingSettings


class Encoder(Protocol):
    """Writes pictures (height, width, 3) to a file; all methods raise ``OSError``."""

    def __init__(self, file: Path, rate: float, settings: RecordingSettings) -> None:
        """Open a file for pictures of a rate, 1/s."""

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add a picture."""

    def close(self) -> None:
        """Complete the file."""


class GifEncoder:
    """An animated GIF, which is written as a whole when it is closed."""

    def __init__(self, file: Path, rate: float, settings: RecordingSettings) -> None:
        self._file, self._rate, self._colours = file, rate, settings.gif.colours
        self._pictures: list[Image.Image] = []

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Keep a picture."""
        self._pictures.append(Image.fromarray(picture).quantize(self._colours))

    def close(self) -> None:
        """Write the file."""
        first, *others = self._pictures
        first.save(
            self._file,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=round(1e3 / self._rate),
            loop=0,
        )


class Mp4Encoder:
    """H.264 with 4:2:0 subsampling, its index at the start of the file: what browsers play."""

    def __init__(self, file: Path, rate: float, settings: RecordingSettings) -> None:
        with _os_errors():
            # Written picture by picture, so that a full disk is found when it is full.
            options = {"movflags": "faststart", "flush_packets": "1"}
            self._container = av.open(str(file), "w", format="mp4", options=options)
            stream: Any = self._container.add_stream(
                "libx264",
                rate=Fraction(rate).limit_denominator(1000),
                options={"crf": str(settings.mp4.quality), "preset": "veryfast"},
            )
        stream.width, stream.height = settings.recording
        stream.pix_fmt = "yuv420p"
        self._stream = stream

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Encode a picture."""
        with _os_errors():
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            self._container.mux(self._stream.encode(frame))

    def close(self) -> None:
        """Encode what is left, and complete the file."""
        with _os_errors():
            try:
                self._container.mux(self._stream.encode())
            finally:
                self._container.close()


ENCODERS: dict[str, type[Encoder]] = {".gif": GifEncoder, ".mp4": Mp4Encoder}


@contextmanager
def _os_errors() -> Iterator[None]:
    """Raise what the library reports as ``OSError``."""
    try:
        yield
    except av.FFmpegError as error:
        raise OSError(error.errno, error.strerror) from error
