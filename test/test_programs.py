"""Programs: how they are started, and what they say where the environment is not as needed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from ament_index_python.packages import get_package_prefix
from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from kmn_perception import executables
from kmn_perception.bags.rosbag2 import Message, write_bag
from kmn_perception.configuration.compile_cache import choose_compile_cache
from kmn_perception.ros.program import split_arguments
from programs import BROKEN_FILES, TIMEOUT

OFFLINE = {  # programs that communicate, with what they need to get that far
    "replay": ["nowhere"],
    "demo_bag": ["--out", "demo"],
    "benchmark": ["--frames", "1"],
}
WRITING = [  # programs and their arguments that name what is written
    *(("kmn_perception", name, "--out") for name in ("make_example_bag", "demo_bag", "results")),
    *(("kmn_perception", name, "--json") for name in ("evaluate", "evaluate_frames", "benchmark")),
    *(("kmn_sim", name, "--json") for name in ("check_perception", "check_noise", "benchmark")),
    ("kmn_sim", "snapshot", "--out"),
    ("kmn_skill", "demo", "--out"),
    ("kmn_skill", "evaluate", "--json"),
    ("kmn_skill", "evaluate", "--strip"),
    ("kmn_skill", "plan_doors", "--json"),
    ("kmn_skill", "make_prototypes", "file"),
]


def run(
    package: str, *arguments: str, folder: Path, without: str = "", **environment: str
) -> subprocess.CompletedProcess[str]:
    """Run ``python -m PACKAGE`` in a folder, without one environment variable and with others."""
    kept = {name: value for name, value in os.environ.items() if name != without}
    return subprocess.run(
        [sys.executable, "-m", package, *arguments],
        cwd=folder,
        env={**kept, **environment},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )


@pytest.mark.parametrize(
    ("arguments", "own", "ros"),
    [
        (["bag", "--topic-map", "/a:=/b"], ["bag", "--topic-map", "/a:=/b"], []),
        (["x", "--ros-args", "-p", "a:=1"], ["x"], ["--ros-args", "-p", "a:=1"]),
        (["--ros-args", "-p", "a:=1", "--", "x"], ["x"], ["--ros-args", "-p", "a:=1"]),
        (["--", "x", "--ros-args"], ["--", "x"], []),
    ],
)
def test_arguments_of_ros_are_those_after_its_mark(
    arguments: list[str], own: list[str], ros: list[str]
) -> None:
    assert split_arguments(arguments) == (own, ros)


def test_the_documents_line_replays_under_another_name(
    graph: Any, domain: int, tmp_path: Path
) -> None:
    page = (Path(__file__).parents[1] / "docs/programs.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^\./run (kmn_perception replay .* --topic-map .*)$", page, re.MULTILINE)
    package, executable, bag, *arguments = line.split()
    said = Message("/camera/depth/points", 10**18, serialize_message(String(data="hello")))
    write_bag(tmp_path / bag, {said.topic: "std_msgs/msg/String"}, [said])
    listener = graph.start(lambda context: Node("listener", context=context))
    heard: list[String] = []
    listener.create_subscription(String, "/points", heard.append, 10)
    process = subprocess.Popen(
        [f"{get_package_prefix(package)}/lib/{package}/{executable}", bag, *arguments],
        cwd=tmp_path,
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        stderr=subprocess.PIPE,
        text=True,
    )
    _, errors = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 0, errors
    assert graph.wait_for(lambda: heard)[0].data == "hello"


@pytest.mark.parametrize(
    ("package", "node", "parameter"),
    [
        ("kmn_perception", "morph_node", "cluster_concave_angle (double, 0 to 3, default 0.0)"),
        ("kmn_sim", "sim_node", "direction (string, pull or push, default pull)"),
        ("kmn_skill", "skill_node", "min_consistent_frames (int, 1 to 100, default 3)"),
    ],
)
def test_help_of_nodes_explains_the_parameters(
    package: str, node: str, parameter: str, tmp_path: Path
) -> None:
    pytest.importorskip("robotic")
    ended = run(package, node, "--help", folder=tmp_path, without="HOME")  # ROS would not start
    assert ended.returncode == 0, ended.stderr
    assert parameter in ended.stdout
    refused = run(package, node, "--helf", folder=tmp_path)
    assert refused.returncode == 2
    assert "unrecognized arguments: --helf" in refused.stderr


def test_an_unknown_executable_is_answered_with_those_there_are(tmp_path: Path) -> None:
    ended = run("kmn_perception", "morph", folder=tmp_path)
    assert ended.returncode == 2
    assert all(name in ended.stderr for name in executables.EXECUTABLES)


@pytest.mark.parametrize(("package", "name", "option"), WRITING)
def test_where_nothing_can_be_written_is_said_before_the_work(
    package: str,
    name: str,
    option: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("robotic")
    (tmp_path / "file").touch()
    arguments = [option] if option.startswith("-") else []
    monkeypatch.setattr(sys, "argv", [name, *arguments, f"{tmp_path}/file/below", "--unknown"])
    module, _ = import_module(f"{package}.executables").EXECUTABLES[name]
    with pytest.raises(SystemExit) as ended:
        import_module(module).main()
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert f"error: argument {option}: {tmp_path}/file/below is not a " in said


def test_a_missing_package_is_named_with_the_target_that_installs_it(tmp_path: Path) -> None:
    (tmp_path / "pybullet.py").write_text("raise ModuleNotFoundError(name='pybullet')")
    path = f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"
    ended = run("kmn_sim", "snapshot", folder=tmp_path, PYTHONPATH=path)
    expected = "snapshot: pybullet is missing; install it with: make setup-simulation\n"
    assert (ended.returncode, ended.stderr) == (1, expected)


@pytest.mark.parametrize(
    ("without", "environment", "text"),
    [
        ("HOME", {}, "set HOME or ROS_LOG_DIR"),
        ("", {"HOME": "/proc/nowhere"}, "set ROS_LOG_DIR to a folder that can be written"),
        ("", {"RMW_IMPLEMENTATION": "rmw_foreign_cpp"}, "unset RMW_IMPLEMENTATION"),
    ],
)
def test_an_environment_without_ros_is_said_in_one_line_with_the_remedy(
    without: str, environment: dict[str, str], text: str, tmp_path: Path
) -> None:
    ended = run(
        "kmn_perception", "replay", "nowhere", folder=tmp_path, without=without, **environment
    )
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert line.startswith("replay: ")
    assert text in line


@pytest.mark.parametrize("name", OFFLINE)
@pytest.mark.parametrize("text", BROKEN_FILES)
def test_a_missing_or_broken_parameter_file_is_named_in_one_line(
    name: str, text: str | None, tmp_path: Path
) -> None:
    if text is not None:
        (tmp_path / "broken.yaml").write_text(text)
    more = ["--ros-args", "--params-file", "broken.yaml"]
    ended = run("kmn_perception", name, *OFFLINE[name], *more, folder=tmp_path)
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"{name}: ")
    assert "broken.yaml" in line


def test_the_compile_cache_is_writable_and_changes_with_names_of_modules_and_classes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sources, module = tmp_path / "sources", tmp_path / "sources/module.py"
    sources.mkdir()

    def chosen() -> Path:
        monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
        choose_compile_cache(sources)
        return Path(os.environ["NUMBA_CACHE_DIR"])

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    module.write_text("class View:\n    size: int\n")
    first = chosen()
    assert first.is_dir()
    assert first.is_relative_to(tmp_path / "cache")
    module.write_text("class View:\n    size: float\n")
    assert chosen() == first
    module.write_text("class DepthView:\n    size: float\n")
    assert chosen() != first
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/nowhere")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    own = chosen()
    assert own.is_relative_to(tmp_path / "temporary")
    own.chmod(0o777)  # somebody else could put code there
    assert chosen() not in (own, first)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "mine")
    choose_compile_cache(sources)
    assert os.environ["NUMBA_CACHE_DIR"] == "mine"


@pytest.mark.parametrize("package", ["kmn_perception", "kmn_sim", "kmn_skill"])
def test_programs_compile_into_a_folder_that_can_be_written(package: str, tmp_path: Path) -> None:
    """As another user than the one who has installed them, whose HOME cannot be written."""
    unset = dict.fromkeys(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"), "")
    ended = subprocess.run(
        [sys.executable, "-c", f"import {package}.__main__, numba; print(numba.config.CACHE_DIR)"],
        env={**os.environ, **unset, "HOME": "/proc/nowhere", "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=TIMEOUT,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    assert Path(ended.stdout.strip()).is_relative_to(tmp_path), ended.stdout
