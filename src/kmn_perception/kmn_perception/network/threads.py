"""How many threads torch may use."""

from __future__ import annotations

import torch


def use_one_thread() -> None:
    """Let torch use one thread: more are slower for these small networks."""
    torch.set_num_threads(1)
