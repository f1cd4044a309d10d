"""What is perceived: which objects hold, which are refused and why, how uncertain they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import viser
from numpy.typing import NDArray

from kmn_msgs.msg import MorphingParameters
from kmn_perception.estimate import Status, status_name
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.room_model import HINGE, RoomModel, has_surroundings
from kmn_perception.ros.messages import MessageError
from kmn_perception.viewer.controls import write
from kmn_perception.viewer.drawing import Drawing, colour, plain
from kmn_perception.viewer.shapes import Axes, Cubes, corners, uncertain_shapes
from kmn_perception.viewer.viewer_parameters import DrawingSettings
from kmn_perception.visualization.overlay import ACCEPTED, REFERENCE, REFUSED

HOLDS = (Status.OK, Status.HANDLE_NOT_SEEN)
SOLID, FAINT, UNCERTAIN = 0.55, 0.2, 0.12  # opacities
NO_AXES = np.empty(0, dtype=np.int64)


class Models:
    """Kinematic models by the names that messages tell, loaded when they are needed."""

    def __init__(self, known: dict[str, KinematicModel]) -> None:
        self._models = dict(known)
        self._rooms: dict[str, RoomModel] = {}

    def load(self, name: str) -> KinematicModel:
        """Return a model; raises ``FileNotFoundError`` or ``ConfigurationError`` without one."""
        if name not in self._models:
            self._models[name] = KinematicModel.load(name)
        return self._models[name]

    def bodies(self, message: MorphingParameters) -> Callable[[NDArray[np.float64]], Cubes]:
        """Return what makes the bodies (B, 4, 4) of parameters (n + m,), else as in a message."""
        model = self.load(message.model)
        positions = dict(zip(message.joint_names, message.joint_positions, strict=False))
        if not has_surroundings(model.file):
            return partial(model.moved_cubes, positions=positions)
        if message.model not in self._rooms:
            self._rooms[message.model] = RoomModel.load(model.file)
        room = self._rooms[message.model]
        if message.alternative not in ("", *room.handles):
            raise MessageError("alternative", f"there is no handle '{message.alternative}'")
        return partial(
            room.door_bodies,
            opening=positions.get(HINGE, 0.0),
            handle=message.alternative,
            side="left" if message.mirrored else "right",
        )


class Perceived(NamedTuple):
    """An object of the newest frame.

    Attributes
    ----------
    message
        That told it.
    values
        (n + m,) parameters.
    cubes
        (B, 4, 4) its bodies in the world; B = 0 where there is no estimate.
    axes
        (B,) of those that are cylinders, see `KinematicModel.cylinder_axes`.
    uncertain
        How it may look otherwise, see `uncertain_shapes`.
    """

    message: MorphingParameters
    values: NDArray[np.float64]
    cubes: Cubes
    axes: Axes
    uncertain: list[Cubes]

    @property
    def holds(self) -> bool:
        """Whether the drawn bodies are what is there."""
        return self.message.status in HOLDS

    @property
    def text(self) -> str:
        """What is written at it."""
        message = self.message
        name = f"{message.model} {message.id}" if message.id else message.model
        if message.status == Status.OK:
            return name
        return f"{name}: {status_name(message.status)}, {message.reason}"


def read_object(
    message: MorphingParameters,
    models: Models,
    pose: NDArray[np.float64],
    settings: DrawingSettings,
) -> Perceived:
    """Read a message.

    Parameters
    ----------
    pose
        (4, 4) of the message's frame in the world.

    Raises
    ------
    MessageError, FileNotFoundError, ConfigurationError
        If the message is not one of its model, or there is no such model.
    """
    values = np.array([*message.theta, *message.gamma], dtype=np.float64)
    if not np.isfinite(values).all() or not len(values):
        return Perceived(message, values, np.empty((0, 4, 4)), NO_AXES, [])
    model = models.load(message.model)
    names = [parameter.name for parameter in model.parameters]
    if [*message.theta_names, *message.gamma_names] != names or len(values) != len(names):
        raise MessageError(
            "names",
            f"'{message.model}' has the parameters {', '.join(names)}, found "
            f"{', '.join([*message.theta_names, *message.gamma_names])}",
        )
    bodies = models.bodies(message)
    covariance, uncertain = np.array(message.covariance, dtype=np.float64), []
    if message.status in HOLDS and covariance.size == values.size**2:
        covariance = covariance.reshape(values.size, values.size)
        uncertain = uncertain_shapes(
            bodies, values, covariance, model.limits, settings.deviations, settings.min_extent
        )
    cubes, axes = pose @ bodies(values), model.axes_among(len(bodies(values)))
    return Perceived(message, values, cubes, axes, [pose @ each for each in uncertain])


class ObjectsView:
    """Draws them into the scene, and tells them in a text.

    Parameters
    ----------
    text
        Where they are told.
    """

    def __init__(self, scene: viser.SceneApi, text: viser.GuiMarkdownHandle) -> None:
        self._drawing, self._text = Drawing(scene, "/objects"), text

    def draw(self, objects: list[Perceived]) -> None:
        """Draw the objects of a frame in the place of those before."""
        names = set()
        for number, found in enumerate(objects):
            if not len(found.cubes):
                continue
            paint = colour(ACCEPTED if found.holds else REFUSED)
            name, label = f"object {number}", f"label {number}"
            opacity = SOLID if found.holds else FAINT
            self._drawing.bodies(name, found.cubes, found.axes, paint, opacity)
            everything = corners(found.cubes).reshape(-1, 3)
            top = np.array([*everything[:, :2].mean(axis=0), everything[:, 2].max() + 0.1])
            self._drawing.label(label, found.text, top)
            names |= {name, label}
            for direction, cubes in enumerate(found.uncertain):
                name = f"uncertain {number} {direction}"
                paint = colour(REFERENCE)
                self._drawing.bodies(name, cubes, found.axes, paint, UNCERTAIN, 0.003)
                names.add(name)
        self._drawing.keep(names)
        write(self._text, "\n\n".join(map(_told, objects)) or "nothing was told yet")


def _told(found: Perceived) -> str:
    """Return an object in Markdown: its status and parameters with their standard deviations."""
    message = found.message
    head = f"**{plain(found.text)}**"
    if not len(found.cubes):
        return head
    count = len(found.values)
    deviations = np.full(count, math.nan)
    if len(message.covariance) == count**2:
        variances = np.array(message.covariance).reshape(count, count).diagonal()
        deviations = np.sqrt(np.maximum(variances, 0.0))
    parts = (
        ((*message.theta_names, *message.gamma_names), found.values, deviations),
        (message.joint_names, message.joint_positions, message.joint_deviations),
        (message.surroundings_names, message.surroundings, message.surroundings_deviations),
    )
    rows = [
        f"| {plain(name)} | {value:.4f} | {deviation:.4f} |"
        for part in parts
        for name, value, deviation in zip(*part, strict=False)
    ]
    return "\n".join([head, "", "| parameter | value | ± |", "| --- | --- | --- |", *rows])
