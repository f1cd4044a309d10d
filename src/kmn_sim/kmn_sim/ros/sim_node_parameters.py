"""The ROS parameters of sim_node; their defaults are in ``config/nodes/sim_node.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterDescriptor

from kmn_perception.model.camera import Camera
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.ros.parameters import (
    ParameterError,
    anything,
    check_choice,
    choice,
    real,
    whole,
)
from kmn_sim.sensors.depth_camera import MOUNTS
from kmn_sim.sensors.kinect import NOISES
from kmn_sim.sensors.recording import FORMATS
from kmn_sim.world.renderer import RENDERERS
from kmn_sim.world.scenario import DIRECTIONS, Scenario

PLACEMENTS = ("prototype", "random", "given")
ENCODINGS = ("32FC1", "16UC1")
OPTIONS = ("stem", "frame", "wall", "floor", "table")
WORLD = ("model", "placement", "values", "seed", "direction", *OPTIONS)
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
        """Check the parameters' values, by name, one by one and together.

        Raises
        ------
        ParameterError, ScenarioError, ConfigurationError, FileNotFoundError
            If one is wrong.
        """
        for name, choices in CHOICES.items():
            check_choice(name, values[name], choices)
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
    return Scenario(model, placed, values["direction"], **options)


CHOICES = {
    "placement": PLACEMENTS,
    "direction": DIRECTIONS,
    "camera_mount": MOUNTS,
    "depth_encoding": ENCODINGS,
    "noise": NOISES,
    "renderer": RENDERERS,
}
DESCRIPTORS: dict[str, ParameterDescriptor] = {
    "model": anything("Kinematic model: a shipped name or the path of a YAML file."),
    "placement": choice("Where the object's morphing parameters come from.", PLACEMENTS),
    "values": anything("Given theta and gamma [m, rad, 1].", "as many as the model has"),
    "seed": whole("Seed of the random placement and of the noise.", 0, 2**31 - 1),
    "direction": choice("How the door opens, seen from the robot.", DIRECTIONS),
    "stem": anything("A stem joins the door's lever and panel."),
    "frame": anything("The door has a frame."),
    "wall": anything("The door is in a wall."),
    "floor": anything("There is a floor."),
    "table": anything("A box stands on a table; z = 0 is the table's top."),
    "camera": anything(
        "Camera: a shipped name or the path of a YAML file; empty: the model's own."
    ),
    "camera_mount": choice("What the camera's pose is relative to.", MOUNTS),
    "camera_rate": real("Frames a simulated second.", 0.1, 60.0),
    "depth_encoding": choice("Encoding of depth/image: metres or millimetres.", ENCODINGS),
    "noise": choice("What the sensor adds to the exact depth.", NOISES),
    "renderer": choice("Renderer; where egl does not start it is software.", RENDERERS, True),
    "world_frame": anything("Frame of the ground truth."),
    "camera_frame": anything("Frame of depth images and clouds."),
    "joint_state_rate": real("joint_states and door_state a simulated second.", 1.0, 240.0),
    "interpolate_from_desired_state": anything(
        "A new trajectory starts from the desired state, else from the measured one.",
        read_only=True,
    ),
    "real_time_factor": real(
        "Simulated seconds in one second at most; 0: as fast as possible.", 0.0, 1000.0
    ),
    "publish_clock": anything(
        "Stamps are simulated time, and /clock is published; else stamps are the system's time.",
        read_only=True,
    ),
    "gui": anything("Show a window of the physics engine.", read_only=True),
    "record": anything("File to write a film to until it changes, .gif or .mp4; empty: none."),
    "record_rate": real("Pictures of the film a simulated second.", 1.0, 60.0),
}
