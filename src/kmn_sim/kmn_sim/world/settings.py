"""Numbers of the simulated world, read from ``config/simulation``."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section


class PhysicsSettings(NamedTuple):
    """Steps a second, iterations of the solver in each, and gravity in m/s^2."""

    rate: int
    solver_iterations: int
    gravity: float

    @classmethod
    def load(cls) -> PhysicsSettings:
        """Read ``config/simulation/physics.yaml``."""
        section = _load("physics")
        section.allow(cls._fields)
        return cls(
            section.whole_number("rate", 60, 10_000),
            section.whole_number("solver_iterations", 1, 10_000),
            section.number("gravity", 0.0),
        )


class DoorMechanics(NamedTuple):
    """Mechanics of the door and sizes of its surroundings; SI units.

    Attributes
    ----------
    panel_mass, handle_mass
        Masses of the two.
    hinge_friction, opening
        Coulomb friction of the hinge, and the angle from closed to its stop.
    spring, preload, damping
        Of the spring that turns the handle back.
    friction, spinning_friction
        Of the handle's surface.
    release, catch, latch_torque
        Handle angle at which the latch lets go, hinge angle within which it catches, and the
        torque about the hinge that it bears.
    stem
        Thickness of the stem between lever and panel.
    frame, gap
        Thickness of the frame, and its distance to the panel.
    wall_width, wall_height, wall_thickness
        Of the wall beside the frame.
    robot
        Where the robot's base starts: x, y, yaw.
    """

    panel_mass: float
    handle_mass: float
    hinge_friction: float
    opening: float
    spring: float
    preload: float
    damping: float
    friction: float
    spinning_friction: float
    release: float
    catch: float
    latch_torque: float
    stem: float
    frame: float
    gap: float
    wall_width: float
    wall_height: float
    wall_thickness: float
    robot: tuple[float, ...]

    @classmethod
    def load(cls) -> DoorMechanics:
        """Read ``config/simulation/door.yaml``."""
        section = _load("door")
        keys = ("panel", "hinge", "handle", "latch", "stem", "frame", "wall")
        section.allow((*keys, "robot"))
        panel, hinge, handle, latch, stem, frame, wall = map(section.section, keys)
        return cls(
            panel_mass=panel.number("mass", 0.0),
            handle_mass=handle.number("mass", 0.0),
            hinge_friction=hinge.number("friction", 0.0),
            opening=hinge.number("opening", 0.0),
            spring=handle.number("spring", 0.0),
            preload=handle.number("preload", 0.0),
            damping=handle.number("damping", 0.0),
            friction=handle.number("friction", 0.0),
            spinning_friction=handle.number("spinning_friction", 0.0),
            release=latch.number("release", 0.0),
            catch=latch.number("catch", 0.0),
            latch_torque=latch.number("torque", 0.0),
            stem=stem.number("thickness", 0.0),
            frame=frame.number("thickness", 0.0),
            gap=frame.number("gap", 0.0),
            wall_width=wall.number("width", 0.0),
            wall_height=wall.number("height", 0.0),
            wall_thickness=wall.number("thickness", 0.0),
            robot=tuple(section.numbers("robot", 3)),
        )


class BoxSettings(NamedTuple):
    """Density (kg/m^3) and friction of the box, sizes of the table (m), start of the robot."""

    density: float
    friction: float
    table_height: float
    table_width: float
    table_depth: float
    table_thickness: float
    robot: tuple[float, ...]

    @classmethod
    def load(cls) -> BoxSettings:
        """Read ``config/simulation/box.yaml``."""
        section = _load("box")
        section.allow(("box", "table", "robot"))
        box, table = section.section("box"), section.section("table")
        return cls(
            density=box.number("density", 0.0),
            friction=box.number("friction", 0.0),
            table_height=table.number("height", 0.0),
            table_width=table.number("width", 0.0),
            table_depth=table.number("depth", 0.0),
            table_thickness=table.number("thickness", 0.0),
            robot=tuple(section.numbers("robot", 3)),
        )


class RecordingSettings(NamedTuple):
    """Where the camera stands that takes pictures of a run; metres.

    Attributes
    ----------
    focal_length
        In widths of the picture.
    left, along, height
        Of its place before a door: to the left of what it looks at, from there along the way from
        the robot's start to the door, and up.
    target, target_height
        What it looks at there: the part of that way, and the height.
    box_position, box_target
        Its place before a box and what it looks at there, in the world.
    """

    focal_length: float
    left: float
    along: float
    height: float
    target: float
    target_height: float
    box_position: list[float]
    box_target: list[float]

    @classmethod
    def load(cls) -> RecordingSettings:
        """Read ``config/simulation/film.yaml``."""
        section = _load("film")
        section.allow(("focal_length", "door", "box"))
        door, box = section.section("door"), section.section("box")
        door.allow(("left", "along", "height", "target", "target_height"))
        box.allow(("position", "target"))
        return cls(
            focal_length=section.number("focal_length", 0.01),
            left=door.number("left"),
            along=door.number("along"),
            height=door.number("height"),
            target=door.number("target"),
            target_height=door.number("target_height"),
            box_position=box.numbers("position", 3),
            box_target=box.numbers("target", 3),
        )


def _load(name: str) -> Section:
    return Section.load(resources.find("config/simulation", name))
