"""The kinematic model m(theta, gamma) of an object, read from one YAML file (paper, Sec. II-A)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section, is_number
from kmn_perception.model.camera import Camera
from kmn_perception.model.transformation import AXES, KINDS, Transformation

UNITS = {"translation": "m", "rotation": "rad", "scale": ""}


@dataclass(frozen=True)
class Parameter:
    """A morphing parameter: its name, unit (m, rad or none) and limits; the prototype is at 0."""

    name: str
    unit: str
    limits: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Linear:
    """A vector that is linear in gamma: ``constant + slope @ gamma``."""

    constant: NDArray[np.float64]  # (3,)
    slope: NDArray[np.float64]  # (3, m)

    def __call__(self, gamma: ArrayLike) -> NDArray[np.float64]:
        """Return the vector (3,) at gamma (m,)."""
        return self.constant + self.slope @ np.asarray(gamma, dtype=np.float64)


@dataclass(frozen=True)
class Body:
    """A cuboid in the object frame: centre and size in metres."""

    name: str
    centre: Linear
    size: Linear


@dataclass(frozen=True)
class Joint:
    """A revolute joint in the object frame; ``parent`` is a body or ``world``."""

    name: str
    body: str
    parent: str
    axis: tuple[float, ...]
    origin: Linear
    limits: tuple[float, float]


@dataclass(frozen=True)
class NetworkInput:
    """The depth image that the network sees.

    Attributes
    ----------
    width, height
        Size in pixels.
    near, far
        Depths in metres that become 1 and (almost) 0; 0 itself is the background.
    contrast
        Factor by which the network stretches depths about 1/2.
    supersampling
        The cloud is splatted on a grid this many times finer, then averaged.
    max_gap
        Holes of up to this many pixels of the finer grid are closed.
    """

    width: int
    height: int
    near: float
    far: float
    contrast: float
    supersampling: int
    max_gap: int


@dataclass(frozen=True, eq=False)
class KinematicModel:
    """A parametrised object m(theta, gamma) made of cuboids.

    Attributes
    ----------
    theta, gamma
        Transformation and configuration parameters; all are 0 at the prototype.
    transformation
        T_theta of the transformation parameters.
    camera
        The canonical camera, from which the network sees the world.
    start
        Where Algorithm 1 starts: at the ``prototype``, or above the cloud's ``centroid``.
    symmetry
        ``none``, or ``quarter_turn``: turned by 90 degrees about z, with the scales along x and y
        swapped, the object is the same.
    """

    name: str
    theta: tuple[Parameter, ...]
    gamma: tuple[Parameter, ...]
    transformation: Transformation
    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    camera: Camera
    input: NetworkInput
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
        section = Section.load(resources.find("config/models", name_or_path))
        section.allow(
            ("name", "camera", "input", "theta", "bodies"),
            ("gamma", "joints", "start", "symmetry"),
        )
        theta = tuple(_theta(entry) for entry in section.sections("theta"))
        gamma = tuple(_gamma(entry) for entry in section.sections("gamma"))
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
        bodies = _bodies(section, gamma)
        model = cls(
            name=section.text("name"),
            theta=theta,
            gamma=gamma,
            transformation=transformation,
            bodies=bodies,
            joints=_joints(section, bodies, gamma),
            camera=Camera.load(section.text("camera")),
            input=_input(section.section("input")),
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
    def limits(self) -> NDArray[np.float64]:
        """(n + m, 2) lower and upper limits of (theta, gamma)."""
        return np.array([parameter.limits for parameter in self.parameters])

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
            (B, 4, 4) affine maps of [-0.5, 0.5]^3, one for each body, metres.
        """
        cubes = np.zeros((len(self.bodies), 4, 4))
        for cube, body in zip(cubes, self.bodies, strict=True):
            cube[:3, :3] = np.diag(body.size(gamma))
            cube[:3, 3] = body.centre(gamma)
            cube[3, 3] = 1.0
        return self.transformation.matrix(theta) @ cubes

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


_TURNED = (("rotation", "z"), ("scale", "x"), ("scale", "y"))


def _theta(section: Section) -> Parameter:
    section.allow(("name", "kind", "axis", "limits"))
    kind = section.text("kind", KINDS)
    section.text("axis", AXES)
    limits = section.limits("limits")
    if kind == "scale" and limits[0] <= -1.0:
        raise section.error(f"a scale stretches by 1 + s, so 'limits' must lie above -1: {limits}")
    return Parameter(section.text("name"), UNITS[kind], limits)


def _gamma(section: Section) -> Parameter:
    section.allow(("name", "unit", "limits"))
    return Parameter(
        section.text("name"), section.text("unit", ("m", "rad", "")), section.limits("limits")
    )


def _linear(section: Section, key: str, gamma: Sequence[Parameter]) -> Linear:
    entries = section.values.get(key)
    if not isinstance(entries, list) or len(entries) != 3:
        raise section.error(f"'{key}' must be a list of 3 entries, found {entries!r}")
    names = [parameter.name for parameter in gamma]
    constant, slope = np.zeros(3), np.zeros((3, len(names)))
    for row, entry in enumerate(entries):
        terms = entry if isinstance(entry, Mapping) else {"constant": entry}
        for name, value in terms.items():
            if not is_number(value):
                raise section.error(f"'{key}' must hold numbers, found {value!r}")
            if name == "constant":
                constant[row] = value
            elif name in names:
                slope[row, names.index(name)] = value
            else:
                known = ", ".join(("constant", *names))
                raise section.error(f"unknown key '{name}' in '{key}' (known: {known})")
    return Linear(constant, slope)


def _bodies(section: Section, gamma: Sequence[Parameter]) -> tuple[Body, ...]:
    bodies = []
    for name in section.section("bodies").values:
        body = section.section("bodies").section(name)
        body.allow(("centre", "size"))
        size = _linear(body, "size", gamma)
        for corner in itertools.product(*[parameter.limits for parameter in gamma]):
            if size(corner).min() <= 0.0:
                raise body.error(
                    f"'size' must be positive within the limits, "
                    f"is {size(corner)} at gamma {corner}"
                )
        bodies.append(Body(name, _linear(body, "centre", gamma), size))
    if not bodies:
        raise section.error("'bodies' is empty")
    return tuple(bodies)


def _joints(
    section: Section, bodies: Sequence[Body], gamma: Sequence[Parameter]
) -> tuple[Joint, ...]:
    names = [body.name for body in bodies]
    joints = []
    for name in section.section("joints").values:
        joint = section.section("joints").section(name)
        joint.allow(("body", "parent", "axis", "origin", "limits"))
        joints.append(
            Joint(
                name=name,
                body=joint.text("body", names),
                parent=joint.text("parent", ("world", *names)),
                axis=tuple(joint.numbers("axis", 3)),
                origin=_linear(joint, "origin", gamma),
                limits=joint.limits("limits"),
            )
        )
    return tuple(joints)


def _input(section: Section) -> NetworkInput:
    section.allow(("width", "height", "near", "far", "contrast", "supersampling", "max_gap"))
    near = section.number("near", 0.0, 1e3)
    return NetworkInput(
        width=section.whole_number("width", 32, 4096),
        height=section.whole_number("height", 32, 4096),
        near=near,
        far=section.number("far", near, 1e3),
        contrast=section.number("contrast", 1.0, 1e3),
        supersampling=section.whole_number("supersampling", 1, 8),
        max_gap=section.whole_number("max_gap", 0, 64),
    )


def _check_symmetry(section: Section, model: KinematicModel) -> None:
    if model.symmetry == "quarter_turn" and not set(_TURNED) <= set(model.transformation.kinds):
        raise section.error("'quarter_turn' needs a rotation about z and scales along x and y")
    if model.start == "centroid":
        planar = {("translation", "x"), ("translation", "y")}
        if not planar <= set(model.transformation.kinds):
            raise section.error("'start: centroid' needs translations along x and y")
