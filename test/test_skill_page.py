"""The page about the skill names its parameters with their defaults, and its executables."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_skill import executables

pytest.importorskip("robotic")
from kmn_skill.ros.skill_node_parameters import DESCRIPTORS  # noqa: E402

PAGE = (Path(__file__).parents[1] / "docs/skill.md").read_text(encoding="utf-8")


def test_every_parameter_stands_there_with_its_default_and_range() -> None:
    file = yaml.safe_load(resources.find("config/nodes", "skill_node").read_text())
    found = re.findall(
        r"^\| `(\w+)` \| (?:string|bool|int|double) \| (.*?) \| (.*?) ?\|", PAGE, flags=re.MULTILINE
    )
    rows = {name: (default, limits) for name, default, limits in found}
    defaults = file["/**"]["ros__parameters"]
    assert rows.keys() == defaults.keys() == DESCRIPTORS.keys()
    for name, (default, limits) in rows.items():
        assert yaml.safe_load(default) == defaults[name], name
        descriptor = DESCRIPTORS[name]
        for allowed in (*descriptor.floating_point_range, *descriptor.integer_range):
            assert limits == f"{allowed.from_value:g} to {allowed.to_value:g}", name
        assert f"| {descriptor.description}" in PAGE


def test_every_executable_stands_there() -> None:
    rows = set(re.findall(r"^\| `(\w+)", PAGE, flags=re.MULTILINE))
    assert {"skill_node", "demo", "evaluate"} <= rows
    assert callable(executables.evaluate)
