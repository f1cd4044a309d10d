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

from kmn_perception.configuration import resources
from kmn_perception.configuration.output import replacing
from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network.designs import DESIGNS
from kmn_perception.network.morph_network import MorphNetwork

FORMAT = "kmn-weights-3"


class WeightsError(ValueError):
    """A weight file is missing, corrupt, or belongs to another model."""


@dataclass(frozen=True)
class Weights:
    """The networks of a weight file.

    Attributes
    ----------
    network
        The trained network.
    baseline
        The paper's network before its data were augmented; ``None`` for our design.
    metadata
        ``model``, ``parameters``, ``limits``, ``bodies``, ``camera``, ``network`` (the name of its
        design), ``design`` (what that design describes itself by), ``training`` (settings, seed),
        ``errors`` (measured after training) and ``format``.
    """

    network: MorphNetwork
    baseline: MorphNetwork | None
    metadata: dict[str, Any]


def save(path: Path, weights: Weights) -> None:
    """Write a weight file; raise ``OSError`` where that fails, with no part of it left."""
    networks = {"network": weights.network, "baseline": weights.baseline}
    tensors = {
        f"{role}.{name}": tensor.contiguous()
        for role, network in networks.items()
        if network is not None
        for name, tensor in network.state_dict().items()
    }
    known = {
        **weights.metadata,
        "network": weights.network.name,
        "design": weights.network.describe(),
        "format": FORMAT,
    }
    text = {key: json.dumps(value) for key, value in known.items()}
    try:
        with replacing(path) as new:
            save_file(tensors, str(new), text)
    except SafetensorError as error:
        raise OSError(f"cannot write {path}: {error}") from error


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

    def network(role: str) -> MorphNetwork:
        built = _build(path.name, model, metadata)
        start = f"{role}."
        _fill(path.name, built, {
            key.removeprefix(start): tensor
            for key, tensor in tensors.items() if key.startswith(start)
        })  # fmt: skip
        return built

    has_baseline = any(key.startswith("baseline.") for key in tensors)
    return Weights(network("network"), network("baseline") if has_baseline else None, metadata)


def describe(model: KinematicModel) -> dict[str, Any]:
    """Return what a weight file must agree on with its model: parameters, bodies and camera."""
    camera = model.camera
    return {
        "model": model.name,
        "parameters": [parameter.name for parameter in model.parameters],
        "limits": model.limits.tolist(),
        "bodies": {
            body.name: [
                linear.tolist()
                for part in (body.centre, body.size)
                for linear in (part.constant, part.slope)
            ]
            for body in model.bodies
        },
        "camera": {
            **{key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")},
            "pose": camera.pose.round(9).tolist(),
        },
    }


def _check(name: str, metadata: Mapping[str, Any], model: KinematicModel) -> None:
    found = metadata.get("format")
    if found != FORMAT:
        is_ours = str(found).startswith(FORMAT.rstrip("0123456789"))
        what = "of another version: train it anew" if is_ours else "no weight file of ours"
        raise WeightsError(f"{name} is {what} (format {found}, not {FORMAT})")
    for key, expected in describe(model).items():
        if metadata.get(key) != expected:
            raise WeightsError(
                f"{name} was trained for another model: its {key} is {metadata.get(key)}, "
                f"that of model '{model.name}' is {expected}"
            )


def _build(name: str, model: KinematicModel, metadata: Mapping[str, Any]) -> MorphNetwork:
    """Return the untrained network that a file describes."""
    design = metadata.get("network")
    if not isinstance(design, str) or design not in DESIGNS:
        known = ", ".join(DESIGNS)
        raise WeightsError(f"{name} holds a network of design {design!r} (known: {known})")
    try:
        return DESIGNS[design].described(model, Section(metadata.get("design"), f"{name}: design"))
    except ConfigurationError as error:
        raise WeightsError(f"{name} describes no network for '{model.name}': {error}") from error


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
