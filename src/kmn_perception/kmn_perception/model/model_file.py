"""Reading of the parts of a kinematic model from its YAML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from kmn_perception.configuration.section import Section, is_number
from kmn_perception.model.camera import Camera
from kmn_perception.model.parts import (
    CUBOID,
    CYLINDER,
    FIXED,
    JOINT_TYPES,
    PRISMATIC,
    REVOLUTE,
    SHAPES,
    WORLD,
    Body,
    Joint,
    Linear,
    NetworkInput,
    Parameter,
    Stem,
)
from kmn_perception.model.transformation import AXES, KINDS

ROUNDING = 1e-9  # metres
MIRROR = np.array([1.0, -1.0, 1.0])
JOINT_KEYS = {  # of each type, the required ones and the others
    REVOLUTE: (("body", "parent", "axis", "origin", "limits"), ("type",)),
    PRISMATIC: (("type", "body", "parent", "axis", "limits"), ()),
    FIXED: (("type", "body", "parent"), ()),
}
SHAPE_KEYS = {  # likewise
    CUBOID: (("centre", "size"), ("shape",)),
    CYLINDER: (("shape", "centre", "axis", "radius", "length"), ()),
}
UNITS = {"translation": "m", "rotation": "rad", "scale": ""}


def read_camera(section: Section, folder: Path) -> Camera:
    """Read the camera of a name, or of a file from a folder."""
    try:
        return Camera.load(section.text("camera"), folder)
    except FileNotFoundError as error:
        raise section.error(f"camera: {error}") from error


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
    return _entries(section, key, entries, gamma)


def _entries(
    section: Section, key: str, entries: Sequence[object], gamma: Sequence[Parameter]
) -> Linear:
    """Read entries of a key, each a number or linear in gamma."""
    names = [parameter.name for parameter in gamma]
    constant, slope = np.zeros(len(entries)), np.zeros((len(entries), len(names)))
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
    bodies = section.section("bodies")
    if not bodies.values:
        raise section.error("'bodies' is empty")
    return tuple(_read_shape(bodies.section(name), name, gamma) for name in bodies.values)


def check_round(section: Section, bodies: Sequence[Body], kinds: Sequence[tuple[str, str]]) -> None:
    """Refuse cylinders that transformation parameters ``(kind, axis)`` would flatten."""
    for body in bodies:
        across = [AXES[k] for k in range(3) if body.is_cylinder and k != body.axis]
        for axis in across:
            if ("scale", axis) in kinds:
                raise section.error(
                    f"a scale along {axis} would flatten the cylinder '{body.name}'; "
                    "let its 'radius' depend on gamma"
                )


def _read_shape(section: Section, name: str, parameters: Sequence[Parameter]) -> Body:
    """Read a body of any shape."""
    shape = section.text("shape", SHAPES, CUBOID)
    section.allow(*SHAPE_KEYS[shape])
    if shape == CUBOID:
        return _read_cuboid(section, name, parameters)
    axis = AXES.index(section.text("axis", AXES))
    keys = ["length" if k == axis else "radius" for k in range(3)]
    entries = [section.values[key] for key in keys]
    factors = np.array([1.0 if k == axis else 2.0 for k in range(3)])
    single = [_entries(section, keys[k], [entries[k]], parameters) for k in range(3)]
    size = Linear(
        factors * np.concatenate([each.constant for each in single]),
        factors[:, None] * np.concatenate([each.slope for each in single]),
    )
    row, smallest, corner = _smallest(size, parameters)
    if smallest <= 0.0:
        raise section.error(
            f"'{keys[row]}' must be positive within the limits, is "
            f"{smallest / factors[row]:g} at gamma {corner}"
        )
    return Body(name, _linear(section, "centre", parameters), size, axis)


def _read_cuboid(section: Section, name: str, parameters: Sequence[Parameter]) -> Body:
    centre, size = (_linear(section, key, parameters) for key in ("centre", "size"))
    body = Body(name, centre, size)
    _, smallest, corner = _smallest(body.size, parameters)
    if smallest <= 0.0:
        raise section.error(
            f"'size' must be positive within the limits, is {body.size(corner)} at gamma {corner}"
        )
    return body


def read_alternatives(
    section: Section, parameters: Sequence[Parameter]
) -> dict[str, tuple[Body, ...]]:
    """Read kinds of something, each of them any number of cuboids."""
    found = {}
    for kind in section.values:
        bodies = section.section(kind)
        for name in bodies.values:
            bodies.section(name).allow(("centre", "size"))
        found[kind] = tuple(
            _read_cuboid(bodies.section(name), name, parameters) for name in bodies.values
        )
    return found


def read_surroundings(section: Section, parameters: Sequence[Parameter]) -> tuple[Body, ...]:
    """Read what stands around an object; a size may become 0, where there is no such body.

    A body that is ``mirrored`` is there twice: NAME_left, and NAME_right at the opposite y.
    """
    bodies = []
    for name in section.values:
        place = section.section(name)
        place.allow(("centre", "size"), ("mirrored",))
        centre, size = (_linear(place, key, parameters) for key in ("centre", "size"))
        _, smallest, corner = _smallest(size, parameters)
        if smallest < -ROUNDING:
            raise place.error(f"'size' must not be negative, is {size(corner)} at {corner}")
        if not place.flag("mirrored"):
            bodies.append(Body(name, centre, size))
            continue
        opposite = Linear(centre.constant * MIRROR, centre.slope * MIRROR[:, None])
        bodies += [Body(f"{name}_left", centre, size), Body(f"{name}_right", opposite, size)]
    return tuple(bodies)


def _smallest(
    size: Linear, parameters: Sequence[Parameter]
) -> tuple[int, float, tuple[float, ...]]:
    """Return which entry of a size is smallest within the limits, it (m), and where it is so."""
    limits = np.array([parameter.limits for parameter in parameters]).reshape(-1, 2)
    corners = np.where(size.slope > 0.0, limits[:, 0], limits[:, 1])
    least = size.constant + (size.slope * corners).sum(axis=1)
    row = int(least.argmin())
    return row, float(least[row]), tuple(corners[row].tolist())


def read_joints(
    section: Section, bodies: Sequence[Body], gamma: Sequence[Parameter]
) -> tuple[Joint, ...]:
    """Read the joints, and put each of them after the one that moves its parent."""
    names = [body.name for body in bodies]
    joints: list[Joint] = []
    for name in section.section("joints").values:
        joint = section.section("joints").section(name)
        kind = joint.text("type", JOINT_TYPES, REVOLUTE)
        joint.allow(*JOINT_KEYS[kind])
        axis = tuple(joint.numbers("axis", 3)) if kind != FIXED else (0.0, 0.0, 0.0)
        if kind != FIXED and not any(axis):
            raise joint.error("'axis' must not be 0")
        joints.append(
            Joint(
                name=name,
                type=kind,
                body=joint.text("body", names),
                parent=joint.text("parent", (WORLD, *names)),
                axis=axis,
                origin=(
                    _linear(joint, "origin", gamma)
                    if kind == REVOLUTE
                    else Linear(np.zeros(3), np.zeros((3, len(gamma))))
                ),
                limits=joint.limits("limits") if kind != FIXED else (0.0, 0.0),
            )
        )
    for number, each in enumerate(joints):
        if each.body in {before.body for before in joints[:number]}:
            raise section.error(f"joints: '{each.name}' moves '{each.body}', as another one does")
    ordered: list[Joint] = []
    while joints:
        moved = {joint.body for joint in joints}
        ready = [joint for joint in joints if joint.parent not in moved]
        if not ready:
            names = [joint.name for joint in joints]
            raise section.error(f"joints: {', '.join(names)} move each other in a loop")
        ordered += ready
        joints = [joint for joint in joints if joint.parent in moved]
    return tuple(ordered)


def read_stem(section: Section, bodies: Sequence[Body], joints: Sequence[Joint]) -> Stem | None:
    """Read what joins a body to its parent, if there is such a thing."""
    if "stem" not in section:
        return None
    stem = section.section("stem")
    stem.allow(("joint", "thickness"))
    between = {joint.name: joint for joint in joints if joint.parent != WORLD}
    if not between:
        raise stem.error("a stem needs a joint between two bodies, and there is none")
    joint = between[stem.text("joint", between)]
    by_name = {body.name: body for body in bodies}
    thickness = stem.number("thickness", 0.0)
    return Stem(joint, by_name[joint.body], by_name[joint.parent], thickness)


def read_input(model: Section) -> NetworkInput | None:
    """Read the settings of the paper's network's depth image, if there are any."""
    if "input" not in model:
        return None
    section = model.section("input")
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
