"""YAML and JSON that others wrote, read so that whatever they hold is an error with a reason."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import yaml

MAX_DEPTH = 64  # of lists and mappings in each other
MAX_VALUES = 10**6  # a few lines of aliases can stand for billions
MAX_WHOLE = 2**64  # larger ones are no indices, seeds or sizes, and some no real numbers either


def parse_yaml(text: str | bytes) -> Any:
    """Return what YAML says; it is plain data and executes nothing.

    Raises
    ------
    ValueError
        If it is not YAML, nested too deeply, or holds a number that is too large.
    """
    try:
        tree = yaml.safe_load(text if isinstance(text, str) else text.decode())
    except Exception as error:  # PyYAML raises errors of all kinds
        raise ValueError(f"not YAML: {error}") from error
    _check(tree)
    return tree


def parse_json(text: str | bytes) -> Any:
    """Return what JSON says; raise `ValueError` as `parse_yaml` does."""
    try:
        tree = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"not JSON: {error}") from error
    _check(tree)
    return tree


def _check(tree: Any) -> None:
    """Raise `ValueError` if a tree is too deep, too large, or holds too large a number."""
    level, count = [tree], 0
    for _ in range(MAX_DEPTH):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, Mapping):
                inner += (*value, *value.values())
            elif isinstance(value, list | tuple | set):
                inner += value
            elif isinstance(value, int) and abs(value) > MAX_WHOLE:
                raise ValueError(f"it holds a whole number of {value.bit_length()} bits")
            if len(inner) + count > MAX_VALUES:
                raise ValueError(f"it holds more than {MAX_VALUES} values")
        level, count = inner, count + len(inner)
    if level:
        raise ValueError(f"it is nested more than {MAX_DEPTH} times")
