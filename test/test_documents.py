"""The documents state the parameters as the nodes have them, and name every executable."""

from __future__ import annotations

import re
import runpy
from pathlib import Path
from typing import get_args

import pytest

from kmn_perception.configuration.node_parameters import parameter_table
from kmn_perception.configuration.resources import share_directory
from kmn_perception.rooms.sampling import KINDS
from kmn_perception.transforms.transform import Reason

ROOT = Path(__file__).parents[1]
NODES = {
    "docs/morph_node.md": "morph_node",
    "docs/simulation.md": "sim_node",
    "docs/skill.md": "skill_node",
    "docs/viewer.md": "viewer",
}
EXECUTABLES = {
    "docs/programs.md": "kmn_perception",
    "docs/simulation.md": "kmn_sim",
    "docs/skill.md": "kmn_skill",
}


@pytest.mark.parametrize("page", NODES)
def test_the_parameters_stand_there_as_they_are_stated(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert f"\n{parameter_table(NODES[page])}\n" in text, "make parameter-tables"


def executables(package: str) -> set[str]:
    """Return the names of a package's executables."""
    return set(runpy.run_path(str(ROOT / f"src/{package}/{package}/executables.py"))["EXECUTABLES"])


@pytest.mark.parametrize("page", EXECUTABLES)
def test_every_executable_stands_there(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert executables(EXECUTABLES[page]) <= set(
        re.findall(r"^\| `(\w+)", text, flags=re.MULTILINE)
    )


def test_what_is_to_be_run_is_an_executable_and_has_its_environment() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *ROOT.glob("src/*/kmn_*/**/*.py")]
    texts = [page.read_text(encoding="utf-8") for page in pages]
    shown = {pair for text in texts for pair in re.findall(r"\./run (kmn_\w+) ([a-z]\w*)", text)}
    assert shown >= {("kmn_perception", "replay"), ("kmn_skill", "plan_doors")}
    assert [pair for pair in shown if pair[1] not in executables(pair[0])] == []
    unset = [page for page, text in zip(pages, texts, strict=True) if "python -m kmn_" in text]
    assert [page.name for page in unset if page.name != "__main__.py"] == []


def test_the_shared_memory_that_a_process_takes_stands_there() -> None:
    profile = (share_directory() / "config/fastdds.xml").read_text(encoding="utf-8")
    (size,) = re.findall(r"<segment_size>(\d+)</segment_size>", profile)
    text = (ROOT / "docs/performance.md").read_text(encoding="utf-8")
    stated = re.search(r"needs (\d+) MiB of `/dev/shm` for each process", text)
    assert stated is not None
    assert int(stated[1]) * 2**20 == int(size)


def test_every_kind_of_room_stands_there() -> None:
    text = (ROOT / "docs/rooms.md").read_text(encoding="utf-8")
    rows = "".join(re.findall(r"^\| (`.*?) \|", text, flags=re.MULTILINE))
    assert set(re.findall(r"`(\w+)`", rows)) == set(KINDS)


def test_every_reason_why_a_pose_is_not_known_stands_there() -> None:
    text = (ROOT / "docs/your_camera.md").read_text(encoding="utf-8")
    (rows,) = re.findall(r"\| reason \| what is wrong \|\n(.*?)\n\n", text, flags=re.DOTALL)
    stated = re.findall(r"^\| `(\w+)` \|", rows, flags=re.MULTILINE)
    assert sorted(stated) == sorted(set(get_args(Reason)) - {"invalid"})


def test_every_path_that_is_named_is_there() -> None:
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    paths = {
        (page.name, path)
        for page in pages
        for path in re.findall(
            r"`((?:config|docs|src|test|tools)/[\w./]+)`", page.read_text("utf-8")
        )
        if not re.search(r"NAME|ROBOT|USE", path)
    }
    assert len(paths) > 100
    assert [(page, path) for page, path in paths if not (ROOT / path).exists()] == []


def test_the_code_that_contributors_are_led_to_is_there() -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    led = re.findall(r"`(\w+)`\s+\(`(src/[\w/.]+\.py)`\)", text)
    assert len(led) == 5
    for name, path in led:
        defined = rf"^(?:class {name}\b|{name}\b.* = )"
        assert re.search(defined, (ROOT / path).read_text("utf-8"), re.MULTILINE), (name, path)
