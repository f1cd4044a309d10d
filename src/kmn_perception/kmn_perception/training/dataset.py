"""The growing data set D of Algorithm 2, on disk so that a run can be resumed."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from kmn_perception.network.morph_network import Inputs, InputType
from kmn_perception.training.run import RunError

_SHARE_OF_MEMORY = 0.8  # of a device, that a data set may take
_ROWS = 4096  # that are copied together

Batch: TypeAlias = tuple[list[Tensor], Tensor]


class Batches(Protocol):
    """What gives batches."""

    def batch(self, rows: NDArray[np.int64], /) -> Batch:
        """Return inputs (B, ...) and (theta, gamma) (B, n + m), float32."""


class Dataset:
    """A network's inputs and what is to be predicted for them, up to a fixed capacity.

    Parameters
    ----------
    folder
        Where the arrays lie.
    inputs
        The network's inputs.
    parameters
        Number n + m of morphing parameters.
    filled
        Number of samples that are there already; with none, an empty data set is made.

    Raises
    ------
    RunError
        If there is no room for the data set, or one that is filled is not there as it was.
    """

    def __init__(
        self,
        folder: Path,
        inputs: Sequence[InputType],
        parameters: int,
        capacity: int,
        filled: int,
    ) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        memory_map = _open if filled else _make
        self.inputs = [
            memory_map(folder / f"input{i}.npy", (capacity, *shape), np.dtype(dtype))
            for i, (shape, dtype) in enumerate(inputs)
        ]
        self.values = memory_map(
            folder / "values.npy", (capacity, parameters), np.dtype(np.float64)
        )

    def put(self, rows: slice, inputs: Inputs, values: NDArray[np.float64]) -> None:
        """Store inputs (B, ...) with their (theta, gamma) (B, n + m)."""
        for array, part in zip(self.inputs, inputs, strict=True):
            array[rows] = part
        self.values[rows] = values

    def batch(self, rows: NDArray[np.int64] | slice) -> Batch:
        """Return inputs (B, ...) and (theta, gamma) (B, n + m), float32."""
        inputs = [torch.from_numpy(array[rows].astype(np.float32)) for array in self.inputs]
        return inputs, torch.from_numpy(self.values[rows].astype(np.float32))

    def moved_to(self, device: torch.device, filled: int) -> Batches:
        """Return what gives batches on a device, held in its memory where there is room."""
        if device.type == "cpu":
            return self
        free, _ = torch.cuda.mem_get_info(device)
        arrays = (*self.inputs, self.values)
        needed = sum(array[:filled].nbytes for array in arrays)
        if needed > _SHARE_OF_MEMORY * free:
            return _Sent(self, device)
        return _Held([_copied(array[:filled], device) for array in arrays], device)


@dataclass(frozen=True)
class _Sent:
    """Batches that are sent to a device one by one."""

    data: Dataset
    device: torch.device

    def batch(self, rows: NDArray[np.int64]) -> Batch:
        inputs, values = self.data.batch(rows)
        return [part.to(self.device) for part in inputs], values.to(self.device)


@dataclass(frozen=True)
class _Held:
    """Batches of a data set that a device holds."""

    arrays: list[Tensor]
    device: torch.device

    def batch(self, rows: NDArray[np.int64]) -> Batch:
        chosen = torch.from_numpy(rows).to(self.device, non_blocking=True)
        *inputs, values = (array[chosen].float() for array in self.arrays)
        return inputs, values


def _copied(array: NDArray[Any], device: torch.device) -> Tensor:
    """Copy an array to a device, a part at a time: it need not fit into this machine's memory."""
    copy = torch.empty(array.shape, dtype=torch.from_numpy(array[:0]).dtype, device=device)
    for first in range(0, len(array), _ROWS):
        rows = slice(first, first + _ROWS)
        copy[rows] = torch.from_numpy(np.array(array[rows])).to(device)
    return copy


def _open(path: Path, shape: tuple[int, ...], dtype: np.dtype) -> np.memmap:
    """Open the array of an earlier start of the run, which must be there as it was."""
    try:
        found: np.memmap = np.lib.format.open_memmap(path, mode="r")
    except (OSError, ValueError) as error:
        raise _lost(path, "cannot be read") from error
    if (found.shape, found.dtype) != (shape, dtype):
        expected = f"expected {dtype} of shape {shape}"
        raise _lost(path, f"holds {found.dtype} of shape {found.shape}, {expected}")
    return np.lib.format.open_memmap(path, mode="r+")


def _make(path: Path, shape: tuple[int, ...], dtype: np.dtype) -> np.memmap:
    """Make an array, with all of its room on the disk: a memory map of a full disk would crash."""
    try:
        made: np.memmap = np.lib.format.open_memmap(path, mode="w+", shape=shape, dtype=dtype)
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, path.stat().st_size)
    except OSError as error:
        path.unlink(missing_ok=True)
        needed = np.prod(shape, dtype=np.float64) * dtype.itemsize / 1e6
        free = shutil.disk_usage(path.parent).free / 1e6
        raise RunError(
            f"no room for {path}, a part of the training data: it takes {needed:.1f} MB, "
            f"{free:.1f} MB are free ({error.strerror}); choose another folder with --run"
        ) from error
    return made


def _lost(path: Path, what: str) -> RunError:
    return RunError(
        f"the run cannot be resumed, its training data {path} {what}; "
        "put the file back, or use --restart to train from the beginning"
    )
