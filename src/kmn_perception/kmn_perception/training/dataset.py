"""The growing data set D of Algorithm 2, on disk so that a run can be resumed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kmn_perception.kinematic_model import KinematicModel

LEVELS = 65535  # depth in [0, 1] is stored in steps of 1/65535


class Dataset:
    """Depth images (H, W) and what is to be predicted for them, up to a fixed capacity.

    Parameters
    ----------
    folder
        Where the two arrays lie; an existing data set there is continued.
    """

    def __init__(self, folder: Path, model: KinematicModel, capacity: int) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        shape = (capacity, model.input.height, model.input.width)
        self.depth = _memory_map(folder / "depth.npy", shape, np.dtype(np.uint16))
        self.values = _memory_map(
            folder / "values.npy", (capacity, len(model.parameters)), np.dtype(np.float64)
        )

    def put(self, index: int, depth: NDArray[np.float32], values: NDArray[np.float64]) -> None:
        """Store a depth image (H, W) in [0, 1] with its (theta, gamma)."""
        self.depth[index] = np.round(depth * LEVELS).astype(np.uint16)
        self.values[index] = values

    def batch(self, indices: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
        """Return depth images (B, H, W) and (theta, gamma) (B, n + m), float32."""
        depth = torch.from_numpy(self.depth[indices].astype(np.float32) / LEVELS)
        return depth, torch.from_numpy(self.values[indices].astype(np.float32))


def _memory_map(path: Path, shape: tuple[int, ...], dtype: np.dtype) -> np.memmap:
    if path.exists():
        found: np.memmap = np.lib.format.open_memmap(path, mode="r+")
        if found.shape == shape and found.dtype == dtype:
            return found
    return np.lib.format.open_memmap(path, mode="w+", shape=shape, dtype=dtype)
