"""Set-up, build and ``run`` in environments and folders that are not as they would like them."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def bash(command: str, folder: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["bash", "-euc", command],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )


def test_another_ros_that_is_sourced_stays_outside(tmp_path: Path) -> None:
    (tmp_path / "rclpy.py").write_text("raise SystemExit('another ROS')")
    (tmp_path / "librcl.so").write_text("")
    (tmp_path / "cuda").mkdir()
    replay = "install/kmn_perception/lib/kmn_perception/replay"
    ended = bash(
        '. tools/environment.sh "$(<.venv/ros)"; echo "libraries $LD_LIBRARY_PATH"; '
        f"set +u; . install/setup.bash; {replay} nowhere",
        ROOT,
        ROS_DISTRO="humble",
        PYTHONPATH=str(tmp_path),
        AMENT_PREFIX_PATH=str(tmp_path),
        LD_LIBRARY_PATH=f"{tmp_path}:{tmp_path}/cuda",
    )
    assert "nowhere: no such bag" in ended.stderr, ended.stderr + ended.stdout
    assert f"libraries {tmp_path}/cuda\n" in ended.stdout


@pytest.mark.parametrize(
    "command",
    [
        "./run kmn_perception replay",
        "make --silent --old-file=checked test",
    ],
)
def test_programs_and_tests_start_without_another_ros(command: str, tmp_path: Path) -> None:
    """The real ``run`` and Makefile start a stub that tells whose Python packages it would find."""
    for file in ("run", "Makefile", "tools/environment.sh", "tools/executables.py"):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / file, tmp_path / file)
    listed = "src/kmn_perception/kmn_perception/executables.py"
    stub = "install/kmn_perception/lib/kmn_perception/replay"
    for file in (listed, stub, ".venv/bin/python", ".venv/ros", "install/setup.bash"):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).touch()
    shutil.copy(ROOT / listed, tmp_path / listed)
    (tmp_path / ".venv/ros").write_text("wheels")
    for program in (stub, ".venv/bin/python"):
        (tmp_path / program).write_text('#!/bin/sh\necho "packages: $PYTHONPATH"\n')
        (tmp_path / program).chmod(0o755)
    if command.startswith("./run"):
        (tmp_path / "Makefile").write_text("build:\n\t@true\n")
    (tmp_path / "other").mkdir()
    (tmp_path / "other/runpy.py").write_text("raise SystemExit('another ROS')")
    ended = bash(command, tmp_path, PYTHONPATH=str(tmp_path / "other"), ROS_DISTRO="humble")
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout.splitlines()[-1] == "packages: "


@pytest.mark.parametrize("name", ["Tür", "two words"])
def test_a_checkout_where_cmake_would_fail_is_refused_at_once(name: str, tmp_path: Path) -> None:
    tools = tmp_path / name / "tools"
    tools.mkdir(parents=True)
    shutil.copy(ROOT / "tools/setup.sh", tools)
    ended = bash("tools/setup.sh wheels nodes", tools.parent)
    assert ended.returncode == 1
    assert ended.stderr.startswith("set-up: the path of this checkout must consist of")
    assert str(tools.parent) in ended.stderr
    assert not (tools.parent / ".venv").exists()


def test_what_ros_has_is_not_built(tmp_path: Path) -> None:
    """The real build script starts a stub of colcon that tells what it would build."""
    index = tmp_path / ".venv/share/ament_index/resource_index/packages"
    for folder in (
        index,
        tmp_path / "tools",
        tmp_path / ".venv/bin",
        tmp_path / "src/ros_interfaces",
    ):
        folder.mkdir(parents=True)
    for file in ("build.sh", "environment.sh"):
        shutil.copy(ROOT / "tools" / file, tmp_path / "tools")
    colcon = tmp_path / ".venv/bin/colcon"
    colcon.write_text('#!/bin/sh\necho "$@"\n')
    colcon.chmod(0o755)
    build = "bash tools/build.sh wheels --missing control_msgs tf2_msgs vision_msgs"
    assert bash(build, tmp_path).stdout.endswith(
        "--packages-select control_msgs tf2_msgs vision_msgs\n"
    )
    (index / "tf2_msgs").touch()
    assert bash(build, tmp_path).stdout.endswith("--packages-select control_msgs vision_msgs\n")
    for package in ("control_msgs", "vision_msgs"):
        (index / package).touch()
    assert bash(build, tmp_path).stdout == ""


def test_files_of_numbas_cache_are_no_sources(tmp_path: Path) -> None:
    shutil.copy(ROOT / "Makefile", tmp_path)
    for package in ("kmn_msgs", "kmn_perception", "kmn_sim", "kmn_skill"):
        (tmp_path / "src" / package).mkdir(parents=True)
    for file in ("view.py", "view.fit-7.py311.nbi", "view.fit-7.py311.1.nbc"):
        (tmp_path / "src/kmn_perception" / file).write_text("")
    printed = bash("make --print-data-base --dry-run help", tmp_path).stdout
    (sources,) = (line for line in printed.splitlines() if line.startswith("PYTHON_SOURCES := "))
    assert "view.py" in sources
    assert ".nb" not in sources


def test_executables_are_known_before_there_is_an_environment() -> None:
    ask = "python3 -I tools/executables.py"
    assert bash(f"{ask} kmn_sim sim_node", ROOT).stdout == "simulation\n"
    assert bash(f"{ask} kmn_perception replay", ROOT).stdout == "\n"
    assert bash(f"{ask} kmn_sim replay", ROOT).returncode == 2
    assert "kmn_skill\n    skill_node\n" in bash(ask, ROOT).stdout
