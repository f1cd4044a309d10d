"""What the command lines of the offline tools share: types of arguments, and their results."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any


def whole_number(least: int) -> Callable[[str], int]:
    """Return a parser of whole numbers that are not below ``least``."""

    def parse(text: str) -> int:
        if not text.lstrip("+-").isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"{text} is not a whole number from {least}")
        return int(text)

    return parse


def output_file(text: str) -> Path:
    """Parse the path of a file to write, before hours of work are lost for want of its folder."""
    path = Path(text)
    if path.is_dir() or not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text} is not a file in a folder that exists")
    return path


def write_json(file: Path, result: Any) -> None:
    """Write a result to a file."""
    file.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
