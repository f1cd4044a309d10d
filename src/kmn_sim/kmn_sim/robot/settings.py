"""What the simulator knows of the PR2 beside its model, from ``config/simulation/pr2.yaml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section


class Motor(NamedTuple):
    """Largest effort (N or N m) and velocity (m/s or rad/s) of a joint, and where it starts."""

    effort: float
    velocity: float
    home: float


@dataclass(frozen=True)
class RobotSettings:
    """The PR2's joints and their control.

    Attributes
    ----------
    source
        The model's file in the folder of robotic's models.
    joints
        Movable joints by name, in the order of ``joint_states``: base x, y and yaw first.
    leader, followers, follower_effort
        The gripper's commanded joint and those that turn with it.
    position_gain
        Part of the position error that a motor takes away in one step.
    friction, spinning_friction
        Contact of the fingers.
    """

    source: str
    joints: dict[str, Motor]
    leader: str
    followers: tuple[str, ...]
    follower_effort: float
    position_gain: float
    friction: float
    spinning_friction: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the movable joints."""
        return tuple(self.joints)

    @classmethod
    def load(cls) -> RobotSettings:
        """Read the configuration file."""
        section = Section.load(resources.find("config/simulation", "pr2"))
        section.allow(("name", "source", "joints", "mimics", "control", "grip"))
        mimics, control, grip = (section.section(key) for key in ("mimics", "control", "grip"))
        mimics.allow(("leader", "followers", "effort"))
        control.allow(("position_gain",))
        grip.allow(("friction", "spinning_friction"))
        joints = section.section("joints")
        return cls(
            source=section.text("source"),
            joints={name: _motor(joints.section(name)) for name in joints.values},
            leader=mimics.text("leader", tuple(joints.values)),
            followers=tuple(mimics.values["followers"]),
            follower_effort=mimics.number("effort", 0.0),
            position_gain=control.number("position_gain", 0.0, 1.0),
            friction=grip.number("friction", 0.0),
            spinning_friction=grip.number("spinning_friction", 0.0),
        )


def _motor(section: Section) -> Motor:
    section.allow(("effort", "velocity", "home"))
    return Motor(
        section.number("effort", 0.0), section.number("velocity", 0.0), section.number("home")
    )
