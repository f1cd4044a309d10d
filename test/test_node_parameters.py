"""Parameters as they are stated: what is told of them, and overrides that nobody reads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterType
from rclpy.node import Node
from rclpy.parameter import Parameter

from kmn_perception.configuration.node_parameters import (
    NodeParameter,
    ParameterError,
    load_node_parameters,
    parameter_values,
)
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.ros.parameter_files import useless_files
from kmn_perception.ros.parameters import declare_parameters, foreign_parameters
from kmn_perception.ros.reports import report_periodically

NODES = ("morph_node", "sim_node", "skill_node", "viewer")


def declared(graph: Any, stated: str, **overrides: Any) -> Node:
    """Return a node that has declared the parameters of another one."""
    given = [Parameter(name, value=value) for name, value in overrides.items()]
    node = Node("stated", context=graph.context, parameter_overrides=given)
    declare_parameters(node, stated)
    return node


@pytest.mark.parametrize("stated", NODES)
def test_nodes_declare_what_is_stated(graph: Any, stated: str) -> None:
    node = declared(graph, stated)
    for name, parameter in load_node_parameters(stated).items():
        (descriptor,) = node.describe_parameters([name])
        assert descriptor.description == parameter.description
        assert descriptor.read_only == parameter.read_only
        value = node.get_parameter(name).value
        assert (list(value) if parameter.type == "double_array" else value) == parameter.default
        ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
        numeric = (ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_INTEGER)
        assert len(ranges) == (descriptor.type in numeric), name
        assert [(r.from_value, r.to_value) for r in ranges] == (
            [parameter.bounds] if parameter.bounds else []
        )
        if parameter.choices:
            assert descriptor.additional_constraints == " or ".join(parameter.choices)
    node.destroy_node()


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"objects": "some"}, "'objects' must be one of nearest, all, found 'some'"),
        ({"crop_max": [1.0, 1.0]}, "'crop_max' must be 3 finite numbers, found"),
        ({"world_frame": ""}, "'world_frame' is empty"),
    ],
)
def test_what_ros_does_not_check_is_checked(graph: Any, values: dict[str, Any], text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        declared(graph, "morph_node", **values)


def test_overrides_of_unknown_parameters_are_named_with_the_nearest_known(graph: Any) -> None:
    node = declared(graph, "morph_node", obects="all", wheels=4, objects="all", use_sim_time=False)
    assert foreign_parameters(node) == [
        "there is no parameter 'obects', its value is ignored; did you mean 'objects'?",
        "there is no parameter 'wheels', its value is ignored",
    ]
    node.destroy_node()


@pytest.mark.parametrize(
    ("text", "useful"),
    [
        ("/**: {ros__parameters: {model: box}}", True),
        ("morph_node: {ros__parameters: {model: box}}", False),
        ("/lab/morph_node: {ros__parameters: {model: box}}", True),
        ("lab: {morph_node: {ros__parameters: {model: box}}}", True),
        ("/*/morph_node: {ros__parameters: {model: box}}", True),
        ("/lab/**: {ros__parameters: {model: box}}", True),
        ("/lab/morph: {ros__parameters: {model: box}}", False),
        ("sim_node: {ros__parameters: {model: box}}", False),
        ("", False),
    ],
)
def test_files_without_parameters_for_a_node_are_told(
    tmp_path: Path, text: str, useful: bool
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(text)
    told = useless_files("/lab/morph_node", ["--ros-args", "--params-file", str(file)])
    assert bool(told) != useful
    assert all(f"{file} holds no parameters for /lab/morph_node" in line for line in told)


@pytest.mark.parametrize("text", ["a: !foo 5.0", "a: 1\n---\nb: 2", "a: =", "a: 2024-13-45"])
def test_files_that_only_ros_understands_give_no_warning(tmp_path: Path, text: str) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(text)
    assert useless_files("/morph_node", ["--params-file", str(file)]) == []


def test_a_pipe_that_ros_has_read_gives_no_warning(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    assert useless_files("/morph_node", ["--params-file", str(pipe)]) == []


def test_values_without_a_node_are_those_of_the_files(tmp_path: Path) -> None:
    values = parameter_values("morph_node", "morph_node_tabletop")
    assert (values["model"], values["refine"]) == ("box", True)
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("/**: {ros__parameters: {modle: box}}")
    with pytest.raises(ConfigurationError, match="unknown key 'modle'"):
        parameter_values("morph_node", str(wrong))


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
def test_bounds_hold_for_values_without_a_node(value: float) -> None:
    share = NodeParameter("share", "double", 0.5, "", False, (0.0, 1.0), (), None, False)
    with pytest.raises(ParameterError, match="'share' must be within 0 to 1, found"):
        share.check(value)


def test_two_nodes_of_one_name_are_reported(graph: Any, client: Any) -> None:
    twins = [
        graph.start(lambda context: Node("morph_node_twin", context=context)) for _ in range(2)
    ]
    for twin in twins:
        report_periodically(twin, lambda: [])
    text = "2 nodes are named /morph_node_twin"
    graph.wait_for(lambda: sum(text in line for line in client.log) == 2)
    client.reports.clear()
    graph.wait_for(
        lambda: sum(report["nodes_of_this_name"] == "2" for report in client.reports) > 4
    )
    assert sum(text in line for line in client.log) == 2
