"""Weight files of networks that propose doors in the view of a wall."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from kmn_perception.network import weight_file
from kmn_perception.network.wall_network import KINDS, WallNetwork
from kmn_perception.network.weight_file import WeightsError

NETWORK = "wall"  # the design's name in weight files


class WallWeights(NamedTuple):
    """The network of a weight file.

    Attributes
    ----------
    cells
        How the cells that it reads are made of a view, by name.
    metadata
        ``model``, ``training`` (settings, seed), ``errors`` (measured after training), and what
        `save` adds: ``network``, ``design`` (width, kinds of handles, cells) and ``format``.
    """

    network: WallNetwork
    cells: dict[str, Any]
    metadata: dict[str, Any]


def save(path: Path, weights: WallWeights) -> None:
    """Write a weight file; raise ``OSError`` where that fails, with no part of it left."""
    known = {"network": NETWORK, "design": _design(weights)}
    weight_file.write(path, weights.network.state_dict(), {**weights.metadata, **known})


def load(name_or_path: str | Path, cells: Mapping[str, Any]) -> WallWeights:
    """Read a weight file: a shipped name, or the user's own file.

    Parameters
    ----------
    cells
        How the cells are made that the network shall read, by name.

    Raises
    ------
    WeightsError
        If it is missing, corrupt, holds another network, or was trained on other cells.
    """
    name, metadata, tensors = weight_file.read(name_or_path)
    if metadata.get("network") != NETWORK:
        raise WeightsError(
            f"{name} holds a network of design {metadata.get('network')!r}, "
            f"not one that proposes doors in walls ({NETWORK!r})"
        )
    design: Any = metadata.get("design")
    try:
        network = WallNetwork(design["width"])
    except (TypeError, KeyError, ValueError, RuntimeError) as error:
        raise WeightsError(
            f"{name} describes no network for walls: its design is {design!r}"
        ) from error
    trained = WallWeights(network, dict(cells), metadata)
    for key, expected in _design(trained).items():
        if design.get(key) != expected:
            raise WeightsError(
                f"{name} was trained for other views of walls: its {key} are {design.get(key)}, "
                f"here they are {expected}"
            )
    weight_file.fill(name, trained.network, tensors)
    return trained


def _design(weights: WallWeights) -> dict[str, Any]:
    return {"width": weights.network.width, "kinds": list(KINDS), "cells": weights.cells}
