"""What the parameters of all nodes share: how they are described, declared, read and set."""

from __future__ import annotations

from array import array
from collections.abc import Collection, Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section

Settings = TypeVar("Settings")


class ParameterError(ValueError):
    """Parameters that are wrong; the text names them and what was expected."""


def anything(
    description: str, constraints: str = "", read_only: bool = False
) -> ParameterDescriptor:
    """Describe a parameter of which only the type is fixed."""
    return ParameterDescriptor(
        description=description, additional_constraints=constraints, read_only=read_only
    )


def choice(
    description: str, choices: Collection[str], read_only: bool = False
) -> ParameterDescriptor:
    """Describe a text that is one of some; `check_choice` checks it."""
    return anything(description, " or ".join(choices), read_only)


def real(description: str, low: float, high: float, read_only: bool = False) -> ParameterDescriptor:
    """Describe a number within [low, high]."""
    limits = FloatingPointRange(from_value=low, to_value=high)
    return ParameterDescriptor(
        description=description, floating_point_range=[limits], read_only=read_only
    )


def whole(description: str, low: int, high: int) -> ParameterDescriptor:
    """Describe a whole number within [low, high]."""
    limits = IntegerRange(from_value=low, to_value=high, step=1)
    return ParameterDescriptor(description=description, integer_range=[limits])


def declare_parameters(
    node: Node, file: str, descriptors: Mapping[str, ParameterDescriptor]
) -> dict[str, Any]:
    """Declare parameters with the defaults of a file in ``config/nodes``, and return their values.

    Raises
    ------
    ParameterException
        If the user's value of a parameter is of another type or out of its range.
    """
    section = Section.load(resources.find("config/nodes", file))
    defaults = section.section("/**").section("ros__parameters")
    defaults.allow(descriptors)
    node.declare_parameters(
        "", [(name, defaults.values[name], descriptors[name]) for name in descriptors]
    )
    return read_parameters(node, descriptors)


def read_parameters(
    node: Node, names: Collection[str], changes: Sequence[Parameter] = ()
) -> dict[str, Any]:
    """Return the values of parameters by name, as they are or would be after some changes."""
    values = {name: node.get_parameter(name).value for name in names}
    values.update((change.name, change.value) for change in changes if change.name in values)
    return {name: list(v) if isinstance(v, array) else v for name, v in values.items()}


def check_choice(name: str, value: str, choices: Collection[str]) -> None:
    """Raise a `ParameterError` if a value is none of its choices."""
    if value not in choices:
        raise ParameterError(f"'{name}' must be one of {', '.join(choices)}, found '{value}'")


def pick(kind: type[Settings], values: Mapping[str, Any], prefix: str = "") -> Settings:
    """Make settings, a dataclass, of the parameters that are named as its fields."""
    names = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    picked = {name: values[prefix + name] for name in names}
    return kind(**{name: tuple(v) if isinstance(v, list) else v for name, v in picked.items()})


def request_to_set(values: Mapping[str, Any]) -> SetParametersAtomically.Request:
    """Return the request to set parameters of another node, all or none."""
    return SetParametersAtomically.Request(
        parameters=[Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
    )
