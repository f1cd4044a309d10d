"""A kinematic model with its alternatives and what stands around it: a door in its wall."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section
from kmn_perception.model import model_file
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.parts import Body, Joint, Parameter

SIDES = ("right", "left")  # of the handle, as seen; at the left, all is mirrored in y
OPENING = "opening"  # the nuisance that is the angle of the joint below
HINGE = "hinge"


def has_surroundings(name_or_path: str | Path) -> bool:
    """Tell whether a model's file describes what stands around the object.

    Raises
    ------
    FileNotFoundError, ConfigurationError
        If there is no such file, or it is no mapping.
    """
    return "surroundings" in Section.load(resources.find("config/models", name_or_path))


@dataclass(frozen=True, eq=False)
class RoomModel:
    """A door, the kinds of handles that it may have, and the wall and frame around it.

    Attributes
    ----------
    model
        The door itself.
    nuisance
        Parameters of the surroundings and of the state; the last sections of the file.
    handles, fittings
        By name, the bodies of a kind of handle (metres from the centre of the body ``handle``), and
        of what is behind it on the panel (metres from where the handle's stem meets the panel).
    surroundings
        Wall, frame, seals and floor; linear in gamma and the nuisances, in the object frame.
    """

    model: KinematicModel
    nuisance: tuple[Parameter, ...]
    handles: Mapping[str, tuple[Body, ...]]
    fittings: Mapping[str, tuple[Body, ...]]
    surroundings: tuple[Body, ...]

    @classmethod
    def load(cls, name_or_path: str | Path) -> RoomModel:
        """Read ``config/models/NAME.yaml`` or the user's own file.

        Raises
        ------
        FileNotFoundError
            If there is no such file.
        ConfigurationError
            If a key is missing, unknown or wrong.
        """
        model = KinematicModel.load(name_or_path)
        model.require_cuboids("a door in its wall")
        section = Section.load(resources.find("config/models", name_or_path))
        surroundings = section.section("surroundings")
        surroundings.allow(("parameters", "bodies"))
        nuisance = tuple(map(model_file.read_gamma, surroundings.sections("parameters")))
        if OPENING not in {parameter.name for parameter in nuisance}:
            raise surroundings.error(f"'parameters' must hold '{OPENING}'")
        if HINGE not in {joint.name for joint in model.joints}:
            raise section.error(f"'joints' must hold '{HINGE}'")
        alternatives = section.section("alternatives")
        alternatives.allow(("handle", "fitting"))
        parameters = (*model.gamma, *nuisance)
        handles, fittings = (
            model_file.read_alternatives(alternatives.section(key), parameters)
            for key in ("handle", "fitting")
        )
        bodies = model_file.read_surroundings(surroundings.section("bodies"), parameters)
        return cls(model, nuisance, handles, fittings, bodies)

    @property
    def hinge(self) -> Joint:
        """The joint of which the nuisance ``opening`` is the angle."""
        return next(joint for joint in self.model.joints if joint.name == HINGE)

    def nuisances(self, **values: float) -> NDArray[np.float64]:
        """Return the nuisance parameters (k,) of which some are given by name; others are 0."""
        names = [parameter.name for parameter in self.nuisance]
        if not set(values) <= set(names):
            raise ValueError(f"nuisances are {', '.join(names)}; found {', '.join(values)}")
        return np.array([values.get(name, 0.0) for name in names])

    def pose(
        self, values: NDArray[np.float64], side: str = "right", opening: float = 0.0
    ) -> NDArray[np.float64]:
        """Return the map (4, 4) of the panel's frame to the world.

        Parameters
        ----------
        values
            (n + m,) theta, of the closed panel, and gamma.
        side
            Of the handle; ``left`` makes the map a reflection.
        opening
            Angle of the hinge, rad.
        """
        theta, gamma = self.model.split(values)
        mirror = np.diag([1.0, -1.0 if side == "left" else 1.0, 1.0, 1.0])
        return self.model.transformation.matrix(theta) @ mirror @ self.hinge.motion(gamma, opening)

    def cubes(
        self,
        values: NDArray[np.float64],
        nuisance: ArrayLike,
        handle: str = "lever",
        side: str = "right",
        fitting: str = "none",
    ) -> tuple[tuple[str, ...], NDArray[np.float64]]:
        """Return all bodies as maps of the unit cube to the world.

        Parameters
        ----------
        values
            (n + m,) theta, of the closed panel, and gamma.
        nuisance
            (k,) see `nuisances`.
        handle, side, fitting
            One of ``handles``, of ``SIDES`` and of ``fittings``.

        Returns
        -------
        names
            Of the bodies: ``panel``, ``handle_...``, ``fitting_...`` and those of the surroundings.
        unit_cubes
            (B, 4, 4) affine maps of [-0.5, 0.5]^3, metres; reflections if ``side`` is ``left``.
        """
        gamma = self.model.split(values)[1]
        nuisance = np.asarray(nuisance, dtype=np.float64)
        both = np.concatenate([gamma, nuisance])
        opening = float(nuisance[[p.name for p in self.nuisance].index(OPENING)])
        panel, grip = self.model.body("panel"), self.model.body("handle").centre(gamma)
        parts = self.handles[handle]
        foot = grip.copy()
        foot[0] = panel.centre(gamma)[0] - panel.size(gamma)[0] / 2.0
        stems = [part for part in parts if part.name == "stem"]
        if stems:
            foot[1:] += stems[0].centre(both)[1:]
        moving = [("panel", panel.centre(gamma), panel.size(gamma))]
        moving += [(f"handle_{b.name}", grip + b.centre(both), b.size(both)) for b in parts]
        moving += [
            (f"fitting_{b.name}", foot + b.centre(both), b.size(both))
            for b in self.fittings[fitting]
        ]
        fixed = [(b.name, b.centre(both), b.size(both)) for b in self.surroundings]
        names, cubes = [], []
        for bodies, angle in ((moving, opening), (fixed, 0.0)):
            pose = self.pose(values, side, angle)
            for name, centre, size in bodies:
                if size.min() > 0.0:
                    cube = np.diag([*size, 1.0])
                    cube[:3, 3] = centre
                    names.append(name)
                    cubes.append(pose @ cube)
        return tuple(names), np.array(cubes)

    def door_bodies(
        self, values: NDArray[np.float64], opening: float, handle: str = "", side: str = "right"
    ) -> NDArray[np.float64]:
        """Return panel and handle alone as maps (B, 4, 4) of the unit cube to the world.

        Parameters
        ----------
        opening
            Angle of the hinge, rad.
        handle, side
            See `cubes`; without a handle, the panel alone.
        """
        nuisances = self.nuisances(**{OPENING: opening})
        names, cubes = self.cubes(values, nuisances, handle or "none", side)
        drawn = cubes[[name.partition("_")[0] in ("panel", "handle") for name in names]]
        reflected = np.linalg.det(drawn[:, :3, :3]) < 0.0
        drawn[reflected, :3, 1] *= -1.0  # a cuboid is its own mirror image
        return drawn
