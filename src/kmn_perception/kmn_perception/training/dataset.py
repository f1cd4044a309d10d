"""The growing data set D of Algorithm 2, on disk so that a run can be resumed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kmn_perception.network.morph_network import Inputs, InputType


class Dataset:
    """A network's inputs and what is to be predicted for them, up to a fixed capacity.

    Parameters
    ----------
    folder
        Where the arrays lie; an existing data set there is continued.
    inputs
        The network's inputs.
    parameters
        Number n + m of morphing parameters.
    """

    def __init__(
        self, folder: Path, inputs: Sequence[InputType], parameters: int, capacity: int
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.inputs = [
            _memory_map(folder / f"input{i}.npy", (capacity, *shape), np.dtype(dtype))
            for i, (shape, dtype) in enumerate(inputs)
        ]
        self.values = _memory_map(
            folder / "values.npy", (capacity, parameters), np.dtype(np.float64)
        )

    def put(self, rows: slice, inputs: Inputs, values: NDArray[np.float64]) -> None:
        """Store inputs (B, ...) with their (theta, gamma) (B, n + m)."""
        for array, part in zip(self.inputs, inputs, strict=True):
            array[rows] = part
        self.values[rows] = values

    def batch(self, rows: NDArray[np.int64] | slice) -> tuple[list[Tensor], Tensor]:
        """Return inputs (B, ...) and (theta, gamma) (B, n + m), float32."""
        inputs = [torch.from_numpy(array[rows].astype(np.float32)) for array in self.inputs]
        return inputs, torch.from_numpy(self.values[rows].astype(np.float32))


def _memory_map(path: Path, shape: tuple[int, ...], dtype: np.dtype) -> np.memmap:
    if path.exists():
        found: np.memmap = np.lib.format.open_memmap(path, mode="r+")
        if found.shape == shape and found.dtype == dtype:
            return found
    return np.lib.format.open_memmap(path, mode="w+", shape=shape, dtype=dtype)
