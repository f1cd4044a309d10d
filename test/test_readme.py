"""The README names what there is: parameters with their defaults, and executables."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from kmn_perception import executables
from kmn_perception.configuration import resources
from kmn_perception.ros.morph_node_parameters import DESCRIPTORS

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")


def test_every_parameter_stands_there_with_its_default() -> None:
    file = yaml.safe_load(resources.find("config/nodes", "morph_node").read_text())
    rows = dict(re.findall(r"^\| `(\w+)` \| [\w ]+ \| (.*?) \|", README, flags=re.MULTILINE))
    assert rows.keys() == DESCRIPTORS.keys()
    for name, default in file["/**"]["ros__parameters"].items():
        text = rows[name].strip("`")
        assert (yaml.safe_load(text) if text != '""' else "") == default, name


def test_every_executable_stands_there() -> None:
    rows = set(re.findall(r"^\| `(\w+)", README, flags=re.MULTILINE))
    names = {name for name in vars(executables) if callable(getattr(executables, name))}
    names = {name for name in names if name.islower() and not name.startswith("_")}
    assert names <= rows
