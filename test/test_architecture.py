"""The rooms: who imports whom, where ROS and torch are, how long files are, and the map of it."""

from __future__ import annotations

import ast
import re
import statistics
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
# Rooms of each package, tier by tier: a module imports from its own room and from lower tiers.
TIERS = {
    "kmn_perception": (
        ("configuration",),
        ("command_line", "model"),
        ("scene", "network", "refinement", "transforms"),
        ("estimate", "sharing"),
        ("estimator", "doors", "rooms"),
        ("pipeline_interface", "model_choice"),
        ("pipeline", "door_pipeline"),
        ("training", "visualization"),
        ("evaluation",),
        ("ros",),
        ("experiments", "bags", "benchmark", "viewer"),
    ),
    "kmn_sim": (("control",), ("robot",), ("world",), ("sensors",), ("ros",), ("checks",)),
    "kmn_skill": (("planning",), ("execution",), ("ros",), ("experiments",)),
}
PACKAGES = tuple(TIERS)
ENTRY_POINTS = ("executables", "__main__", "__init__")
ROS = re.compile(r"rclpy|tf2_ros|kmn_msgs|rcl_interfaces|builtin_interfaces|.*_msgs|std_srvs")
BLAS = ("dot", "vdot", "linalg")
TORCH_ROOMS = ("network", "training")
MAX_LINES, MEDIAN_LINES = 300, 110


def sources(package: str) -> list[Path]:
    return sorted((ROOT / "src" / package / package).rglob("*.py"))


def room(path: Path, package: str) -> str:
    return path.relative_to(ROOT / "src" / package / package).parts[0].removesuffix(".py")


def imported(path: Path) -> Iterator[str]:
    """Yield the full names of all modules that a file imports."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def tier(package: str, name: str) -> int:
    return next(i for i, rooms in enumerate(TIERS[package]) if name in rooms)


@pytest.mark.parametrize("package", PACKAGES)
def test_every_module_stands_in_a_room(package: str) -> None:
    rooms = {name for tier in TIERS[package] for name in tier}
    assert {room(path, package) for path in sources(package)} == rooms | set(ENTRY_POINTS)
    for name in rooms:
        folder = ROOT / "src" / package / package / name
        if folder.is_dir():
            assert ast.get_docstring(ast.parse((folder / "__init__.py").read_text())) or "", name


@pytest.mark.parametrize("package", PACKAGES)
def test_imports_lead_downwards(package: str) -> None:
    wrong = []
    for path in sources(package):
        here = room(path, package)
        if here in ENTRY_POINTS:
            continue
        for name in imported(path):
            parts = name.split(".")
            if parts[0] != package or len(parts) < 2 or parts[1] == here:
                continue
            if tier(package, parts[1]) >= tier(package, here):
                wrong.append(f"{path.relative_to(ROOT)} imports {name}")
    assert not wrong


def test_simulator_and_skill_know_each_other_by_messages_only() -> None:
    for package, other in (("kmn_sim", "kmn_skill"), ("kmn_skill", "kmn_sim")):
        for path in sources(package):
            assert not any(name.startswith(other) for name in imported(path)), path
    for path in sources("kmn_perception"):
        assert not any(name.startswith(("kmn_sim", "kmn_skill")) for name in imported(path)), path


@pytest.mark.parametrize("package", PACKAGES)
def test_compiled_functions_need_no_scipy(package: str) -> None:
    """By SciPy numba compiles products of matrices and linear algebra; nodes do not have it."""
    wrong = []
    for path in sources(package):
        for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not isinstance(function, ast.FunctionDef):
                continue
            if not any("jit" in ast.unparse(each) for each in function.decorator_list):
                continue
            for node in ast.walk(function):
                is_product = isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult)
                if is_product or (isinstance(node, ast.Attribute) and node.attr in BLAS):
                    wrong.append(f"{path.relative_to(ROOT)}, {function.name}: {ast.unparse(node)}")
    assert not wrong


@pytest.mark.parametrize("package", PACKAGES)
def test_nothing_below_ros_imports_ros(package: str) -> None:
    for path in sources(package):
        here = room(path, package)
        if here in ENTRY_POINTS or tier(package, here) >= tier(package, "ros"):
            continue
        assert not any(ROS.fullmatch(name.split(".")[0]) for name in imported(path)), path


def test_torch_is_in_two_rooms() -> None:
    users = {
        (package, room(path, package))
        for package in PACKAGES
        for path in sources(package)
        if any(name.split(".")[0] == "torch" for name in imported(path))
    }
    assert users <= {("kmn_perception", name) for name in TORCH_ROOMS}


def test_robots_are_named_in_the_configuration_only() -> None:
    names = {word for file in ROOT.glob("config/robots/*.yaml") for word in file.stem.split("_")}
    assert "pr2" in names
    named = re.compile(rf"(?<![a-z])({'|'.join(sorted(names))})(?![a-z])", re.I)
    others = [*ROOT.glob("*.txt"), *ROOT.glob("tools/*"), *ROOT.glob("src/*/launch/*")]
    files = [ROOT / "Makefile", ROOT / "run", *others, *(p for n in PACKAGES for p in sources(n))]
    assert len(files) > 100
    found = {str(p.relative_to(ROOT)): named.findall(p.read_text()) for p in files if p.is_file()}
    assert not {path: words for path, words in found.items() if words}


def test_objects_are_named_in_the_configuration_only() -> None:
    """But for the paper's, whose name is a word that the code has for other things, too."""
    names = {
        file.stem
        for file in ROOT.glob("config/models/*.yaml")
        if "\nactions:" in file.read_text() and file.stem != "door"
    }
    assert names >= {"drawer", "room_door"}
    named = re.compile(rf"(?<![a-z_])({'|'.join(sorted(names))})(?![a-z_])", re.I)
    others = [*ROOT.glob("tools/**/*.py"), *ROOT.glob("src/*/launch/*"), ROOT / "run"]
    files = [*others, *(path for package in PACKAGES for path in sources(package))]
    found = {str(path.relative_to(ROOT)): named.findall(path.read_text()) for path in files}
    assert not {path: words for path, words in found.items() if words}


def test_files_are_short() -> None:
    code = {path: len(path.read_text().splitlines()) for p in PACKAGES for path in sources(p)}
    tests = [*ROOT.glob("src/*/test/*.py"), *ROOT.glob("test/*.py")]
    lengths = code | {path: len(path.read_text().splitlines()) for path in tests}
    assert not {str(path.relative_to(ROOT)): n for path, n in lengths.items() if n > MAX_LINES}
    assert statistics.median(code.values()) < MEDIAN_LINES


def test_every_answer_of_the_architecture_page_is_a_path() -> None:
    """The questions of a newcomer, each with one path."""
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (Where .*?\?) \| `([^`]+)` \|", page, re.M)
    assert len(rows) >= 10
    assert len({question for question, _ in rows}) == len(rows)
    for question, path in rows:
        assert (ROOT / path).exists(), f"{question} {path}"


def test_the_map_names_every_room() -> None:
    page = (ROOT / "docs/architecture.md").read_text(encoding="utf-8")
    for package, tiers in TIERS.items():
        for name in (name for rooms in tiers for name in rooms):
            path = f"src/{package}/{package}/{name}"
            written = path if (ROOT / path).is_dir() else f"{path}.py"
            assert f"`{written}`" in page, written
