"""What launch files share: arguments that are parameters of nodes, and who mistypes one.

The only module that imports launch, which only a full ROS 2 has.
"""

from __future__ import annotations

import difflib
from collections.abc import Collection

from launch import LaunchContext
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.logging import get_logger
from launch.substitutions import LaunchConfiguration
from launch_ros.parameter_descriptions import ParameterValue

from kmn_perception.configuration.node_parameters import load_node_parameters

TRUTHS = ("true", "false")


def parameter_argument(node: str, name: str, default: str | None = None) -> DeclareLaunchArgument:
    """Declare an argument that is a parameter of a node, with its default, meaning and choices.

    Parameters
    ----------
    default
        Instead of the parameter's.
    """
    stated = load_node_parameters(node)[name]
    if default is None:
        default = "" if stated.default == "" else stated.default_text
    return DeclareLaunchArgument(
        name,
        default_value=default,
        description=stated.description,
        choices=TRUTHS if stated.type == "bool" else stated.choices or None,
    )


def parameter_value(node: str, name: str) -> ParameterValue | LaunchConfiguration:
    """Return the value of such an argument; one of a wrong type is for the node to refuse."""
    value = LaunchConfiguration(name)
    is_text = load_node_parameters(node)[name].type == "string"
    return ParameterValue(value, value_type=str) if is_text else value


def warn_of_foreign(names: Collection[str]) -> OpaqueFunction:
    """Warn of arguments that were given and that there are not, which launch ignores."""

    def warn(context: LaunchContext) -> None:
        for given in (text.partition(":=")[0] for text in context.argv if ":=" in text):
            if given not in names:
                near = difflib.get_close_matches(given, names, 1)
                hint = f"; did you mean '{near[0]}'?" if near else ""
                get_logger("arguments").warning(
                    f"there is no argument '{given}', its value is ignored{hint}"
                )

    return OpaqueFunction(function=warn)
