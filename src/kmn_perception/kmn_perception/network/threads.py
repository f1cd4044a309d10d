"""How many threads the libraries for arrays may use."""

from __future__ import annotations

import cv2
import torch


def use_one_thread() -> None:
    """Let torch and OpenCV use one thread: more are slower for networks and images so small."""
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
