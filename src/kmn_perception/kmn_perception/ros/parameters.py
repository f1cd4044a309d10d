"""What the parameters of all nodes share: how they are declared, read and set."""

from __future__ import annotations

import difflib
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from kmn_perception.configuration.node_parameters import (
    NodeParameter,
    check_values,
    load_node_parameters,
)


def declare_parameters(node: Node, stated: str) -> dict[str, Any]:
    """Declare parameters as they are stated, and return their values.

    Parameters
    ----------
    stated
        Name of the node whose parameters they are, see `load_node_parameters`.

    Raises
    ------
    ParameterException, ParameterError
        If the user's value of a parameter is of another type, or not valid.
    """
    node.declare_parameters(
        "",
        [
            (name, parameter.default, _descriptor(parameter))
            for name, parameter in load_node_parameters(stated).items()
        ],
    )
    return read_parameters(node, stated)


def read_parameters(node: Node, stated: str, changes: Sequence[Parameter] = ()) -> dict[str, Any]:
    """Return the values of parameters by name, as they are or would be after some changes.

    Raises
    ------
    ParameterError
        If a value is not valid.
    """
    values = {name: node.get_parameter(name).value for name in load_node_parameters(stated)}
    values.update((change.name, change.value) for change in changes if change.name in values)
    values = {name: list(v) if isinstance(v, array) else v for name, v in values.items()}
    check_values(stated, values)
    return values


def foreign_parameters(node: Node) -> list[str]:
    """Return a warning for each parameter that a user has given and the node does not have."""
    known = list(node.get_parameters_by_prefix(""))
    texts = []
    for name in node._parameter_overrides:  # rclpy tells them to nobody else
        if not node.has_parameter(name):
            near = difflib.get_close_matches(name, known, 1)
            hint = f"; did you mean '{near[0]}'?" if near else ""
            texts.append(f"there is no parameter '{name}', its value is ignored{hint}")
    return texts


def request_to_set(values: Mapping[str, Any]) -> SetParametersAtomically.Request:
    """Return the request to set parameters of another node, all or none."""
    return SetParametersAtomically.Request(
        parameters=[Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
    )


def _descriptor(parameter: NodeParameter) -> ParameterDescriptor:
    """Return what ROS can be told of a parameter."""
    descriptor = ParameterDescriptor(
        description=parameter.description, read_only=parameter.read_only
    )
    if parameter.bounds is None:
        descriptor.additional_constraints = parameter.range
    elif parameter.type == "int":
        first, last = map(int, parameter.bounds)
        descriptor.integer_range = [IntegerRange(from_value=first, to_value=last, step=1)]
    else:
        low, high = parameter.bounds
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    return descriptor
