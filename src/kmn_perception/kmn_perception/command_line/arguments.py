"""What the command lines of the offline tools share: types of arguments, and their results."""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from kmn_perception.configuration.output import replacing


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
    _check_writable(path.absolute().parent)
    return path


def output_folder(text: str) -> Path:
    """Parse the path of a folder to write to, which is made when it is needed."""
    path = Path(text)
    there = next(folder for folder in (path, *path.absolute().parents) if folder.exists())
    if not there.is_dir():
        raise argparse.ArgumentTypeError(f"{text} is not a folder: {there} is a file")
    _check_writable(there)
    return path


def _check_writable(folder: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise argparse.ArgumentTypeError(
            f"nothing can be written to {folder}: {error.strerror}"
        ) from error


def write_json(file: Path, result: Any) -> None:
    """Write a result to a file, whole or not at all."""
    with replacing(file) as new:
        new.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
