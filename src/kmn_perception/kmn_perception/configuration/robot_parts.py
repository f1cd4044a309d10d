"""Parts of a robot's file, ``config/robots/NAME.yaml``, that simulator and planner both read."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Literal, NamedTuple

from kmn_perception.configuration.settings import Interval


class BaseSettings(NamedTuple):
    """A base that drives and turns at will on a floor, or that stands where it is.

    Attributes
    ----------
    kind
        One that is fixed has no controller, and no joints in messages.
    frame
        Of the model, which the base moves.
    limits
        Of its joints by name, m and rad: x, y and yaw.
    yaw
        By which the model stands turned on the base, radians, so that the base's x leads forwards.
    """

    kind: Literal["omnidirectional", "fixed"]
    frame: str
    limits: dict[str, Interval]
    yaw: float = 0.0


class Gripper(NamedTuple):
    """The gripper's joint, the larger the wider open, and the joints that move with it."""

    joint: str
    followers: tuple[str, ...]


class ControllerSettings(NamedTuple):
    """A controller of some of the joints: what it serves, under which name.

    Attributes
    ----------
    stamped
        Whether velocities are ``TwistStamped``, else ``Twist``.
    """

    type: Literal["follow_joint_trajectory", "gripper_command", "topic", "velocity"]
    name: str
    joints: tuple[str, ...]
    stamped: bool = False


Controllers = Mapping[str, ControllerSettings]


def velocity_controller(controllers: Controllers) -> str:
    """Return the name of the base's controller if it takes velocities, else nothing."""
    return next((name for name, each in controllers.items() if each.type == "velocity"), "")


def joints_in_messages(joints: Collection[str], controllers: Controllers) -> tuple[str, ...]:
    """Return the joints that trajectories and ``joint_states`` are of.

    A base that takes velocities has none, for odometry tells where it is, and a fixed one neither.
    """
    moved = [each for each in controllers.values() if each.type != "velocity"]
    return tuple(joint for joint in joints if any(joint in each.joints for each in moved))


def controllers_fault(
    controllers: Controllers,
    joints: Collection[str],
    base: tuple[str, ...],
    gripper: str,
    fixed: bool,
) -> str:
    """Return what is wrong with the controllers of a robot; empty if nothing is.

    Parameters
    ----------
    joints, base
        Names of all joints, and of the base's.
    gripper
        Name of the gripper's joint.
    fixed
        Whether the base is.
    """
    controlled = [name for each in controllers.values() for name in each.joints]
    if fixed and set(base) & set(controlled):
        return f"controllers: a fixed base has none, found {', '.join(controlled)}"
    if sorted(controlled) != sorted(name for name in joints if not fixed or name not in base):
        return f"controllers: each joint must have one, found {', '.join(controlled)}"
    for name, each in controllers.items():
        for kind, alone in (("gripper_command", (gripper,)), ("velocity", base)):
            if each.type == kind and each.joints != alone:
                return (
                    f"controllers: {name}: a {kind} is for '{', '.join(alone)}' alone, found "
                    f"{', '.join(each.joints)}"
                )
    return ""
