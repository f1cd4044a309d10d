"""The networks that are compared: the paper's and ours, of one model."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.hashes import short_hash
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.network import weights
from kmn_perception.network.weights import Weights, WeightsError


class Networks(NamedTuple):
    """The weights of a model, or why there are none.

    Attributes
    ----------
    paper, own
        Of the paper's network (with its baseline), and of ours.
    hashes
        Start of the sha256 sum of each file that was read, by ``paper`` and ``own``.
    """

    paper: Weights | WeightsError
    own: Weights | WeightsError
    hashes: dict[str, str]


def load_networks(
    model: KinematicModel, own: str | None = None, paper: str | None = None
) -> Networks:
    """Read weights: files that are given, else those of the model, if there are any.

    Raises
    ------
    WeightsError
        If a given file is missing, corrupt, or belongs to another model.
    """
    hashes: dict[str, str] = {}

    def load(role: str, given: str | None, shipped: str | Path) -> Weights | WeightsError:
        try:
            loaded = weights.load(given or shipped, model)
        except WeightsError as error:
            if given:
                raise
            return error
        file = resources.find("weights", given or shipped, ".safetensors")
        hashes[role] = short_hash(file)
        return loaded

    return Networks(
        load("paper", paper, f"paper/{model.name}"),
        load("own", own, weights.default_file(model)),
        hashes,
    )
