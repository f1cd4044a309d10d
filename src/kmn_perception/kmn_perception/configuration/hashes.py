"""Short names for the content of files."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

from kmn_perception.configuration.resources import share_directory

DIGITS = 12
SHIPPED = ("config", "weights")


def short_hash(*files: Path) -> str:
    """Return the start of the sha256 sum of files, one after another."""
    content = hashlib.sha256()
    for file in files:
        content.update(file.read_bytes())
    return content.hexdigest()[:DIGITS]


def text_hash(text: str) -> str:
    """Return the start of the sha256 sum of a text."""
    return hashlib.sha256(text.encode()).hexdigest()[:DIGITS]


@cache
def shipped_hash() -> str:
    """Return a short hash of all configuration and all weights that are shipped."""
    folders = (share_directory() / name for name in SHIPPED)
    return short_hash(*(f for folder in folders for f in sorted(folder.rglob("*")) if f.is_file()))
