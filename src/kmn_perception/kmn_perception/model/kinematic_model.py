"""The kinematic model m(theta, gamma) of an object, read from one YAML file (paper, Sec. II-A)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_perception.model import model_file
from kmn_perception.model.actions import Action, read_actions
from kmn_perception.model.camera import Camera
from kmn_perception.model.parts import (
    NO_AXIS,
    WORLD,
    Body,
    Joint,
    NetworkInput,
    Parameter,
    Stem,
    movers,
)
from kmn_perception.model.transformation import Transformation

OPTIONAL = (
    *("gamma", "joints", "stem", "actions", "start", "symmetry", "input"),
    *("alternatives", "surroundings"),  # of doors in rooms
    "mechanics",  # of simulators
)
_TURNED = (("rotation", "z"), ("scale", "x"), ("scale", "y"))


@dataclass(frozen=True, eq=False)
class KinematicModel:
    """A parametrised object m(theta, gamma) made of cuboids and cylinders.

    Attributes
    ----------
    file
        From which it was read.
    theta, gamma
        Transformation and configuration parameters; all are 0 at the prototype.
    transformation
        T_theta of the transformation parameters.
    stem
        What joins a body to its parent, if there is such a thing.
    actions
        What can be done with it.
    mechanics
        What simulators read of its masses, frictions and latches; as it is in the file.
    camera
        The canonical camera, from which the network sees the world.
    input
        Depth image of the paper's network; ours needs none.
    start
        Where Algorithm 1 starts: at the ``prototype``, or above the cloud's ``centroid``.
    symmetry
        ``none``, or ``quarter_turn``: turned by 90 degrees about z, with the scales along x and y
        swapped, the object is the same.
    """

    name: str
    file: Path
    theta: tuple[Parameter, ...]
    gamma: tuple[Parameter, ...]
    transformation: Transformation
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    stem: Stem | None
    actions: tuple[Action, ...]
    mechanics: Section
    camera: Camera
    input: NetworkInput | None
    start: str
    symmetry: str

    @classmethod
    def load(cls, name_or_path: str | Path) -> KinematicModel:
        """Read ``config/models/NAME.yaml`` or the user's own file.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ConfigurationError
            If a key is missing, unknown or wrong, limits are reversed, or a size is not positive
            everywhere within the limits.
        """
        file = resources.find("config/models", name_or_path)
        section = Section.load(file)
        section.allow(("name", "camera", "theta", "bodies"), OPTIONAL)
        theta = tuple(model_file.read_theta(entry) for entry in section.sections("theta"))
        gamma = tuple(model_file.read_gamma(entry) for entry in section.sections("gamma"))
        names = [parameter.name for parameter in (*theta, *gamma)]
        if not theta or len(set(names)) != len(names):
            raise section.error(f"'theta' must be there and names must differ, found {names}")
        try:
            transformation = Transformation(
                tuple(
                    (entry.text("kind"), entry.text("axis")) for entry in section.sections("theta")
                )
            )
        except ValueError as error:
            raise section.error(f"theta: {error}") from error
        bodies = model_file.read_bodies(section, gamma)
        model_file.check_round(section, bodies, transformation.kinds)
        joints = model_file.read_joints(section, bodies, gamma)
        model = cls(
            name=section.text("name"),
            file=file,
            theta=theta,
            gamma=gamma,
            transformation=transformation,
            bodies=bodies,
            joints=joints,
            stem=model_file.read_stem(section, bodies, joints),
            actions=read_actions(section, bodies, joints, file.parent),
            mechanics=section.section("mechanics"),
            camera=model_file.read_camera(section, file.parent),
            input=model_file.read_input(section),
            start=section.text("start", ("prototype", "centroid"), "prototype"),
            symmetry=section.text("symmetry", ("none", "quarter_turn"), "none"),
        )
        _check_symmetry(section, model)
        return model

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All morphing parameters: theta, then gamma."""
        return (*self.theta, *self.gamma)

    @cached_property
    def states(self) -> tuple[Joint, ...]:
        """The joints whose positions are estimated: those that actions move.

        There are none where they move all bodies: where these are is for theta to tell.
        """
        moved = {action.joint.name for action in self.actions}
        for body in self.bodies:
            if not moved & movers(body.name, self.joints):
                return tuple(joint for joint in self.joints if joint.name in moved)
        return ()

    @property
    def estimated(self) -> tuple[Parameter | Joint, ...]:
        """All that is estimated: theta, gamma, then the joints of which the positions are."""
        return (*self.parameters, *self.states)

    @cached_property
    def limits(self) -> NDArray[np.float64]:
        """(n + m, 2) lower and upper limits of (theta, gamma)."""
        return np.array([parameter.limits for parameter in self.parameters])

    @cached_property
    def prototype(self) -> NDArray[np.float64]:
        """(n + m,) parameters (theta, gamma) of the prototype: all 0."""
        return np.zeros(len(self.parameters))

    @cached_property
    def prototype_cubes(self) -> NDArray[np.float64]:
        """(B, 4, 4) bodies of the prototype, see `unit_cubes`."""
        return self.unit_cubes(*self.split(self.prototype))

    @cached_property
    def cylinder_axes(self) -> NDArray[np.int64]:
        """(B,) the axes of the bodies that are cylinders, `NO_AXIS` of the others."""
        return np.array([body.axis for body in self.bodies])

    def axes_among(self, count: int) -> NDArray[np.int64]:
        """Return `cylinder_axes` (count,) of its bodies and of cuboids that come after them."""
        axes = np.full(count, NO_AXIS)
        axes[: len(self.bodies)] = self.cylinder_axes[:count]
        return axes

    def require_cuboids(self, what: str) -> None:
        """Raise ``ConfigurationError`` if a body is a cylinder, of what takes none."""
        for body in self.bodies:
            if body.is_cylinder:
                raise ConfigurationError(
                    f"{self.name}: {what} takes cuboids only, and '{body.name}' is a cylinder"
                )

    @property
    def depth_image(self) -> NetworkInput:
        """``input``; raise ``ConfigurationError`` where the file has none."""
        if self.input is None:
            raise ConfigurationError(
                f"{self.name}: key 'input' is missing: the paper's network sees a depth image"
            )
        return self.input

    def body(self, name: str) -> Body:
        """Return the body of a name."""
        return next(body for body in self.bodies if body.name == name)

    def joint(self, name: str) -> Joint:
        """Return the joint of a name."""
        return next(joint for joint in self.joints if joint.name == name)

    def doing(self, number: int) -> KinematicModel:
        """Return the same object with one of its actions alone, counted from 0."""
        return replace(self, actions=(self.actions[number],))

    def motions(
        self, gamma: ArrayLike, positions: Mapping[str, float]
    ) -> dict[str, NDArray[np.float64]]:
        """Return the motion (4, 4) of each body in the object frame by positions of joints.

        Parameters
        ----------
        positions
            By the joints' names, m or rad; 0 of those that are not named.
        """
        motions = {name: np.eye(4) for name in (WORLD, *(body.name for body in self.bodies))}
        for joint in self.joints:
            moved = joint.motion(gamma, positions.get(joint.name, 0.0))
            motions[joint.body] = motions[joint.parent] @ moved
        return motions

    def split(self, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Split (theta, gamma) (..., n + m) into theta (..., n) and gamma (..., m)."""
        return values[..., : len(self.theta)], values[..., len(self.theta) :]

    def sample(self, generator: np.random.Generator, count: int) -> NDArray[np.float64]:
        """Draw (theta, gamma) (count, n + m) uniformly within the limits."""
        low, high = self.limits.T
        return generator.uniform(low, high, size=(count, len(self.parameters)))

    def unit_cubes(self, theta: ArrayLike, gamma: ArrayLike) -> NDArray[np.float64]:
        """Return the bodies of m(theta, gamma) as maps of the unit cube to the world.

        Returns
        -------
        unit_cubes
            (B, 4, 4) affine maps of [-0.5, 0.5]^3, one for each body, metres. A cylinder is the
            image of the one that this cube holds, along an axis of `cylinder_axes`.
        """
        cubes = np.zeros((len(self.bodies), 4, 4))
        for cube, body in zip(cubes, self.bodies, strict=True):
            cube[:3, :3] = np.diag(body.size(gamma))
            cube[:3, 3] = body.centre(gamma)
            cube[3, 3] = 1.0
        return self.transformation.matrix(theta) @ cubes

    def moved_cubes(
        self, values: NDArray[np.float64], positions: Mapping[str, float]
    ) -> NDArray[np.float64]:
        """Return the bodies as maps (B, 4, 4) of the unit cube to the world, with joints moved.

        Parameters
        ----------
        values
            (n + m,) morphing parameters.
        positions
            By the joints' names, m or rad; 0 of those that are not named.
        """
        theta, gamma = self.split(values)
        motions = self.motions(gamma, positions)
        moved = np.array([motions[body.name] for body in self.bodies])
        shut = self.unit_cubes(np.zeros_like(theta), gamma)
        return self.transformation.matrix(theta) @ moved @ shut

    def nearest_equivalent(
        self, values: NDArray[np.float64], reference: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return, of the parameters that mean the same object, those nearest in yaw to a reference.

        Parameters
        ----------
        values, reference
            (..., n + m) morphing parameters.
        """
        if self.symmetry == "none":
            return values
        kinds = self.transformation.kinds
        yaw, sx, sy = (kinds.index(kind) for kind in _TURNED)
        turns = np.round((reference[..., yaw] - values[..., yaw]) / (np.pi / 2.0))
        nearest = values.copy()
        nearest[..., yaw] += turns * (np.pi / 2.0)
        swapped = (turns % 2 == 1)[..., None]
        nearest[..., [sx, sy]] = np.where(swapped, values[..., [sy, sx]], values[..., [sx, sy]])
        return nearest


def _check_symmetry(section: Section, model: KinematicModel) -> None:
    if model.symmetry == "quarter_turn" and not set(_TURNED) <= set(model.transformation.kinds):
        raise section.error("'quarter_turn' needs a rotation about z and scales along x and y")
    if model.start == "centroid":
        planar = {("translation", "x"), ("translation", "y")}
        if not planar <= set(model.transformation.kinds):
            raise section.error("'start: centroid' needs translations along x and y")
