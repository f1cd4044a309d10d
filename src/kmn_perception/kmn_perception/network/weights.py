"""Weight files of morphing networks: the networks and all that is known about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weight_file
from kmn_perception.network.designs import DESIGNS
from kmn_perception.network.morph_network import MorphNetwork
from kmn_perception.network.weight_file import FORMAT, WeightsError

__all__ = ["FORMAT", "Weights", "WeightsError", "describe", "load", "save"]


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


def default_file(model: KinematicModel) -> str | Path:
    """Return the weights of a model where none are told: beside its file, or the shipped ones."""
    beside = model.file.with_suffix(".safetensors")
    return beside if beside.is_file() else model.name


def save(path: Path, weights: Weights) -> None:
    """Write a weight file; raise ``OSError`` where that fails, with no part of it left."""
    networks = {"network": weights.network, "baseline": weights.baseline}
    tensors = {
        f"{role}.{name}": tensor
        for role, network in networks.items()
        if network is not None
        for name, tensor in network.state_dict().items()
    }
    design = {"network": weights.network.name, "design": weights.network.describe()}
    weight_file.write(path, tensors, {**weights.metadata, **design})


def load(name_or_path: str | Path, model: KinematicModel) -> Weights:
    """Read a weight file for a model: a shipped name, or the user's own file.

    Raises
    ------
    WeightsError
        If it is missing, corrupt, or was trained for another model.
    """
    name, metadata, tensors = weight_file.read(name_or_path)
    _check(name, metadata, model)

    def network(role: str) -> MorphNetwork:
        built = _build(name, model, metadata)
        start = f"{role}."
        weight_file.fill(name, built, {
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
            + ([body.axis] if body.is_cylinder else [])
            for body in model.bodies
        },
        "camera": {
            **{key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")},
            "pose": camera.pose.round(9).tolist(),
        },
    }


def _check(name: str, metadata: Mapping[str, Any], model: KinematicModel) -> None:
    design = metadata.get("network")
    if not isinstance(design, str) or design not in DESIGNS:
        known = ", ".join(DESIGNS)
        raise WeightsError(f"{name} holds a network of design {design!r} (known: {known})")
    for key, expected in describe(model).items():
        if metadata.get(key) != expected:
            raise WeightsError(
                f"{name} was trained for another model: its {key} is {metadata.get(key)}, "
                f"that of model '{model.name}' is {expected}"
            )


def _build(name: str, model: KinematicModel, metadata: Mapping[str, Any]) -> MorphNetwork:
    """Return the untrained network that a file describes."""
    try:
        return DESIGNS[metadata["network"]].described(
            model, Section(metadata.get("design"), f"{name}: design")
        )
    except ConfigurationError as error:
        raise WeightsError(f"{name} describes no network for '{model.name}': {error}") from error
