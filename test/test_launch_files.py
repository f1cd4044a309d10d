"""The launch files: what they start there is; where ROS has launch, they are launched as well."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from ament_index_python.packages import get_package_share_directory
from rclpy.node import Node

from kmn_perception.configuration.node_parameters import load_node_parameters
from programs import read_until

ROOT = Path(__file__).parents[1]
CAMERA, DEMO = "camera.launch.py", "door_demo.launch.py"
FILES = {CAMERA: "kmn_perception", DEMO: "kmn_skill"}


def constants(name: str) -> dict[str, Any]:
    """Return the literal constants of a launch file, which is not imported for that."""
    text = (ROOT / "src" / FILES[name] / "launch" / name).read_text(encoding="utf-8")
    found: dict[str, Any] = {}
    for statement in ast.parse(text).body:
        if isinstance(statement, ast.Assign) and isinstance(statement.targets[0], ast.Name):
            found[statement.targets[0].id] = ast.literal_eval(statement.value)
    return found


@pytest.mark.parametrize("name", FILES)
def test_launch_files_are_installed(name: str) -> None:
    installed = Path(get_package_share_directory(FILES[name]), "launch", name)
    written = ROOT / "src" / FILES[name] / "launch" / name
    assert installed.read_text(encoding="utf-8") == written.read_text(encoding="utf-8")


def test_arguments_are_parameters_and_topics_of_the_nodes() -> None:
    camera, demo = constants(CAMERA), constants(DEMO)
    assert set(camera["PARAMETERS"]) <= set(load_node_parameters("morph_node"))
    assert set(demo["SIMULATED"]) <= set(load_node_parameters("sim_node"))
    noises = load_node_parameters("sim_node")["noise"].choices
    assert demo["SIMULATED"]["noise"] in noises
    text = (ROOT / "docs/morph_node.md").read_text(encoding="utf-8")
    cells = re.findall(r"^\| (`[^|]+`) \| `\w+_msgs/", text, flags=re.MULTILINE)
    topics = {topic for cell in cells for topic in re.findall(r"`([^`]+)`", cell)}
    assert {topic for topic, _ in camera["TOPICS"].values()} <= topics


def test_the_document_names_the_arguments_for_a_camera() -> None:
    camera = constants(CAMERA)
    text = (ROOT / "docs/your_camera.md").read_text(encoding="utf-8")
    (section,) = re.findall(r"\n## One command\n(.*?)\n## ", text, flags=re.DOTALL)
    names = [*camera["OTHERS"], camera["SIM_TIME"], *camera["TOPICS"], *camera["PARAMETERS"]]
    assert [name for name in names if f"`{name}`" not in section] == []


if find_spec("launch_ros"):  # the wheels have none
    from launch import LaunchContext
    from launch.launch_description_sources import PythonLaunchDescriptionSource

    LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
file, *given = sys.argv[1:]
arguments = [tuple(text.split(":=", 1)) for text in given]
source = PythonLaunchDescriptionSource(file)
service = LaunchService(argv=given)
included = IncludeLaunchDescription(source, launch_arguments=arguments)
service.include_launch_description(LaunchDescription([included]))
sys.exit(service.run())
"""

    def file_of(name: str) -> str:
        return str(Path(get_package_share_directory(FILES[name]), "launch", name))

    @contextmanager
    def launched(name: str, domain: int, *arguments: str) -> Iterator[subprocess.Popen[str]]:
        """Launch a file as `ros2 launch` does, and interrupt it at the end of the context."""
        process = subprocess.Popen(
            [sys.executable, "-c", LAUNCH, file_of(name), *arguments],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        try:
            yield process
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=60.0)

    @pytest.mark.parametrize("name", FILES)
    def test_every_argument_has_a_description_and_a_default(name: str) -> None:
        source = PythonLaunchDescriptionSource(file_of(name))
        declared = source.get_launch_description(LaunchContext()).get_launch_arguments()
        assert len(declared) > 4
        assert [each.name for each in declared if len(each.description) < 10] == []
        assert [each.name for each in declared if each.default_value is None] == []

    def test_a_camera_has_its_own_topics_and_namespace(graph: Any, domain: int) -> None:
        given = ["namespace:=lab", "depth_image:=/camera/depth", "depth_image_transport:=raw"]
        observer = Node("observer", context=graph.context)
        with launched(CAMERA, domain, *given, "reliability:=reliable", "modle:=box") as process:
            printed = read_until("process started", process)
            assert "no argument 'modle', its value is ignored; did you mean 'model'?" in printed
            for topic in ("/camera/depth", "/lab/points", "/lab/depth/camera_info"):
                (info,) = graph.wait_for(
                    lambda topic=topic: observer.get_subscriptions_info_by_topic(topic)
                )
                assert (info.node_name, info.node_namespace) == ("morph_node", "/lab")
                assert info.qos_profile.reliability.name == "RELIABLE"
        observer.destroy_node()

    def test_the_values_of_a_parameter_file_go_before(domain: int, tmp_path: Path) -> None:
        file = tmp_path / "mine.yaml"
        file.write_text("/**: {ros__parameters: {model: box_a}}")
        with launched(CAMERA, domain, f"params_file:={file}", "model:=box") as process:
            assert "of model 'box_a'" in read_until("estimating", process)

    @pytest.mark.parametrize(
        ("name", "argument", "text"),
        [
            (CAMERA, "camera_pose:=sideways", "'camera_pose'|\"camera_pose\""),
            (CAMERA, "rectify:=perhaps", '"rectify" provided value "perhaps"'),
            (DEMO, "direction:=sideways", '"direction" provided value "sideways"'),
            (DEMO, "robot:=nobody", "'nobody' is neither a file nor one of the shipped"),
            (DEMO, "seed:=first", "'seed' to 'first'"),
        ],
    )
    def test_a_wrong_argument_ends_the_launch_and_is_named(
        domain: int, name: str, argument: str, text: str
    ) -> None:
        with launched(name, domain, argument) as process:
            printed, _ = process.communicate(timeout=120.0)
        assert re.search(text, printed), printed
        assert "Traceback" not in printed

    def test_the_demo_starts_where_there_is_no_rviz(domain: int) -> None:
        with launched(DEMO, domain) as process:
            printed = read_until("estimating morphing", process)
        assert ("rviz2 is not installed" in printed) != ("[rviz2-" in printed)
