"""The ROS parameters of the viewer, which ``config/nodes/viewer_parameters.yaml`` states."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from kmn_perception.configuration.node_parameters import pick
from kmn_perception.model.kinematic_model import KinematicModel

Point = tuple[float, float, float]


@dataclass(frozen=True)
class PageSettings:
    """Where the page is served, and how it begins.

    Attributes
    ----------
    host, port
        Address to listen at.
    server_names
        By which browsers may call the server, separated by commas.
    buttons
        Whether the page may move the robot.
    eye, look_at
        From where the scene is seen first, and what, metres.
    morphing_place
        Where prototype and morphed model stand, metres.
    """

    host: str
    port: int
    server_names: str
    buttons: bool
    eye: Point
    look_at: Point
    morphing_place: Point


@dataclass(frozen=True)
class DrawingSettings:
    """How much is drawn, and how often.

    Attributes
    ----------
    rate, camera_rate
        Of robot and objects, and of cloud and picture, Hz.
    max_points, point_size
        Of the cloud; metres.
    max_range
        Depths beyond it are not measurements, metres.
    deviations, min_extent
        Standard deviations to which uncertain extents are drawn, from how many metres on.
    """

    rate: float
    camera_rate: float
    max_points: int
    point_size: float
    max_range: float
    deviations: float
    min_extent: float


@dataclass(frozen=True, eq=False)
class ViewerSettings:
    """All parameters of the viewer, checked.

    Attributes
    ----------
    models
        Kinematic models by name; of others, shipped ones are found when they are told of.
    target
        Position to which ``open`` moves the first model's joint; 0: that of its file.
    world_frame, base_frame
        In which all is drawn, and which of the robot a plan places.
    depth_image_transport, image_transport
        How images come.
    niceness
        Of the process.
    """

    models: dict[str, KinematicModel]
    target: float
    world_frame: str
    base_frame: str
    depth_image_transport: str
    image_transport: str
    niceness: int
    page: PageSettings
    drawing: DrawingSettings

    @classmethod
    def check(cls, values: Mapping[str, Any]) -> ViewerSettings:
        """Check the values of the parameters, by name, together; each one is valid by itself.

        Raises
        ------
        ConfigurationError, FileNotFoundError
            If a model cannot be loaded.
        """
        models = [KinematicModel.load(name.strip()) for name in values["model"].split(",")]
        return cls(
            models={model.name: model for model in models},
            target=values["target"],
            world_frame=values["world_frame"],
            base_frame=values["base_frame"],
            depth_image_transport=values["depth_image_transport"],
            image_transport=values["image_transport"],
            niceness=values["niceness"],
            page=pick(PageSettings, values),
            drawing=pick(DrawingSettings, values),
        )

    @property
    def model(self) -> KinematicModel:
        """The first one: what is opened, and morphed at first."""
        return next(iter(self.models.values()))
