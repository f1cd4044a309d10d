"""Files that are written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(file: Path) -> Iterator[Path]:
    """Yield a new file beside ``file`` to write to; it takes its place if nothing fails.

    What fails, from a full disk to Ctrl-C, leaves ``file`` as it was.
    """
    new = file.with_name(f".{file.stem}.{os.getpid()}{file.suffix}")
    try:
        yield new
        os.replace(new, file)
    finally:
        new.unlink(missing_ok=True)
