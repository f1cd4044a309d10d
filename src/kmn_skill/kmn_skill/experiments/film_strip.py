"""A strip of pictures from a recording, as in the paper's figure of the door motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence


def save_strip(recording: Path, strip: Path, count: int) -> None:
    """Put pictures of a recording beside each other, at even distances in time from first to last.

    Parameters
    ----------
    recording
        A GIF; each of its pictures may be shown for another time.
    strip
        File to write.
    count
        Pictures in the strip.
    """
    with Image.open(recording) as pictures:
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(pictures)]
        shown = [frame.info["duration"] for frame in ImageSequence.Iterator(pictures)]
    begins = np.cumsum([0, *shown[:-1]])
    chosen = np.searchsorted(begins, np.linspace(0, begins[-1], count), side="right") - 1
    width, height = frames[0].size
    canvas = Image.new("RGB", (count * width, height))
    for place, number in enumerate(chosen):
        canvas.paste(frames[number], (place * width, 0))
    canvas.save(strip)
