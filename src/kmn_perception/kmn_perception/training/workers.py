"""The processes that train together: one, or as many as ``torchrun`` starts."""

from __future__ import annotations

import os
from collections.abc import Callable
from types import TracebackType
from typing import TypeVar

import torch
from torch import distributed, nn
from torch.nn.parallel import DistributedDataParallel
from tqdm import tqdm

from kmn_perception.training.run import RunError

T = TypeVar("T")


class Workers:
    """A context in which this process knows its rank, the count of processes and its device."""

    def __init__(self, device: str) -> None:
        self.count = int(os.environ.get("WORLD_SIZE", "1"))
        self.rank = int(os.environ.get("RANK", "0"))
        if device == "auto":
            device = "cuda" if torch.cuda.is_available() else "cpu"
        if device == "cuda":
            if not torch.cuda.is_available():
                raise RunError("there is no CUDA device; use --device cpu or auto")
            device = f"cuda:{os.environ.get('LOCAL_RANK', '0')}"
        self.device = torch.device(device)

    def __enter__(self) -> Workers:
        if self.count > 1:
            distributed.init_process_group("nccl" if self.device.type == "cuda" else "gloo")
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.count > 1:
            distributed.destroy_process_group()

    def parallel(self, network: nn.Module) -> nn.Module:
        """Return the network such that gradients are averaged over all processes."""
        return DistributedDataParallel(network) if self.count > 1 else network

    def from_first(self, make: Callable[[], T]) -> T:
        """Return what the first process makes: others may have folders of their own."""
        made = [make() if self.rank == 0 else None]
        if self.count > 1:
            distributed.broadcast_object_list(made, device=self.device)
        return made[0]  # type: ignore[return-value]

    def wait(self) -> None:
        """Return when all processes have come here."""
        if self.count > 1:
            distributed.barrier()

    def say(self, text: str) -> None:
        """Print a line above the progress bar, once."""
        if self.rank == 0:
            tqdm.write(text)
