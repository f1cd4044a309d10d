"""Reading of the parts of a kinematic model from its YAML file."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import numpy as np

from kmn_perception.configuration.section import Section, is_number
from kmn_perception.model.parts import Body, Joint, Linear, NetworkInput, Parameter, Stem
from kmn_perception.model.transformation import AXES, KINDS

UNITS = {"translation": "m", "rotation": "rad", "scale": ""}


def read_theta(section: Section) -> Parameter:
    """Read a transformation parameter."""
    section.allow(("name", "kind", "axis", "limits"))
    kind = section.text("kind", KINDS)
    section.text("axis", AXES)
    limits = section.limits("limits")
    if kind == "scale" and limits[0] <= -1.0:
        raise section.error(f"a scale stretches by 1 + s, so 'limits' must lie above -1: {limits}")
    return Parameter(section.text("name"), UNITS[kind], limits)


def read_gamma(section: Section) -> Parameter:
    """Read a configuration parameter."""
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


def read_bodies(section: Section, gamma: Sequence[Parameter]) -> tuple[Body, ...]:
    """Read the bodies, whose sizes must be positive everywhere within the limits of gamma."""
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


def read_joints(
    section: Section, bodies: Sequence[Body], gamma: Sequence[Parameter]
) -> tuple[Joint, ...]:
    """Read the joints."""
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


def read_stem(section: Section, bodies: Sequence[Body], joints: Sequence[Joint]) -> Stem | None:
    """Read what joins a body to its parent, if there is such a thing."""
    if "stem" not in section:
        return None
    stem = section.section("stem")
    stem.allow(("joint", "thickness"))
    between = {joint.name: joint for joint in joints if joint.parent != "world"}
    if not between:
        raise stem.error("a stem needs a joint between two bodies, and there is none")
    joint = between[stem.text("joint", between)]
    by_name = {body.name: body for body in bodies}
    thickness = stem.number("thickness", 0.0)
    return Stem(joint, by_name[joint.body], by_name[joint.parent], thickness)


def read_input(section: Section) -> NetworkInput:
    """Read the settings of the network's depth image."""
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
