"""The ROS parameters of the nodes: what ``config/nodes/NODE_parameters.yaml`` states of them.

These files have the format of generate_parameter_library, of which the types, ``read_only`` and the
validations below are known here.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from typing import Any, NamedTuple, TypeVar

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section, is_number

TYPES = {"bool": bool, "int": int, "double": float, "string": str, "double_array": list}
BOUNDS, ONE_OF, FIXED_SIZE, NOT_EMPTY = "bounds<>", "one_of<>", "fixed_size<>", "not_empty<>"
WIDTH = 96  # of a text for the terminal

Settings = TypeVar("Settings")


class ParameterError(ValueError):
    """Parameters that are wrong; the text names them and what was expected."""


class NodeParameter(NamedTuple):
    """A parameter as it is stated.

    Attributes
    ----------
    type
        One of ``TYPES``.
    read_only
        It can be given at the start only.
    bounds
        Of a number, both of them valid.
    choices
        Of a text; empty: any.
    size
        Of an array.
    not_empty
        A text must not be empty.
    """

    name: str
    type: str
    default: Any
    description: str
    read_only: bool
    bounds: tuple[float, float] | None
    choices: tuple[str, ...]
    size: int | None
    not_empty: bool

    @property
    def range(self) -> str:
        """What is valid, for people; empty if that is all of the type."""
        if self.bounds:
            return " to ".join(f"{v:.0f}" if v == round(v) else f"{v:g}" for v in self.bounds)
        return f"{self.size} numbers" if self.size else " or ".join(self.choices)

    @property
    def default_text(self) -> str:
        """The default as it is written in YAML."""
        if isinstance(self.default, bool):
            return str(self.default).lower()
        return '""' if self.default == "" else str(self.default)

    @property
    def meaning(self) -> str:
        """The description, and whether it can be given at the start only."""
        return self.description + " Only at the start." * self.read_only

    def check(self, value: Any) -> None:
        """Raise a `ParameterError` if a value is not valid."""
        expected = ""
        kind = TYPES[self.type]
        if type(value) is not kind and (kind, type(value)) != (float, int):
            expected = f"of type {self.type}"
        elif self.choices and value not in self.choices:
            expected = f"one of {', '.join(self.choices)}"
        elif self.bounds and not self.bounds[0] <= value <= self.bounds[1]:
            expected = f"within {self.range}"
        elif self.type == "double_array" and not (
            self.size in (None, len(value)) and all(map(is_number, value))
        ):
            expected = f"{self.size or 'some'} finite numbers"
        elif self.not_empty and not value:
            raise ParameterError(f"'{self.name}' is empty")
        if expected:
            found = f"'{value}'" if isinstance(value, str) else str(value)
            raise ParameterError(f"'{self.name}' must be {expected}, found {found}")


@cache
def load_node_parameters(node: str) -> dict[str, NodeParameter]:
    """Read the parameters of a node, in the order of its file.

    Raises
    ------
    ConfigurationError
        If the file is not as expected.
    """
    file = Section.load(resources.find("config/nodes", f"{node}_parameters"))
    file.allow([node])
    stated = file.section(node)
    return {name: _read(name, stated.section(name)) for name in stated.values}


def parameter_values(node: str, *files: str) -> dict[str, Any]:
    """Return the values of all parameters without a node: defaults, and what files say of them.

    Parameters
    ----------
    files
        ROS parameter files for any node (``/**``): names in ``config/nodes`` or paths.

    Raises
    ------
    ConfigurationError, ParameterError
        If a parameter is unknown or wrong.
    """
    parameters = load_node_parameters(node)
    values = {name: parameter.default for name, parameter in parameters.items()}
    for name in files:
        section = Section.load(resources.find("config/nodes", name)).section("/**")
        given = section.section("ros__parameters")
        given.allow((), parameters)
        values.update(given.values)
        try:
            check_values(node, values)
        except ParameterError as error:
            raise ParameterError(f"{given.place}: {error}") from error
    return values


def check_values(node: str, values: Mapping[str, Any]) -> None:
    """Raise a `ParameterError` if one of some values by name is not valid."""
    for name, parameter in load_node_parameters(node).items():
        parameter.check(values[name])


def pick(kind: type[Settings], values: Mapping[str, Any], prefix: str = "") -> Settings:
    """Make settings, a dataclass, of the parameters that are named as its fields."""
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    picked = {name: values[prefix + name] for name in names}
    return kind(**{name: tuple(v) if isinstance(v, list) else v for name, v in picked.items()})


def describe_parameters(node: str) -> str:
    """Return the parameters of a node as text for a terminal."""
    lines = ["ROS parameters, of which -p gives one and --params-file a file of them:"]
    for parameter in load_node_parameters(node).values():
        facts = [parameter.type, parameter.range, f"default {parameter.default_text}"]
        lines.append(f"  {parameter.name} ({', '.join(filter(None, facts))})")
        lines.append(textwrap.indent(textwrap.fill(parameter.meaning, WIDTH), " " * 6))
    return "\n".join(lines)


def parameter_table(node: str) -> str:
    """Return the parameters of a node as a table in Markdown."""
    lines = ["| parameter | type | default | range | meaning |", "| --- | --- | --- | --- | --- |"]
    for parameter in load_node_parameters(node).values():
        kind, default = parameter.type.replace("_", " "), parameter.default_text
        default = f"`{default}`" if default == '""' else default
        cells = [f"`{parameter.name}`", kind, default, parameter.range, parameter.meaning]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def _read(name: str, section: Section) -> NodeParameter:
    section.allow(["type", "default_value", "description"], ["read_only", "validation"])
    kind = section.text("type", TYPES)
    default = section.values["default_value"]
    if type(default) is not TYPES[kind]:
        raise section.error(f"'default_value' must be a {kind}, found {default!r}")
    valid = section.section("validation")
    valid.allow((), [BOUNDS, ONE_OF, FIXED_SIZE, NOT_EMPTY])
    parameter = NodeParameter(
        name=name,
        type=kind,
        default=default,
        description=section.text("description"),
        read_only=bool(section.values.get("read_only", False)),
        bounds=valid.limits(BOUNDS) if BOUNDS in valid else None,
        choices=tuple(valid.values[ONE_OF][0]) if ONE_OF in valid else (),
        size=valid.whole_number(FIXED_SIZE, 1, 100) if FIXED_SIZE in valid else None,
        not_empty=NOT_EMPTY in valid,
    )
    try:
        parameter.check(default)
    except ParameterError as error:
        raise section.error(f"default: {error}") from error
    return parameter
