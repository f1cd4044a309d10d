"""The page about the simulator names its parameters with their defaults, and its executables."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

from kmn_perception.configuration import resources
from kmn_sim import executables
from kmn_sim.ros.sim_node_parameters import DESCRIPTORS

PAGE = (Path(__file__).parents[1] / "docs/simulation.md").read_text(encoding="utf-8")


def test_every_parameter_stands_there_with_its_default() -> None:
    file = yaml.safe_load(resources.find("config/nodes", "sim_node").read_text())
    rows = dict(re.findall(r"^\| `(\w+)` \| [\w ]+ \| (.*?) \|", PAGE, flags=re.MULTILINE))
    for name, default in file["/**"]["ros__parameters"].items():
        text = rows[name].strip("`")
        assert (yaml.safe_load(text) if text != '""' else "") == default, name
    assert file["/**"]["ros__parameters"].keys() == DESCRIPTORS.keys()


def test_every_file_and_folder_that_it_names_is_there() -> None:
    root = Path(__file__).parents[1]
    for name in re.findall(r"`(config/[\w/]+\.yaml)`", PAGE):
        assert (root / name).is_file(), name
    table = PAGE[PAGE.index("| folder | content |") :]
    folders = re.findall(r"^\| `(\w+)`", table, flags=re.MULTILINE)
    package = root / "src/kmn_sim/kmn_sim"
    assert set(folders) == {file.parent.name for file in package.glob("*/__init__.py")}


def test_every_executable_stands_there() -> None:
    rows = set(re.findall(r"^\| `(\w+)", PAGE, flags=re.MULTILINE))
    assert {"sim_node", "snapshot", "check_perception", "benchmark", "robot_description"} <= rows
    assert callable(executables.sim_node)
