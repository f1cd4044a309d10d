"""Short names for the content of files."""

from __future__ import annotations

import hashlib
from pathlib import Path

DIGITS = 12


def short_hash(*files: Path) -> str:
    """Return the start of the sha256 sum of files, one after another."""
    content = hashlib.sha256()
    for file in files:
        content.update(file.read_bytes())
    return content.hexdigest()[:DIGITS]
