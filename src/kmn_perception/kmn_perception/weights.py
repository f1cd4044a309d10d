"""Weight files: safetensors with the networks and all that is known about them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save_file
from torch import nn

from kmn_perception import resources
from kmn_perception.kinematic_model import KinematicModel
from kmn_perception.network import MorphNetwork

FORMAT = "kmn-weights-1"


class WeightsError(ValueError):
    """A weight file is missing, corrupt, or belongs to another model."""


@dataclass(frozen=True)
class Weights:
    """The networks of a weight file.

    Attributes
    ----------
    kmn
        The network after Algorithm 2.
    baseline
        The network before its data were augmented.
    metadata
        ``model``, ``parameters``, ``camera``, ``channels``, ``training`` (settings, seed),
        ``errors`` (measured after training) and ``format``.
    """

    kmn: MorphNetwork
    baseline: MorphNetwork
    metadata: dict[str, Any]


def save(path: str | Path, weights: Weights) -> None:
    """Write a weight file."""
    tensors = {
        f"{role}.{name}": tensor.contiguous()
        for role, network in (("kmn", weights.kmn), ("baseline", weights.baseline))
        for name, tensor in network.state_dict().items()
    }
    metadata = {key: json.dumps(value) for key, value in weights.metadata.items()}
    save_file(tensors, str(path), {**metadata, "format": json.dumps(FORMAT)})


def load(name_or_path: str | Path, model: KinematicModel) -> Weights:
    """Read a weight file for a model: a shipped name, or the user's own file.

    Raises
    ------
    WeightsError
        If it is missing, corrupt, or was trained for another model.
    """
    try:
        path = resources.find("weights", name_or_path, ".safetensors")
    except FileNotFoundError as error:
        raise WeightsError(f"no weights: {error}") from error
    try:
        with safe_open(str(path), framework="pt") as file:
            metadata = {key: json.loads(text) for key, text in (file.metadata() or {}).items()}
            tensors = {key: file.get_tensor(key) for key in file.keys()}
    except (SafetensorError, OSError, ValueError) as error:
        raise WeightsError(f"{path.name} is not a readable safetensors file: {error}") from error
    _check(path.name, metadata, model)
    networks = {role: MorphNetwork(model, metadata["channels"]) for role in ("kmn", "baseline")}
    for role, network in networks.items():
        state = {key.removeprefix(f"{role}."): value for key, value in tensors.items()
                 if key.startswith(f"{role}.")}  # fmt: skip
        _fill(path.name, network, state)
    return Weights(networks["kmn"], networks["baseline"], metadata)


def describe(model: KinematicModel) -> dict[str, Any]:
    """Return what a weight file must agree on with its model: parameters, camera and input."""
    camera, image = model.camera, model.input
    return {
        "model": model.name,
        "parameters": [parameter.name for parameter in model.parameters],
        "limits": model.limits.tolist(),
        "camera": {
            **{key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")},
            "pose": camera.pose.round(9).tolist(),
        },
        "input": vars(image).copy(),
    }


def _check(name: str, metadata: Mapping[str, Any], model: KinematicModel) -> None:
    if metadata.get("format") != FORMAT:
        found = metadata.get("format")
        raise WeightsError(f"{name} is not a weight file of ours: format {found}, not {FORMAT}")
    for key, expected in describe(model).items():
        if metadata.get(key) != expected:
            raise WeightsError(
                f"{name} was trained for another model: its {key} is {metadata.get(key)}, "
                f"that of model '{model.name}' is {expected}"
            )


def _fill(name: str, network: nn.Module, state: Mapping[str, Any]) -> None:
    try:
        network.load_state_dict(dict(state))
    except RuntimeError as error:
        raise WeightsError(
            f"{name} does not hold the network that it describes: {error}"
        ) from error
    network.eval().requires_grad_(False)
    # For single images two to three times as fast as the layout that suits training.
    network.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
