"""The fit of the network to the samples, in epochs that are measured on held-out rooms."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.network.wall_network import WallNetwork, proposals_of
from kmn_perception.training.run import Run
from kmn_perception.training.wall.augmentation import whole, window
from kmn_perception.training.wall.losses import Losses, losses, soft_targets
from kmn_perception.training.wall.samples import Sample
from kmn_perception.training.wall.scores import Scores
from kmn_perception.training.wall.settings import WallTrainingSettings

_ORDER, _WINDOWS = 1, 2  # sequences of random numbers


@dataclass
class FitState:
    """How far a fit has come; what a checkpoint holds beside the network and its optimiser."""

    step: int = 0  # batches
    seconds: float = 0.0
    sums: list[float] = field(default_factory=list)  # of the parts of the loss, in this epoch
    epochs: list[dict[str, Any]] = field(default_factory=list)  # what each one reported


class Fitting:
    """Fit a network to samples.

    Parameters
    ----------
    cell
        Height and width of the views' cells, metres.
    """

    def __init__(
        self,
        network: WallNetwork,
        samples: Sequence[Sample],
        held_out: Sequence[Sample],
        settings: WallTrainingSettings,
        cell: tuple[float, float],
        run: Run,
    ) -> None:
        self.network, self.settings, self.run, self.state = network, settings, run, FitState()
        self._samples, self._held_out, self._cell = samples, held_out, cell
        fit = settings.fit
        self._steps = math.ceil(len(samples) / fit.batch)  # of an epoch
        self._optimiser = torch.optim.AdamW(
            network.parameters(), lr=fit.learning_rate, weight_decay=fit.weight_decay
        )
        self._schedule = torch.optim.lr_scheduler.OneCycleLR(
            self._optimiser,
            fit.learning_rate,
            # Of fewer steps the rise would have no length.
            total_steps=max(fit.epochs * self._steps, math.ceil(2.0 / fit.warm_up)),
            pct_start=fit.warm_up,
        )

    def fit(self) -> None:
        """Fit to the end, from wherever the last checkpoint left it."""
        checkpoint = self.run.load(torch.device("cpu"))
        if checkpoint is not None:
            self._restore(checkpoint)
            tqdm.write(f"resuming in epoch {len(self.state.epochs) + 1}")
        while len(self.state.epochs) < self.settings.fit.epochs:
            self._fit_epoch(len(self.state.epochs))
            self._report()
        self._save()

    def _fit_epoch(self, epoch: int) -> None:
        state, batch = self.state, self.settings.fit.batch
        done = state.step - epoch * self._steps
        order = np.random.default_rng((self.settings.seed, _ORDER, epoch))
        rows = order.permutation(len(self._samples))
        started = time.monotonic() - state.seconds
        self.network.train()
        title = f"epoch {epoch + 1}/{self.settings.fit.epochs}"
        with tqdm(
            total=len(rows), initial=done * batch, unit=" views", desc=title, mininterval=1.0
        ) as bar:
            for first in range(done * batch, len(rows), batch):
                chosen = rows[first : first + batch]
                self._learn(chosen)
                state.seconds = time.monotonic() - started
                bar.update(len(chosen))
                if self.run.checkpoint_is_due():
                    self._save()
                if self.run.interrupted:
                    raise KeyboardInterrupt

    def _learn(self, rows: NDArray[np.int64]) -> None:
        """Take a step by windows of some samples."""
        settings, state = self.settings, self.state
        generator = np.random.default_rng((settings.seed, _WINDOWS, state.step))
        windows = [window(self._samples[i], settings.augmentation, generator) for i in rows]
        cells = torch.from_numpy(np.stack([cells for cells, _ in windows]))
        targets = [target for _, target in windows]
        soft = soft_targets(targets, settings.augmentation.columns, settings.target.spread)
        parts = losses(self.network(cells), soft)
        self._optimiser.zero_grad(set_to_none=True)
        parts.total(settings.fit.loss).backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), settings.fit.max_norm)
        self._optimiser.step()
        self._schedule.step()
        state.step += 1
        sums = state.sums or [0.0] * len(parts)
        state.sums = [a + float(b.detach()) for a, b in zip(sums, parts, strict=True)]

    def _report(self) -> None:
        """Measure an epoch, and keep and say the result."""
        state, names = self.state, Losses._fields
        loss = dict(zip(names, (value / self._steps for value in state.sums), strict=True))
        held_out, scores = measure(self.network, self._held_out, self.settings, self._cell)
        report: dict[str, Any] = {
            "loss": _rounded(loss),
            "held_out_loss": _rounded(held_out),
            "right": scores.shares(),
            "of": dict(sorted(scores.counts.items())),
            "seconds": round(state.seconds),
        }
        state.epochs.append(report)
        state.sums = []
        number = len(state.epochs)
        for kind in ("loss", "held_out_loss", "right"):
            for name, value in report[kind].items():
                self.run.curve(f"{kind}/{name}", value, number)
        tqdm.write(f"epoch {number}: {described(report)}")

    def _save(self) -> None:
        self.run.save(
            {
                "network": self.network.state_dict(),
                "optimiser": self._optimiser.state_dict(),
                "schedule": self._schedule.state_dict(),
                "state": vars(self.state),
            }
        )

    def _restore(self, checkpoint: dict[str, Any]) -> None:
        self.network.load_state_dict(checkpoint["network"])
        self._optimiser.load_state_dict(checkpoint["optimiser"])
        self._schedule.load_state_dict(checkpoint["schedule"])
        self.state = FitState(**checkpoint["state"])


def measure(
    network: WallNetwork,
    samples: Sequence[Sample],
    settings: WallTrainingSettings,
    cell: tuple[float, float],
) -> tuple[dict[str, float], Scores]:
    """Return mean losses, and what is right, on whole views as they are when doors are found."""
    network.eval()
    scores, sums = Scores(settings.scores, cell), np.zeros(len(Losses._fields))
    with torch.inference_mode():
        for sample in samples:
            logits = network(torch.from_numpy(whole(sample))[None])
            soft = soft_targets([sample.target], sample.cells.shape[2], settings.target.spread)
            sums += [float(part) for part in losses(logits, soft)]
            scores.add(proposals_of(logits), sample.target)
    return dict(zip(Losses._fields, sums / len(samples), strict=True)), scores


def described(report: dict[str, Any]) -> str:
    """Return a report in one line."""
    return "; ".join(_lines(report))


def _lines(report: dict[str, Any]) -> Iterator[str]:
    for title, key in (("loss", "loss"), ("held out", "held_out_loss")):
        yield title + " " + ", ".join(f"{name} {value:.3f}" for name, value in report[key].items())
    counts = report["of"]
    shares = (f"{k} {100 * v:.0f} % of {counts[k]}" for k, v in report["right"].items())
    yield "right: " + ", ".join(shares)


def _rounded(values: dict[str, float]) -> dict[str, float]:
    return {name: round(float(value), 4) for name, value in values.items()}
