"""The limits by which a plan is made, against those that a robot's URDF tells."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple
from xml.etree import ElementTree


class JointLimits(NamedTuple):
    """Lower and upper position, and the largest velocity, m or rad and seconds."""

    low: float
    high: float
    velocity: float


def limits_of_urdf(text: str) -> dict[str, JointLimits]:
    """Return the limits of a URDF's movable joints by name; infinite where it has none.

    Raises
    ------
    ValueError
        If it is no URDF.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ValueError(f"it is no XML: {error}") from error
    found = {}
    for joint in robot.iterfind("joint"):
        limit = joint.find("limit")
        free = limit is None or joint.get("type") == "continuous"
        if joint.get("type") != "fixed":
            found[joint.get("name", "")] = JointLimits(
                -math.inf if free else _number(joint, "lower", 0.0),
                math.inf if free else _number(joint, "upper", 0.0),
                _number(joint, "velocity", math.inf),
            )
    return found


def _number(joint: ElementTree.Element, key: str, default: float) -> float:
    limit = joint.find("limit")
    text = None if limit is None else limit.get(key)
    try:
        number = default if text is None else float(text)
    except ValueError:
        number = math.nan
    if math.isnan(number):
        raise ValueError(f"it limits joint {joint.get('name')}, {key}, by no number: '{text}'")
    return number


def differences(
    planned: Mapping[str, JointLimits],
    urdf: Mapping[str, JointLimits],
    slack: float,
    velocity_slack: float,
) -> list[str]:
    """Return, joint by joint, where plans may do what the robot cannot.

    Parameters
    ----------
    slack, velocity_slack
        By how much limits may differ, m and rad, and per second.
    """
    found = []
    for name, ours in planned.items():
        theirs = urdf.get(name)
        if theirs is None:
            found.append(f"it has no joint {name}")
            continue
        if ours.low < theirs.low - slack or ours.high > theirs.high + slack:
            found.append(
                f"{name} goes from {theirs.low:g} to {theirs.high:g} there, but from "
                f"{ours.low:g} to {ours.high:g} in plans"
            )
        if ours.velocity > theirs.velocity + velocity_slack:
            found.append(
                f"{name} moves {theirs.velocity:g} a second there, {ours.velocity:g} in plans"
            )
    return found
