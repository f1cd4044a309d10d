"""What all weight files share: safetensors, with what is known about the networks as metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import Tensor, nn

from kmn_perception.configuration import resources
from kmn_perception.configuration.output import replacing
from kmn_perception.configuration.plain_text import parse_json

FORMAT = "kmn-weights-3"


class WeightsError(ValueError):
    """A weight file is missing, corrupt, or belongs to another model."""


class WeightFile(NamedTuple):
    """A weight file as it was read: its name, metadata and tensors."""

    name: str
    metadata: dict[str, Any]
    tensors: dict[str, Tensor]


def write(path: Path, tensors: Mapping[str, Tensor], metadata: Mapping[str, Any]) -> None:
    """Write a weight file; raise ``OSError`` where that fails, with no part of it left."""
    text = {key: json.dumps(value) for key, value in {**metadata, "format": FORMAT}.items()}
    try:
        with replacing(path) as new:
            save_file({key: value.contiguous() for key, value in tensors.items()}, str(new), text)
    except SafetensorError as error:
        raise OSError(f"cannot write {path}: {error}") from error


def read(name_or_path: str | Path) -> WeightFile:
    """Read a weight file: a shipped name, or the user's own file.

    Raises
    ------
    WeightsError
        If it is missing, corrupt, or of another format.
    """
    try:
        path = resources.find("weights", name_or_path, ".safetensors")
    except FileNotFoundError as error:
        raise WeightsError(f"no weights: {error}") from error
    try:
        with safe_open(str(path), framework="pt") as file:
            metadata = {key: parse_json(text) for key, text in (file.metadata() or {}).items()}
            tensors = {key: file.get_tensor(key) for key in file.keys()}
    except (SafetensorError, OSError, ValueError) as error:
        raise WeightsError(f"{path.name} is not a readable safetensors file: {error}") from error
    found = metadata.get("format")
    if found != FORMAT:
        is_ours = str(found).startswith(FORMAT.rstrip("0123456789"))
        what = "of another version: train it anew" if is_ours else "no weight file of ours"
        raise WeightsError(f"{path.name} is {what} (format {found}, not {FORMAT})")
    return WeightFile(path.name, metadata, tensors)


def fill(name: str, network: nn.Module, tensors: Mapping[str, Tensor]) -> None:
    """Give a network the weights of a file, for predictions; raise ``WeightsError``."""
    try:
        network.load_state_dict(dict(tensors))
    except RuntimeError as error:
        raise WeightsError(
            f"{name} does not hold the network that it describes: {error}"
        ) from error
    network.eval().requires_grad_(False)
    # For single images two to three times as fast as the layout that suits training.
    network.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
