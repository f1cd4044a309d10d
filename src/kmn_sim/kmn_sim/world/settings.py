"""Numbers of the simulated world, read from ``config/simulation`` and ``config/robots``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, NamedTuple

from pydantic import Field

from kmn_perception.configuration import resources
from kmn_perception.configuration.settings import Fraction, NonNegative, Positive, load_settings
from kmn_sim.robot.settings import RobotSettings


class FloorSettings(NamedTuple):
    """Sides and thickness of the square floor, metres."""

    size: Positive
    thickness: Positive


class LightSettings(NamedTuple):
    """Direction towards the light, and how much of it surfaces scatter: of all, and of its own."""

    direction: tuple[float, float, float]
    ambient: Fraction
    diffuse: Fraction


class PhysicsSettings(NamedTuple):
    """Numbers of the physics, and of how it is seen.

    Attributes
    ----------
    rate, solver_iterations
        Steps a second, and iterations of the solver in each.
    gravity
        In m/s^2.
    blur
        Standard deviation by which a camera blurs its image, pixels.
    """

    rate: Annotated[int, Field(ge=60, le=10_000)]
    solver_iterations: Annotated[int, Field(ge=1, le=10_000)]
    gravity: NonNegative
    floor: FloorSettings
    light: LightSettings
    blur: Positive


class FrameSettings(NamedTuple):
    """Thickness of the door's frame, and its distance to the panel, metres."""

    thickness: Positive
    gap: NonNegative


class WallSettings(NamedTuple):
    """The wall: its width to either side of the door, height and thickness, metres."""

    width: Positive
    height: Positive
    thickness: Positive


class DoorSurroundings(NamedTuple):
    """What stands around a door."""

    frame: FrameSettings
    wall: WallSettings


class CartonSettings(NamedTuple):
    """Density (kg/m^3) and friction of the box."""

    density: Positive
    friction: NonNegative


class TableSettings(NamedTuple):
    """The table that a box stands on, metres."""

    height: Positive
    width: Positive
    depth: Positive
    thickness: Positive


class BoxSettings(NamedTuple):
    """The box, the table, and where the robot's base starts: x, y (m) and yaw (rad)."""

    box: CartonSettings
    table: TableSettings
    robot: tuple[float, float, float]


class WorldSettings(NamedTuple):
    """All numbers of the simulated world."""

    physics: PhysicsSettings
    door: DoorSurroundings
    box: BoxSettings
    robot: RobotSettings

    @classmethod
    def load(cls, robot: str | Path = "") -> WorldSettings:
        """Read the shipped files, and a robot's; raise ``ConfigurationError`` if one is wrong."""
        physics, door, box = (
            resources.find("config/simulation", name) for name in ("physics", "door", "box")
        )
        return cls(
            load_settings(PhysicsSettings, physics),
            load_settings(DoorSurroundings, door),
            load_settings(BoxSettings, box),
            RobotSettings.load(robot),
        )
