"""The folder of a training run: its settings, checkpoints and TensorBoard curves."""

from __future__ import annotations

import json
import os
import time
from pathlib import Path
from typing import Any

import torch

CHECKPOINT_SECONDS = 60.0


class RunError(ValueError):
    """The folder belongs to a run with other settings."""


class Run:
    """Keep what a run needs to be resumed.

    Parameters
    ----------
    folder
        Made if it does not exist; else the run in it is resumed.
    settings
        What the run was started with; to resume with other settings raises ``RunError``.
    """

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(settings, indent=2)
        file = folder / "settings.json"
        if not file.exists():
            file.write_text(text, encoding="utf-8")
        elif file.read_text(encoding="utf-8") != text:
            raise RunError(
                f"{folder} holds a run with other settings (see {file}); "
                "continue with those, or use --restart to discard it"
            )
        from torch.utils.tensorboard import SummaryWriter

        self._curves = SummaryWriter(str(folder / "curves"))
        self._saved = time.monotonic()
        self.interrupted = False

    def interrupt(self, signum: int, frame: object) -> None:
        """Handle a signal: stop at the next checkpoint, which is due at once; again, stop now."""
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True

    def curve(self, name: str, value: float, step: int) -> None:
        """Add a point to a TensorBoard curve."""
        self._curves.add_scalar(name, value, step)

    def checkpoint_is_due(self) -> bool:
        """Tell whether the last checkpoint is old, or the run shall stop."""
        return self.interrupted or time.monotonic() - self._saved > CHECKPOINT_SECONDS

    def save(self, checkpoint: dict[str, Any]) -> None:
        """Replace the checkpoint in one go, so that an interrupt never leaves half a file."""
        new = self.folder / "checkpoint.new"
        torch.save(checkpoint, new)
        os.replace(new, self.folder / "checkpoint.pt")
        self._saved = time.monotonic()

    def load(self, device: torch.device) -> dict[str, Any] | None:
        """Return the last checkpoint, if there is one."""
        file = self.folder / "checkpoint.pt"
        if not file.exists():
            return None
        checkpoint: dict[str, Any] = torch.load(file, map_location=device, weights_only=True)
        return checkpoint
