"""Which of the parameter files on the command line hold something for a node."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from kmn_perception.configuration.plain_text import parse_yaml

FILE_ARGUMENT = "--params-file"
PARAMETERS = "ros__parameters"
WILDCARDS = {"**": r"(/\w+)*", "*": r"/\w+"}  # of rcl, for parts of a node's full name


def useless_files(name: str, arguments: Sequence[str]) -> list[str]:
    """Return a warning for each file that holds nothing for the node of a fully qualified name.

    Parameters
    ----------
    arguments
        Those of ROS, which has read the files before. One that cannot be read again, as a pipe, or
        that only ROS understands, gives no warning.
    """
    texts = []
    for argument, file in zip(arguments, arguments[1:], strict=False):
        if argument == FILE_ARGUMENT and Path(file).is_file():
            try:
                tree = parse_yaml(Path(file).read_text(encoding="utf-8"))
            except (OSError, ValueError):
                continue
            names = list(_names(tree)) if isinstance(tree, Mapping) else []
            if not any(_matches(pattern, name) for pattern in names):
                held = ", ".join(names) or "no node"
                texts.append(f"{file} holds no parameters for {name}, but for {held}")
    return texts


def _names(tree: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Yield the names, perhaps with wildcards, of the nodes that a file holds parameters for."""
    for key, value in tree.items():
        if key == PARAMETERS:
            yield above
        elif isinstance(value, Mapping):
            yield from _names(value, f"{above}/{str(key).strip('/')}")


def _matches(pattern: str, name: str) -> bool:
    parts = pattern.strip("/").split("/")
    return bool(re.fullmatch("".join(WILDCARDS.get(p, "/" + re.escape(p)) for p in parts), name))
