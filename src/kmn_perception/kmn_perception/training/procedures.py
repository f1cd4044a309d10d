"""The procedures that train networks, by name, and their settings."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.configuration.settings import read_settings
from kmn_perception.model.camera import Camera
from kmn_perception.network.designs import DESIGNS
from kmn_perception.training.algorithm2 import Algorithm2
from kmn_perception.training.settings import TrainingSettings
from kmn_perception.training.stagewise import StagewiseTraining
from kmn_perception.training.training import Training

PROCEDURES: dict[str, type[Training]] = {"algorithm2": Algorithm2, "stagewise": StagewiseTraining}


def procedure_of(network: str) -> type[Training]:
    """Return the procedure that trains a design."""
    return PROCEDURES[DESIGNS[network].procedure]


def load_training_settings(
    name_or_path: str | Path, changes: Mapping[str, Any] | None = None
) -> TrainingSettings:
    """Read ``config/training/NAME.yaml`` or the user's own file.

    Parameters
    ----------
    changes
        Values in place of those of the file.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ConfigurationError
        If a key is missing, unknown or of a wrong value.
    """
    file = Section.load(resources.find("config/training", name_or_path))
    section = Section({**file.values, **(changes or {})}, file.place)
    network = section.text("network", tuple(DESIGNS))
    settings = read_settings(procedure_of(network).settings_type, section)
    if settings.sensor is not None:
        try:
            Camera.load(settings.sensor.camera)
        except FileNotFoundError as error:
            raise section.error(f"sensor: camera: {error}") from error
    return settings
