"""Objects beside the one that is opened: what perception tells of them is to be kept clear of."""

from __future__ import annotations

import re
import threading

import numpy as np
from numpy.typing import NDArray

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.door_observation import DoorObservation, check_values, when_closed
from kmn_skill.execution.errors import DoorError
from kmn_skill.execution.grasp_quantities import swung
from kmn_skill.planning.surroundings import Obstacle

MAX_OBJECTS = 100  # that are kept, the newest ones
APART = 0.2  # metres; middles of two objects of one model are further apart than those of one
BEYOND = 0.1  # metres or radians, by which a joint may seem to be beyond its limits
CORNERS = np.stack(np.meshgrid(*[(-0.5, 0.5)] * 3), axis=-1).reshape(-1, 3)  # of the unit cube
SHIPPED = re.compile(r"\w+")  # name of a model; a path is nothing to be read at a message's word


class UnknownModelError(ValueError):
    """An object is of a model of which there is no file."""


class OtherObjects:
    """Keeps the newest observation of each object, that which is opened included; thread-safe.

    Parameters
    ----------
    model
        Kinematic model of what is opened; those of others are the shipped ones of their names.
    frame
        Frame that the objects must be given in; those in others are not known.
    limit_margin
        Part of its range by which a parameter may exceed its limits.
    """

    def __init__(self, model: KinematicModel, frame: str, limit_margin: float) -> None:
        self._frame, self.limit_margin = frame, limit_margin
        self._models = {model.name: model}
        self._lock = threading.Lock()
        self._kept: dict[tuple[str, int], DoorObservation] = {}
        self._since = -np.inf  # seconds; what was seen before was another world

    def add(self, observation: DoorObservation) -> None:
        """Keep an observation of an object, if it is usable.

        Raises
        ------
        UnknownModelError
            If nothing is known of its model.
        """
        if observation.problem:
            return
        model = self._model(observation.model)
        try:
            check_values(model, observation, self._frame, self.limit_margin)
        except DoorError:
            return  # told by whoever looks for the door
        with self._lock:
            if observation.time < self._since:
                return
            key = observation.model, observation.number
            self._kept.pop(key, None)
            self._kept[key] = observation
            while len(self._kept) > MAX_OBJECTS:
                del self._kept[next(iter(self._kept))]

    def forget(self, now: float) -> None:
        """Forget all objects from before a time (s), as of another world."""
        with self._lock:
            self._kept.clear()
            self._since = now

    def forget_older(self, now: float, max_age: float) -> None:
        """Forget the objects that were last seen longer ago than ``max_age`` (s)."""
        with self._lock:
            self._kept = {k: o for k, o in self._kept.items() if abs(now - o.time) <= max_age}

    def around(self, model: KinematicModel, values: NDArray[np.float64]) -> tuple[Obstacle, ...]:
        """Return the bodies of the others, in the frame of an object of parameters (n + m,).

        One whose middle is within that object is the object itself, under whatever name; so is one
        of its own model that stands where its joint can have moved it, as perception may tell an
        open door as a closed one that stands askew.
        """
        theta, gamma = model.split(values)
        back = model.transformation.inverse(theta)
        low, high = _box(back @ model.unit_cubes(theta, gamma))
        with self._lock:
            kept = dict(self._kept)
        found = list[Obstacle]()
        for (name, number), each in kept.items():
            other = self._models[name]
            middle = _middle(back @ other.unit_cubes(*other.split(each.values)))
            if ((low < middle) & (middle < high)).all():
                continue
            if name == model.name and _is_moved(model, values, each.values):
                continue
            cubes = back @ other.moved_cubes(each.values, _positions(other, each))
            for body, cube in zip(other.bodies, cubes, strict=True):
                size = np.linalg.norm(cube[:3, :3], axis=0)
                turn = cube[:3, :3] / size
                found.append(Obstacle(f"{name}_{number}/{body.name}", cube[:3, 3], size, turn))
        return tuple(found)

    def _model(self, name: str) -> KinematicModel:
        """Return the kinematic model of a name."""
        if name not in self._models:
            if not SHIPPED.fullmatch(name):
                raise UnknownModelError(f"'{name}' is no name of a shipped model")
            try:
                self._models[name] = KinematicModel.load(name)
            except (OSError, ConfigurationError) as error:
                raise UnknownModelError(str(error)) from error
        return self._models[name]


def _is_moved(
    model: KinematicModel, values: NDArray[np.float64], seen: NDArray[np.float64]
) -> bool:
    """Tell whether what is ``seen`` (n + m,) is that object (n + m,), moved by its joint."""
    moved, (low, high) = swung(model, values, seen), model.actions[0].joint.limits
    closed = when_closed(model, seen, moved)
    here, there = (_middle(model.unit_cubes(*model.split(each))) for each in (values, closed))
    is_near = np.linalg.norm((there - here)[:2]) < APART
    return bool(is_near and low - BEYOND < moved < high + BEYOND)


def _box(cubes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the lowest and the highest corner (2, 3) of maps (B, 4, 4) of the unit cube."""
    corners = cubes[:, None, :3, 3] + CORNERS @ cubes[:, :3, :3].swapaxes(1, 2)
    return np.array([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])


def _middle(cubes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the middle (3,) of the box around maps (B, 4, 4) of the unit cube."""
    middle: NDArray[np.float64] = np.mean(_box(cubes), axis=0)
    return middle


def _positions(model: KinematicModel, observation: DoorObservation) -> dict[str, float]:
    """Return where the joints of an object are (m or rad), as far as that is told."""
    return {
        joint.name: float(np.clip(observation.joints[joint.name], *joint.limits))
        for joint in model.joints
        if joint.moves and np.isfinite(observation.joints.get(joint.name, np.nan))
    }
