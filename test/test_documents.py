"""README and docs state the parameters as the nodes have them, and name every executable."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from kmn_perception.configuration.node_parameters import parameter_table
from kmn_perception.rooms.sampling import KINDS

ROOT = Path(__file__).parents[1]
PAGES = {
    "README.md": ("morph_node", "kmn_perception"),
    "docs/simulation.md": ("sim_node", "kmn_sim"),
    "docs/skill.md": ("skill_node", "kmn_skill"),
}


@pytest.mark.parametrize("page", PAGES)
def test_the_parameters_stand_there_as_they_are_stated(page: str) -> None:
    node, _ = PAGES[page]
    text = (ROOT / page).read_text(encoding="utf-8")
    assert f"\n{parameter_table(node)}\n\n" in text, "make parameter-tables"


@pytest.mark.parametrize("page", PAGES)
def test_every_executable_stands_there(page: str) -> None:
    _, package = PAGES[page]
    table = runpy.run_path(str(ROOT / f"src/{package}/{package}/executables.py"))["EXECUTABLES"]
    text = (ROOT / page).read_text(encoding="utf-8")
    assert set(table) <= set(re.findall(r"^\| `(\w+)", text, flags=re.MULTILINE))


def test_every_kind_of_room_stands_there() -> None:
    text = (ROOT / "docs/rooms.md").read_text(encoding="utf-8")
    rows = "".join(re.findall(r"^\| (`.*?) \|", text, flags=re.MULTILINE))
    assert set(re.findall(r"`(\w+)`", rows)) == set(KINDS)
