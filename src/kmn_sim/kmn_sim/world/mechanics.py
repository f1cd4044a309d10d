"""The mechanics of an object's bodies and joints, read from ``mechanics`` in its model's file."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration.settings import NonNegative, Positive, read_settings
from kmn_perception.model.kinematic_model import KinematicModel


class BodyMechanics(NamedTuple):
    """Mass (kg) of a body that moves, and the friction of its surface."""

    mass: Positive
    friction: NonNegative = 0.5
    spinning_friction: NonNegative = 0.0


class LatchMechanics(NamedTuple):
    """What holds a joint at 0.

    Attributes
    ----------
    catch
        Position within which it catches, m or rad.
    effort
        That it bears, N or N m; to more it gives.
    released_by
        Joint that lets it go; none lets go of a magnet or a seal.
    release
        Position of that joint from which on it does, m or rad.
    """

    catch: NonNegative
    effort: NonNegative
    released_by: str = ""
    release: NonNegative = 0.0


class JointMechanics(NamedTuple):
    """Forces at a joint, in N, m and s, or N m, rad and s.

    Attributes
    ----------
    friction
        Coulomb friction.
    spring, damping
        Of the spring that brings it back to 0.
    preload, preload_width
        Effort with which the spring begins, and the way over which it sets in.
    """

    friction: NonNegative = 0.0
    spring: NonNegative = 0.0
    damping: NonNegative = 0.0
    preload: NonNegative = 0.0
    preload_width: Positive = 0.01
    latch: LatchMechanics | None = None


class Mechanics(NamedTuple):
    """Mechanics of bodies and joints by their names; joints that are not named move freely."""

    bodies: dict[str, BodyMechanics]
    joints: dict[str, JointMechanics]

    @classmethod
    def of(cls, model: KinematicModel) -> Mechanics:
        """Return those of a model.

        Raises
        ------
        ConfigurationError
            If they are missing or wrong, a body that moves has no mass, or a name is unknown.
        """
        section = model.mechanics
        if not section.values:
            raise section.error("the simulator needs the 'mechanics' of an object with joints")
        read = read_settings(cls, section)
        moving = [joint.body for joint in model.joints]
        named = [joint.name for joint in model.joints if joint.moves]
        if missing := sorted(set(moving) - set(read.bodies)):
            raise section.error(f"'bodies' lacks what joints move: {', '.join(missing)}")
        latches = [each.latch for each in read.joints.values() if each.latch is not None]
        for what, found, known in (
            ("bodies", set(read.bodies), moving),
            ("joints", set(read.joints), named),
            ("'released_by' of joints", {latch.released_by for latch in latches} - {""}, named),
        ):
            if unknown := sorted(found - set(known)):
                raise section.error(
                    f"{what}: unknown {', '.join(unknown)} (known: {', '.join(known)})"
                )
        return read
