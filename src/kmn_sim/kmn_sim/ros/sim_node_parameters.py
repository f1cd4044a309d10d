"""The ROS parameters of sim_node, which ``config/nodes/sim_node_parameters.yaml`` states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from kmn_perception.configuration.node_parameters import ParameterError
from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_sim.sensors.recording import FORMATS
from kmn_sim.world.scenario import Scenario, in_room

OPTIONS = ("stem", "frame", "wall", "floor", "table")
WORLD = ("model", "placement", "values", "seed", "direction", "room", "recess", *OPTIONS)
SENSOR = ("model", "camera", "camera_mount", "noise", "seed")
RECORDING = ("record", "record_rate")


@dataclass(frozen=True, eq=False)
class SimNodeSettings:
    """All parameters of sim_node, checked.

    Attributes
    ----------
    values
        The parameters by name.
    scenario
        What stands in the world.
    camera
        Intrinsics and pose of the depth camera.
    """

    values: Mapping[str, Any]
    scenario: Scenario
    camera: Camera

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> SimNodeSettings:
        """Check the values of the parameters, by name, together; each one is valid by itself.

        Raises
        ------
        ParameterError, ScenarioError, ConfigurationError, FileNotFoundError
            If one is wrong.
        """
        record = values["record"]
        if record and (
            Path(record).suffix not in FORMATS or not Path(record).absolute().parent.is_dir()
        ):
            raise ParameterError(
                f"'record' must be a file {' or '.join(FORMATS)} in a folder that exists, "
                f"found '{record}'"
            )
        model = KinematicModel.load(values["model"])
        camera = Camera.load(values["camera"]) if values["camera"] else model.camera
        return cls(dict(values), _scenario(model, values), camera)

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def differs(self, other: SimNodeSettings, names: tuple[str, ...]) -> bool:
        """Tell whether one of some parameters has another value."""
        return any(self[name] != other[name] for name in names)


def _scenario(model: KinematicModel, values: Mapping[str, Any]) -> Scenario:
    """Return the scenario of some parameters."""
    if values["placement"] == "random":
        placed = model.sample(np.random.default_rng(values["seed"]), 1)[0]
    elif values["placement"] == "given":
        placed = np.array(values["values"], dtype=np.float64)
    else:
        placed = np.zeros(len(model.parameters))
    options = {name: values[name] for name in OPTIONS}
    scenario = Scenario(model, placed, values["direction"], **options)
    if not values["room"]:
        return scenario
    recess = values["recess"] if values["recess"] >= 0.0 else None
    return in_room(scenario, values["seed"], recess)
