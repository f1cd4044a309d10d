"""How all plots look."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from kmn_perception.configuration.output import replacing

COLOURS = {"baseline": "#d95f02", "kmn_paper": "#7570b3", "kmn": "#1b9e77"}
LABELS = {
    "baseline": "baseline (paper's network, not augmented)",
    "kmn_paper": "KMN (paper's network)",
    "kmn": "our network",
}
DOTS_PER_INCH = 110
PALETTE = 128  # colours of a file, which makes it several times smaller
RULES = {
    "font.size": 9,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "grid.color": "#e0e0e0",
    "legend.frameon": False,
    "legend.fontsize": 8,
}


@contextmanager
def figure(file: Path, rows: int, columns: int, panel: tuple[float, float]) -> Iterator[Figure]:
    """Yield a figure of diagrams, each of a size (inches); at the end write it to a PNG file."""
    with mpl.rc_context(RULES):
        size = columns * panel[0], rows * panel[1]
        made = Figure(size, dpi=DOTS_PER_INCH, layout="constrained")
        canvas = FigureCanvasAgg(made)
        yield made
        canvas.draw()
        image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        with replacing(file) as new:
            image.quantize(PALETTE, dither=Image.Dither.NONE).save(new, optimize=True)
