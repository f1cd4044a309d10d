"""RVL, the compression of depth images by runs and differences of pixels (Wilson, 2017).

The stream consists of numbers: by turns how many zeros follow, and how many other pixels, each of
which is then told as its difference from the one before. A number takes one or several groups of
four bits, the least significant first, whose highest bit tells that another one follows.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

GROUPS = 8  # of four bits in a word of the stream
MAX_BITS = 32  # of a number


def decode_rvl(data: bytes, count: int) -> NDArray[np.uint16] | None:
    """Return the pixels (count,) that a stream of 32 bit words holds; None if it is damaged."""
    words = np.frombuffer(data, "<u4", len(data) // 4).astype(np.uint32)
    pixels = np.zeros(count, dtype=np.uint16)
    return pixels if _decode(words, pixels) else None


@njit(cache=True)
def _decode(words: NDArray[np.uint32], pixels: NDArray[np.uint16]) -> bool:
    """Fill in the pixels that are not zero; tell whether the stream holds exactly them."""
    place, done, last = 0, 0, 0
    while done < len(pixels):
        zeros, place = _number(words, place)
        others, place = _number(words, place)
        if zeros < 0 or others < 0 or zeros + others == 0 or done + zeros + others > len(pixels):
            return False
        done += zeros
        for i in range(done, done + others):
            number, place = _number(words, place)
            if number < 0:
                return False
            last += (number >> 1) ^ -(number & 1)  # 0, -1, 1, -2, ...
            if not 0 < last < 65536:
                return False
            pixels[i] = last
        done += others
    return True


@njit(cache=True)
def _number(words: NDArray[np.uint32], place: int) -> tuple[int, int]:
    """Return the number at a place, in groups from the beginning, and the place after it.

    The number is negative where the stream ends before it does.
    """
    number, shift = 0, 0
    while place < GROUPS * len(words) and shift < MAX_BITS:
        group = (np.int64(words[place // GROUPS]) >> (28 - 4 * (place % GROUPS))) & 15
        place += 1
        number |= int(group & 7) << shift
        if not group & 8:
            return number, place
        shift += 3
    return -1, place
