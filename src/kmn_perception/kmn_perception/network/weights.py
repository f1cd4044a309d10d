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
from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network.cascade import Cascade, CascadeSettings
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.network.paper_network import PaperNetwork

FORMAT = "kmn-weights-2"


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
        ``model``, ``parameters``, ``limits``, ``bodies``, ``camera``, ``design`` of the network,
        ``training`` (settings, seed), ``errors`` (measured after training) and ``format``.
    """

    network: MorphNetwork
    baseline: MorphNetwork | None
    metadata: dict[str, Any]


def save(path: str | Path, weights: Weights) -> None:
    """Write a weight file."""
    networks = {"network": weights.network, "baseline": weights.baseline}
    tensors = {
        f"{role}.{name}": tensor.contiguous()
        for role, network in networks.items()
        if network is not None
        for name, tensor in network.state_dict().items()
    }
    known = {**weights.metadata, "design": weights.network.describe(), "format": FORMAT}
    save_file(tensors, str(path), {key: json.dumps(value) for key, value in known.items()})


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
        built = _build(path.name, model, metadata["design"])
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
    if metadata.get("format") != FORMAT:
        found = metadata.get("format")
        raise WeightsError(f"{name} is not a weight file of ours: format {found}, not {FORMAT}")
    for key, expected in describe(model).items():
        if metadata.get(key) != expected:
            raise WeightsError(
                f"{name} was trained for another model: its {key} is {metadata.get(key)}, "
                f"that of model '{model.name}' is {expected}"
            )


def _build(name: str, model: KinematicModel, design: Mapping[str, Any]) -> MorphNetwork:
    """Return an untrained network of a design, see ``MorphNetwork.describe``."""
    if "cascade" in design:
        try:
            settings = CascadeSettings.read(Section(design["cascade"], f"{name}: design"))
        except ConfigurationError as error:
            raise WeightsError(f"{name} describes no network of ours: {error}") from error
        return Cascade(model, settings, design["stages"])
    if design["input"] != vars(model.input):
        raise WeightsError(
            f"{name} was trained for another model: its input is {design['input']}, "
            f"that of model '{model.name}' is {vars(model.input)}"
        )
    return PaperNetwork(model, design["channels"])


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
