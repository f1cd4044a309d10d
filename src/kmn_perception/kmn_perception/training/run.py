"""The folder of a training run: its settings, checkpoints and TensorBoard curves."""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch

from kmn_perception.configuration.output import replacing
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.network.weight_file import WeightsError
from kmn_perception.training.memory import keep_freed_memory


class RunError(ValueError):
    """A run cannot go on; the text says why, and what to do."""


class Run:
    """Keep what a run needs to be resumed.

    Parameters
    ----------
    folder
        Made if it does not exist; else the run in it is resumed.
    settings
        What the run was started with; to resume with other settings raises ``RunError``.
    checkpoint_seconds
        Between two checkpoints.
    """

    def __init__(self, folder: Path, settings: dict[str, Any], checkpoint_seconds: float) -> None:
        self.folder, self._checkpoint_seconds = folder, checkpoint_seconds
        folder.mkdir(parents=True, exist_ok=True)
        text = json.dumps(settings, indent=2)
        file = folder / "settings.json"
        if not file.exists():
            with replacing(file) as new:
                new.write_text(text, encoding="utf-8")
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
        return self.interrupted or time.monotonic() - self._saved > self._checkpoint_seconds

    def save(self, checkpoint: dict[str, Any]) -> None:
        """Replace the checkpoint; raise ``RunError`` where that fails, with the last one kept."""
        file = self.folder / "checkpoint.pt"
        try:
            with replacing(file) as new:
                torch.save(checkpoint, new)
        except (OSError, RuntimeError) as error:  # of torch's own writer
            raise RunError(
                f"cannot write {file}: {_first_line(error)}; "
                "the same command goes on from the last checkpoint when there is room again"
            ) from error
        self._saved = time.monotonic()

    def load(self, device: torch.device) -> dict[str, Any] | None:
        """Return the last checkpoint, if there is one; raise ``RunError`` if it is damaged."""
        file = self.folder / "checkpoint.pt"
        if not file.exists():
            return None
        try:
            checkpoint: dict[str, Any] = torch.load(file, map_location=device, weights_only=True)
        except (EOFError, OSError, RuntimeError, UnpicklingError, ValueError) as error:
            raise RunError(
                f"{file} is damaged ({_first_line(error)}); "
                "use --restart to train from the beginning"
            ) from error
        return checkpoint

    def save_share(self, rank: int, share: tuple[int, int]) -> None:
        """Keep the round, and the number of its samples that a worker's own data hold."""
        with replacing(self._share_file(rank)) as new:
            new.write_text(json.dumps(share), encoding="utf-8")

    def load_share(self, rank: int) -> tuple[int, int]:
        """Return what was kept of a worker's data; none of any round where there is nothing.

        Raises ``RunError`` if it is damaged.
        """
        file = self._share_file(rank)
        if not file.exists():
            return -1, 0
        try:
            of_round, filled = map(int, json.loads(file.read_text(encoding="utf-8")))
        except (TypeError, ValueError) as error:
            raise RunError(
                f"{file} is damaged; use --restart to train from the beginning"
            ) from error
        return of_round, filled

    def _share_file(self, rank: int) -> Path:
        return self.folder / f"share{rank}.json"


def _first_line(error: Exception) -> str:
    return str(error).split("\n")[0].strip() or type(error).__name__


def run_to_end(program: str, train: Callable[[], None]) -> None:
    """Train, and exit with what went wrong in one line; an interrupted run is resumed by the same.

    Parameters
    ----------
    program
        Name that stands before an error.
    """
    torch.set_flush_denormal(True)  # tiny activations would slow a CPU down
    keep_freed_memory()
    warnings.filterwarnings("ignore", "The value of the smallest subnormal", UserWarning)
    try:
        train()
    except KeyboardInterrupt:
        sys.exit("interrupted; the same command resumes from the last checkpoint")
    except (ConfigurationError, OSError, RunError, WeightsError) as error:
        sys.exit(f"{program}: {error}")
