"""package.xml names what the packages import, by ROS package or rosdep key, and nothing else."""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("kmn_perception", "kmn_sim", "kmn_skill")
CITATION, CHANGES = ROOT / "CITATION.cff", ROOT / "CHANGELOG.md"
KEYS = {  # modules whose key is not their name
    "PIL": "python3-pil",
    "cv2": "python3-opencv",
    "open3d": "python3-open3d-pip",
    "pybullet": "python3-pybullet-pip",
    "pydantic_core": "python3-pydantic",
    "rosbags": "python3-rosbags-pip",
    "tf2_ros": "tf2_ros_py",
    "toppra": "python3-toppra-pip",
}
LIBRARIES = {
    "cloudpickle", "hypothesis", "jsonschema", "matplotlib", "networkx", "numba", "numpy",
    "pydantic", "pytest", "scipy", "setuptools", "torch", "tqdm", "websockets", "yaml",
}  # fmt: skip
WITHOUT_KEY = {"av", "robotic", "safetensors", "small_gicp", "submitit", "trimesh", "viser"}
STARTED = {"kmn_skill": {"kmn_sim", "rviz2"}}  # as programs
SUBMODULES = {"torch.utils.tensorboard": "python3-tensorboard-pip"}  # that need something else


def keys(files: list[Path], *known: str) -> set[str]:
    """Return the keys of all that files import from elsewhere."""
    found: set[str] = set()
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                names = [node.module or ""]
            else:
                continue
            found |= {SUBMODULES[name] for name in names if name in SUBMODULES}
            found |= {name.split(".")[0] for name in names}
    found -= {*sys.stdlib_module_names, *WITHOUT_KEY, *known}
    return {KEYS.get(n, f"python3-{n}" if n in LIBRARIES else n) for n in found}


def stated(package: str, *kinds: str) -> set[str]:
    """Return what a package's file names as a dependency of some kinds."""
    tree = ElementTree.parse(ROOT / "src" / package / "package.xml")
    return {each.text or "" for kind in kinds for each in tree.findall(kind)}


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_used_is_what_is_named(package: str) -> None:
    folder = ROOT / "src" / package
    files = [*folder.glob(f"{package}/**/*.py"), *folder.glob("launch/*.py"), folder / "setup.py"]
    used = keys(files, package) | STARTED.get(package, set())
    assert stated(package, "depend", "exec_depend") == used


@pytest.mark.parametrize("package", [*PACKAGES, "kmn_msgs"])
def test_what_the_tests_use_is_named(package: str) -> None:
    files = list((ROOT / "src" / package).glob("test/*.py"))
    used = keys(files, package, *(file.stem for file in files))
    named = stated(package, "depend", "exec_depend", "test_depend")
    assert used - named == set()
    assert stated(package, "test_depend") - used == set()


def test_the_interfaces_name_what_they_are_built_of() -> None:
    text = (ROOT / "src/kmn_msgs/CMakeLists.txt").read_text(encoding="utf-8")
    found = set(re.findall(r"find_package\((\w+)", text))
    named = stated("kmn_msgs", "buildtool_depend", "depend")
    assert found <= named
    assert named - found == {"action_msgs"}  # which actions need


def test_the_maintainer_is_a_placeholder_that_reaches_nobody() -> None:
    files = [*ROOT.glob("src/**/package.xml"), *ROOT.glob("src/*/setup.py")]
    assert len(files) >= 10
    for file in files:
        addresses = re.findall(r"[\w.+-]+@[\w.-]+", file.read_text(encoding="utf-8"))
        assert addresses == ["maintainers@example.org"], file


def test_all_files_state_one_version() -> None:
    patterns = {"package.xml": r"<version>(.*?)</version>", "setup.py": r'version="(.*?)"'}
    packages = ("kmn_msgs", *PACKAGES)
    files = [f for p in packages for name in patterns if (f := ROOT / "src" / p / name).exists()]
    stated = {f: re.findall(patterns[f.name], f.read_text(encoding="utf-8")) for f in files}
    stated[CITATION] = re.findall(r"^version: (.*)$", CITATION.read_text("utf-8"), re.M)
    newest = CHANGES.read_text("utf-8").split("\n## ")[1]
    stated[CHANGES] = re.findall(r"\d+\.\d+\.\d+", newest.splitlines()[0])
    assert len(stated) == 9
    assert len({tuple(versions) for versions in stated.values()}) == 1, stated
