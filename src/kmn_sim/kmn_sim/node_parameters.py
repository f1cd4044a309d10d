"""The ROS parameters of sim_node; their defaults are in ``config/nodes/sim_node.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from kmn_perception import resources
from kmn_perception.camera import Camera
from kmn_perception.configuration import Section
from kmn_perception.kinematic_model import KinematicModel
from kmn_sim.depth_camera import MOUNTS
from kmn_sim.kinect import NOISES
from kmn_sim.recorder import FORMATS
from kmn_sim.renderer import RENDERERS
from kmn_sim.scenario import DIRECTIONS, Scenario

PLACEMENTS = ("prototype", "random", "given")
ENCODINGS = ("32FC1", "16UC1")
OPTIONS = ("stem", "frame", "wall", "floor", "table")
WORLD = ("model", "placement", "values", "seed", "direction", *OPTIONS)
SENSOR = ("model", "camera", "camera_mount", "noise", "seed")
FILM = ("record", "record_rate")


class ParameterError(ValueError):
    """Parameters that are wrong; the text names them and what was expected."""


@dataclass(frozen=True, eq=False)
class NodeSettings:
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
    def check(cls, values: Mapping[str, Any]) -> NodeSettings:
        """Check the parameters' values, by name, one by one and together.

        Raises
        ------
        ParameterError, ScenarioError, ConfigurationError, FileNotFoundError
            If one is wrong.
        """
        for name, choices in CHOICES.items():
            if values[name] not in choices:
                raise ParameterError(
                    f"'{name}' must be one of {', '.join(choices)}, found '{values[name]}'"
                )
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

    def differs(self, other: NodeSettings, names: tuple[str, ...]) -> bool:
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


def declare_parameters(node: Node) -> None:
    """Declare all parameters with the defaults of the configuration file.

    Raises
    ------
    ParameterException
        If the user's value of a parameter is of another type or out of its range.
    """
    file = Section.load(resources.find("config/nodes", "sim_node"))
    defaults = file.section("/**").section("ros__parameters")
    defaults.allow(DESCRIPTORS)
    node.declare_parameters(
        "", [(name, defaults.values[name], DESCRIPTORS[name]) for name in DESCRIPTORS]
    )


def read_parameters(node: Node) -> dict[str, Any]:
    """Return the parameters' present values by name."""
    values = {name: node.get_parameter(name).value for name in DESCRIPTORS}
    return {**values, "values": list(values["values"])}


def _any(description: str, constraints: str = "", read_only: bool = False) -> ParameterDescriptor:
    return ParameterDescriptor(
        description=description, additional_constraints=constraints, read_only=read_only
    )


def _choice(name: str, description: str, read_only: bool = False) -> ParameterDescriptor:
    return _any(description, " or ".join(CHOICES[name]), read_only)


def _real(description: str, low: float, high: float, read_only: bool = False) -> Any:
    limits = FloatingPointRange(from_value=low, to_value=high)
    return ParameterDescriptor(
        description=description, floating_point_range=[limits], read_only=read_only
    )


def _whole(description: str, low: int, high: int) -> ParameterDescriptor:
    limits = IntegerRange(from_value=low, to_value=high, step=1)
    return ParameterDescriptor(description=description, integer_range=[limits])


CHOICES = {
    "placement": PLACEMENTS,
    "direction": DIRECTIONS,
    "camera_mount": MOUNTS,
    "depth_encoding": ENCODINGS,
    "noise": NOISES,
    "renderer": RENDERERS,
}
DESCRIPTORS: dict[str, ParameterDescriptor] = {
    "model": _any("Kinematic model: a shipped name or the path of a YAML file."),
    "placement": _choice("placement", "Where the object's morphing parameters come from."),
    "values": _any("Given theta and gamma [m, rad, 1].", "as many as the model has"),
    "seed": _whole("Seed of the random placement and of the noise.", 0, 2**31 - 1),
    "direction": _choice("direction", "How the door opens, seen from the robot."),
    "stem": _any("A stem joins the door's lever and panel."),
    "frame": _any("The door has a frame."),
    "wall": _any("The door is in a wall."),
    "floor": _any("There is a floor."),
    "table": _any("A box stands on a table; z = 0 is the table's top."),
    "camera": _any("Camera: a shipped name or the path of a YAML file; empty: the model's own."),
    "camera_mount": _choice("camera_mount", "What the camera's pose is relative to."),
    "camera_rate": _real("Frames a simulated second.", 0.1, 60.0),
    "depth_encoding": _choice("depth_encoding", "Encoding of depth/image: metres or millimetres."),
    "noise": _choice("noise", "What the sensor adds to the exact depth."),
    "renderer": _choice("renderer", "Renderer; where egl does not start it is software.", True),
    "world_frame": _any("Frame of the ground truth."),
    "camera_frame": _any("Frame of depth images and clouds."),
    "joint_state_rate": _real("joint_states and door_state a simulated second.", 1.0, 240.0),
    "interpolate_from_desired_state": _any(
        "A new trajectory starts from the desired state, else from the measured one.",
        read_only=True,
    ),
    "real_time_factor": _real(
        "Simulated seconds in one second at most; 0: as fast as possible.", 0.0, 1000.0
    ),
    "publish_clock": _any(
        "Stamps are simulated time, and /clock is published; else stamps are the system's time.",
        read_only=True,
    ),
    "gui": _any("Show a window of the physics engine.", read_only=True),
    "record": _any("File to write a film to until it changes, .gif or .mp4; empty: none."),
    "record_rate": _real("Pictures of the film a simulated second.", 1.0, 60.0),
}
