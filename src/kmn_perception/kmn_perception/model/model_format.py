"""The format of a model's file, key by key: source of its JSON schema and of its reference."""

from __future__ import annotations

from typing import Any, NamedTuple

from kmn_perception.model.model_file import JOINT_KEYS, SHAPE_KEYS
from kmn_perception.model.parts import CUBOID, JOINT_TYPES, REVOLUTE, SHAPES
from kmn_perception.model.transformation import AXES, KINDS

REQUIRED = "required"
NUMBER: dict[str, Any] = {"type": "number"}
NUMBERS_2, NUMBERS_3 = (
    {"type": "array", "items": NUMBER, "minItems": n, "maxItems": n} for n in (2, 3)
)
ENTRY = {"oneOf": [NUMBER, {"type": "object", "additionalProperties": NUMBER}]}
LINEAR = {
    "type": "array",
    "items": ENTRY,
    "minItems": 3,
    "maxItems": 3,
}
TEXT: dict[str, Any] = {"type": "string"}


def _one_of(*values: str) -> dict[str, Any]:
    return {"enum": list(values)}


def _whole(low: int, high: int) -> dict[str, Any]:
    return {"type": "integer", "minimum": low, "maximum": high}


class Key(NamedTuple):
    """A key: the schema of its value, its unit or type for people, its default, what it means."""

    schema: dict[str, Any]
    unit: str
    default: str
    meaning: str


Keys = dict[str, Key]

LINEAR_UNIT = "3 entries, m"
PARAMETER: Keys = {
    "name": Key(TEXT, "text", REQUIRED, "Of the parameter; all names differ."),
    "unit": Key(_one_of("m", "rad", ""), '`m`, `rad` or `""`', REQUIRED, "Of its values."),
    "limits": Key(NUMBERS_2, "unit", REQUIRED, "Lowest and highest value; the prototype is at 0."),
}
THETA: Keys = {
    "name": PARAMETER["name"],
    "kind": Key(_one_of(*KINDS), ", ".join(f"`{kind}`" for kind in KINDS), REQUIRED,
                "What it does to the whole object; a scale s stretches by 1 + s."),
    "axis": Key(_one_of(*AXES), "`x`, `y`, `z`", REQUIRED,
                "Along which; rotations are about `z`, beside translations along x and y."),
    "limits": Key(NUMBERS_2, "m, rad, 1", REQUIRED, PARAMETER["limits"].meaning),
}  # fmt: skip
BODY: Keys = {
    "shape": Key(_one_of(*SHAPES), ", ".join(f"`{shape}`" for shape in SHAPES), f"`{CUBOID}`",
                 "Of the body; no scale of theta flattens a cylinder."),
    "centre": Key(LINEAR, LINEAR_UNIT, REQUIRED, "Of the body."),
    "size": Key(LINEAR, LINEAR_UNIT, "required of a cuboid",
                "Along x, y, z; positive within all limits."),
    "axis": Key(_one_of(*AXES), "`x`, `y`, `z`", "required of a cylinder", "Along which it lies."),
    "radius": Key(ENTRY, "an entry, m", "required of a cylinder",
                  "Positive within all limits, as its length."),
    "length": Key(ENTRY, "an entry, m", "required of a cylinder", "Along its axis."),
}  # fmt: skip
JOINT: Keys = {
    "type": Key(_one_of(*JOINT_TYPES), ", ".join(f"`{kind}`" for kind in JOINT_TYPES),
                f"`{REVOLUTE}`", "How it moves."),
    "body": Key(TEXT, "text", REQUIRED, "That it moves; no other joint moves it."),
    "parent": Key(TEXT, "text", REQUIRED,
                  "Body against which it moves, or `world`."),
    "axis": Key(NUMBERS_3, "any length but 0", "required unless fixed",
                "About or along which it moves."),
    "origin": Key(LINEAR, LINEAR_UNIT, "required if revolute", "A point on the axis."),
    "limits": Key(NUMBERS_2, "rad or m", "required unless fixed",
                  "Lowest and highest position; the bodies are given at 0."),
}  # fmt: skip
GRASP: Keys = {
    "body": Key(TEXT, "text", REQUIRED, "That a hand takes; the action's joints move it."),
    "axis": Key(_one_of(*AXES), "`x`, `y`, `z`", REQUIRED,
                "From one fingertip to the other, on the body's surface."),
    "offset": Key(NUMBERS_3, "m", "`[0, 0, 0]`", "Of the grasp from the body's centre."),
    "others": Key({"type": "array", "items": NUMBERS_3, "minItems": 1}, "list of m", "none",
                  "Offsets where it takes hold if no motion is found with the first, as of a wide "
                  "hand that would touch what is beside; tried in their order."),
}  # fmt: skip
UNLATCH: Keys = {
    "joint": Key(TEXT, "text", REQUIRED, "That is moved first."),
    "target": Key(NUMBER, "rad or m", REQUIRED, "Its position at which the other joint is free."),
}
ACTION: Keys = {
    "joint": Key(TEXT, "text", REQUIRED, "That is moved; its position is estimated."),
    "target": Key(NUMBER, "rad or m", REQUIRED, "To where, unless another position is asked for."),
    "grasp": Key({}, "see below", REQUIRED, "Where a hand takes hold."),
    "unlatch": Key({}, "see below", "nothing", "What is moved first, to let go a latch."),
    "force_limit": Key({"type": "number", "minimum": 1.0}, "N", "none",
                       "Largest force with which the hand moves what it holds: what takes more is "
                       "stuck. Where `handle_force` tells it, see [the skill](skill.md)."),
    "motions": Key(TEXT, "text", "the model's name",
                   "That are transferred: a name of `config/skill/prototypes/ROBOT`, or a file "
                   "beside this one."),
}  # fmt: skip
STEM: Keys = {
    "joint": Key(TEXT, "text", REQUIRED, "Between two bodies, on whose axis the stem lies."),
    "thickness": Key({"type": "number", "minimum": 0.0}, "m", REQUIRED, "Of the square bar."),
}
INPUT: Keys = {
    "width": Key(_whole(32, 4096), "pixels", REQUIRED, "Of the depth image."),
    "height": Key(_whole(32, 4096), "pixels", REQUIRED, "Of the depth image."),
    "near": Key({"type": "number", "minimum": 0.0}, "m", REQUIRED, "Depth that becomes 1."),
    "far": Key({"type": "number", "minimum": 0.0}, "m", REQUIRED, "Depth that becomes almost 0."),
    "contrast": Key({"type": "number", "minimum": 1.0}, "1", REQUIRED,
                    "By which depths are stretched about 1/2."),
    "supersampling": Key(_whole(1, 8), "1", REQUIRED, "Finer grid on which points are drawn."),
    "max_gap": Key(_whole(0, 64), "fine pixels", REQUIRED, "Holes up to this are closed."),
}  # fmt: skip
SURROUNDING: Keys = {
    "centre": Key(LINEAR, LINEAR_UNIT, REQUIRED, "Of the cuboid."),
    "size": Key(LINEAR, LINEAR_UNIT, REQUIRED, "Along x, y, z; 0 where there is no such body."),
    "mirrored": Key({"type": "boolean"}, "true or false", "`false`",
                    "There is another one at the opposite y: NAME_left and NAME_right."),
}  # fmt: skip
SURROUNDINGS: Keys = {
    "parameters": Key({}, "list", "none", "Nuisance parameters; keys as of `gamma`."),
    "bodies": Key({}, "by name", "none", "Cuboids around the object; see below."),
}
AT_LEAST_0: dict[str, Any] = {"type": "number", "minimum": 0.0}
MECHANICS: Keys = {
    "bodies": Key({}, "by name", REQUIRED, "Of each body that moves."),
    "joints": Key({}, "by name", REQUIRED, "Of joints; others move freely."),
}
BODY_MECHANICS: Keys = {
    "mass": Key({"type": "number", "exclusiveMinimum": 0.0}, "kg", REQUIRED, "Of the body."),
    "friction": Key(AT_LEAST_0, "1", "0.5", "Of its surface."),
    "spinning_friction": Key(AT_LEAST_0, "m", "0", "Against turning on a contact."),
}
JOINT_MECHANICS: Keys = {
    "friction": Key(AT_LEAST_0, "N m or N", "0", "Coulomb friction."),
    "spring": Key(AT_LEAST_0, "N m/rad or N/m", "0", "Of what brings it back to 0."),
    "damping": Key(AT_LEAST_0, "N m s/rad or N s/m", "0", "Of that spring."),
    "preload": Key(AT_LEAST_0, "N m or N", "0", "With which the spring begins."),
    "preload_width": Key({"type": "number", "exclusiveMinimum": 0.0}, "rad or m", "0.01",
                         "Over which the preload sets in."),
    "latch": Key({}, "see below", "none", "What holds it at 0."),
}  # fmt: skip
LATCH: Keys = {
    "catch": Key(AT_LEAST_0, "rad or m", REQUIRED, "Position within which it catches."),
    "effort": Key(AT_LEAST_0, "N m or N", REQUIRED, "That it bears; to more it gives."),
    "released_by": Key(TEXT, "text", "none", "Joint that lets it go; none of a magnet or a seal."),
    "release": Key(AT_LEAST_0, "rad or m", "0", "Position of that joint from which on it does."),
}
MODEL: Keys = {
    "name": Key(TEXT, "text", REQUIRED, "Of the model, its weights and its motions."),
    "camera": Key(TEXT, "text", REQUIRED,
                  "Canonical camera, from which the network sees: a name of `config/cameras`, or a "
                  "file beside this one."),
    "theta": Key({}, "list", REQUIRED, "Transformation parameters, of the whole object."),
    "gamma": Key({}, "list", "none", "Configuration parameters, of its bodies and joints."),
    "bodies": Key({}, "by name", REQUIRED, "Cuboids and cylinders that are rendered and fitted."),
    "joints": Key({}, "by name", "none", "What lets bodies move."),
    "actions": Key({}, "by name", "none", "What a robot can do."),
    "stem": Key({}, "see below", "none",
                "Bar along x that joins a body to its parent; touched, but not rendered."),
    "start": Key(_one_of("prototype", "centroid"), "`prototype`, `centroid`", "`prototype`",
                 "Where Algorithm 1 starts with the paper's network; ours starts at the points."),
    "symmetry": Key(_one_of("none", "quarter_turn"), "`none`, `quarter_turn`", "`none`",
                    "`quarter_turn`: the same when turned by 90 degrees with x and y scales "
                    "swapped."),
    "input": Key({}, "see below", "none", "Depth image of the paper's network; ours ignores it."),
    "alternatives": Key({"type": "object"}, "by name", "none",
                        "Kinds of handle and fitting of a door in its wall, each of some cuboids; "
                        "see the shipped one that has them."),
    "surroundings": Key({}, "see below", "none", "What stands around a door in its wall."),
    "mechanics": Key({}, "see below", "none",
                     "Masses, frictions and latches; see [simulation](simulation.md)."),
}  # fmt: skip
GROUPS: dict[str, tuple[str, Keys]] = {
    "The file": ("", MODEL),
    "`theta`": ("Each entry of the list.", THETA),
    "`gamma`": ("Each entry of the list.", PARAMETER),
    "`bodies`": ("Each body, by its name.", BODY),
    "`joints`": ("Each joint, by its name, in any order.",
                 JOINT),
    "`actions`": ("Each action, by its name.", ACTION),
    "`grasp` of an action": ("", GRASP),
    "`unlatch` of an action": ("", UNLATCH),
    "`stem`": ("", STEM),
    "`input`": ("", INPUT),
    "`mechanics`": ("", MECHANICS),
    "`bodies` of the mechanics": ("Each body, by its name.", BODY_MECHANICS),
    "`joints` of the mechanics": ("Each joint, by its name.", JOINT_MECHANICS),
    "`latch` of a joint": ("", LATCH),
    "`surroundings`": ("", SURROUNDINGS),
    "`bodies` of the surroundings": ("Each body, by its name.", SURROUNDING),
}  # fmt: skip


def tables() -> str:
    """Return the reference of all keys, in Markdown."""
    parts = []
    for title, (text, keys) in GROUPS.items():
        rows = ["| key | value | default | meaning |", "| --- | --- | --- | --- |"]
        rows += [
            f"| `{name}` | {key.unit} | {key.default} | {key.meaning} |"
            for name, key in keys.items()
        ]
        parts.append("\n\n".join(filter(None, (f"### {title}", text, "\n".join(rows)))))
    return "\n\n".join(parts) + "\n"


def schema() -> dict[str, Any]:
    """Return the JSON schema of a model's file."""
    action = _object(ACTION, grasp=_object(GRASP), unlatch=_object(UNLATCH))
    surroundings = _object(
        SURROUNDINGS, parameters=_list(_object(PARAMETER)), bodies=_by_name(_object(SURROUNDING))
    )
    joint_mechanics = _object(JOINT_MECHANICS, latch=_object(LATCH))
    mechanics = _object(
        MECHANICS, bodies=_by_name(_object(BODY_MECHANICS)), joints=_by_name(joint_mechanics)
    )
    model = _object(
        MODEL,
        mechanics=mechanics,
        theta={**_list(_object(THETA)), "minItems": 1},
        gamma=_list(_object(PARAMETER)),
        bodies={**_by_name(_body()), "minProperties": 1},
        joints=_by_name(_joint()),
        actions=_by_name(action),
        stem=_object(STEM),
        input=_object(INPUT),
        surroundings=surroundings,
    )
    draft = "http://json-schema.org/draft-07/schema#"
    return {"$schema": draft, "title": "A kinematic model", **model}


def _object(keys: Keys, **parts: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of a mapping with these keys, some of whose values are mappings."""
    return {
        "type": "object",
        "properties": {
            name: {**key.schema, **parts.get(name, {}), "description": key.meaning}
            for name, key in keys.items()
        },
        "required": [name for name, key in keys.items() if key.default == REQUIRED],
        "additionalProperties": False,
    }


def _joint() -> dict[str, Any]:
    """Return the schema of a joint: which keys it has depends on its type."""
    kinds = []
    for kind, (required, optional) in JOINT_KEYS.items():
        keys = {name: JOINT[name] for name in JOINT if name in (*required, *optional)}
        keys["type"] = keys["type"]._replace(schema={"const": kind})
        kinds.append({**_object(keys), "required": list(required)})
    is_revolute = {"properties": {"type": {"const": REVOLUTE}}}
    is_prismatic = {"properties": {"type": {"const": "prismatic"}}, "required": ["type"]}
    revolute, prismatic, fixed = kinds
    return {
        "type": "object",
        "if": is_revolute,
        "then": revolute,
        "else": {"if": is_prismatic, "then": prismatic, "else": fixed},
    }


def _body() -> dict[str, Any]:
    """Return the schema of a body: which keys it has depends on its shape."""
    cuboid, cylinder = (
        {
            **_object({name: BODY[name] for name in BODY if name in (*required, *optional)}),
            "required": list(required),
        }
        for required, optional in SHAPE_KEYS.values()
    )
    is_cuboid = {"properties": {"shape": {"const": CUBOID}}}
    return {"type": "object", "if": is_cuboid, "then": cuboid, "else": cylinder}


def _list(entry: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": entry}


def _by_name(entry: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": entry}
