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
from kmn_sim.robot.description import BASE_FOOTPRINT
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.robot.urdf_export import BASE_LINK
from kmn_sim.sensors.recording import FORMATS
from kmn_sim.world.row import in_row
from kmn_sim.world.scenario import Scenario, in_room

ODOM, CAMERA_LINK = "odom", "camera_link"  # frames (REP-105, REP-103)
OPTIONS = ("stem", "frame", "wall", "floor", "table")
PLACE = ("model", "placement", "values", "seed", "direction", "beside_gap")
WORLD = (*PLACE, "room", "recess", *OPTIONS)
FAULTS = ("depth_scale", "mount_offset", "mount_tilt")
SENSOR = ("model", "camera", "camera_mount", "noise", "seed", *FAULTS)
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
        _check_frames(values)
        model = KinematicModel.load(values["model"])
        return cls(dict(values), _scenario(model, values), _camera(model, values))

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    def differs(self, other: SimNodeSettings, names: tuple[str, ...]) -> bool:
        """Tell whether one of some parameters has another value."""
        return any(self[name] != other[name] for name in names)


def _check_frames(values: Mapping[str, Any]) -> None:
    """Raise `ParameterError` if two frames would have the same name."""
    others = (ODOM, BASE_FOOTPRINT, BASE_LINK, CAMERA_LINK)
    for name in ("world_frame", "camera_frame"):
        if values[name] in others or values["world_frame"] == values["camera_frame"]:
            raise ParameterError(
                f"'{name}' must differ from the other frames ({', '.join(others)}), "
                f"found '{values[name]}'"
            )


def _scenario(model: KinematicModel, values: Mapping[str, Any]) -> Scenario:
    """Return the scenario of some parameters."""
    generator = np.random.default_rng(values["seed"])
    if values["placement"] == "random":
        placed = model.sample(generator, 1)[0]
    elif values["placement"] == "given":
        placed = np.array(values["values"], dtype=np.float64)
    else:
        placed = model.prototype
    options = {name: values[name] for name in OPTIONS}
    scenario = Scenario(model, placed, values["direction"], **options)
    names = filter(None, map(str.strip, values["beside"].split(",")))
    beside = [KinematicModel.load(name) for name in names]
    drawn = None if values["placement"] == "prototype" else generator
    scenario = in_row(scenario, beside, values["beside_gap"], drawn)
    if not values["room"]:
        return scenario
    recess = values["recess"] if values["recess"] >= 0.0 else None
    return in_room(scenario, values["seed"], recess, values["robot"])


def _camera(model: KinematicModel, values: Mapping[str, Any]) -> Camera:
    """Return the camera that is named, else the robot's own, else that of the model."""
    if values["camera"]:
        return Camera.load(values["camera"])
    on_robot = values["camera_mount"] == "base"
    return Camera.load(RobotSettings.load(values["robot"]).camera) if on_robot else model.camera
