"""Every kind of file that is read: valid ones, how they are made hostile, and who reads them."""

from __future__ import annotations

import shutil
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any, NamedTuple

import cv2
import numpy as np
import torch
from rclpy.node import Node
from rclpy.serialization import serialize_message
from rclpy.utilities import try_shutdown
from std_msgs.msg import String

from fuzz import mutations
from fuzz.mutations import Mutation
from kmn_perception.bags.rosbag2 import Message, read_messages, read_topics, write_bag
from kmn_perception.configuration.node_parameters import parameter_values
from kmn_perception.configuration.resources import share_directory
from kmn_perception.configuration.settings import load_settings
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.view_cells import describe_cells
from kmn_perception.evaluation.doors.label import describe_camera, read_description
from kmn_perception.experiments.doors.frames import FrameFiles
from kmn_perception.model.camera import Camera
from kmn_perception.model.depth_image import read_depth_image, read_picture
from kmn_perception.model.depth_sensor import DepthSensor
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.room_model import RoomModel
from kmn_perception.network import wall_weights, weights
from kmn_perception.rooms.frame import make_frame
from kmn_perception.rooms.render_rooms import write as write_room
from kmn_perception.ros.morph_node_parameters import MorphNodeSettings
from kmn_perception.ros.parameter_files import useless_files
from kmn_perception.ros.parameters import declare_parameters
from kmn_perception.ros.program import initialise
from kmn_perception.sharing.records import WHOLE, Heading, Record, read_records, write_line
from kmn_perception.training.procedures import load_training_settings
from kmn_perception.training.run import Run
from kmn_perception.training.wall.settings import WallTrainingSettings
from kmn_perception.training.wall.shards import data_hash, read_shards
from kmn_perception.training.wall.targets import Target
from kmn_perception.viewer.robot_description import RobotDescription
from kmn_sim.robot.robot_model import robot_urdf
from kmn_sim.robot.settings import RobotSettings
from kmn_sim.world.mechanics import Mechanics
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.robot import RobotModel
from kmn_skill.planning.settings import SkillSettings
from kmn_skill.planning.urdf_limits import limits_of_urdf

WEIGHTS_OF = "box_a"  # the smallest


class Kind(NamedTuple):
    """A kind of file.

    Attributes
    ----------
    valid
        Files that are read without an error.
    change
        Makes their bytes hostile.
    read
        Reads a file as the programs do.
    named
        What a refusal may name in place of the file.
    """

    name: str
    valid: list[Path]
    change: Mutation
    read: Callable[[Path], Any]
    named: tuple[str, ...] = ()


def kinds(folder: Path) -> Iterator[Kind]:
    """Yield all kinds; valid files that are not shipped are made in a folder."""
    config, share = share_directory() / "config", share_directory()
    in_walls = config / f"models/{DoorSettings.load().model}.yaml"
    models = [file for file in _files(config, "models/*.yaml") if file != in_walls]
    yaml, json, picture = mutations.change_yaml, mutations.change_json, change_picture
    yield Kind("model", models, yaml, read_model)
    yield Kind("model of a room", [in_walls], yaml, RoomModel.load)
    yield Kind("camera", _files(config, "cameras/*.yaml"), yaml, read_camera)
    sensors = _files(config, "sensors/*.yaml")
    yield Kind("sensor", sensors, yaml, lambda file: load_settings(DepthSensor, file))
    robots = _files(config, "robots/*.yaml")
    yield Kind("robot, simulated", robots, yaml, RobotSettings.load)
    yield Kind("robot, planned for", robots, yaml, RobotModel.load)
    yield Kind("skill", [config / "skill/policy.yaml"], yaml, SkillSettings.load)
    training = [file for file in _files(config, "training/**/*.yaml") if "wall" not in file.parts]
    yield Kind("training", training, yaml, load_training_settings)
    wall = _files(config, "training/wall/*.yaml")
    yield Kind("training for walls", wall, yaml, WallTrainingSettings.load)
    parameters = [config / "nodes/morph_node_tabletop.yaml"]
    without_ros = lambda file: parameter_values("morph_node", file)  # noqa: E731
    yield Kind("parameters", parameters, yaml, without_ros)
    yield Kind("parameters by ROS", parameters, yaml, read_parameters, ("parameter", "'"))
    motions = _files(config, "skill/prototypes/pr2/*.json")
    yield Kind("motions", motions, json, lambda file: Prototypes.load(str(file)))
    yield from _weights(share)
    yield from _bags(folder / "bags")
    yield from _pictures(folder / "rooms", share, picture)
    records = folder / "records.jsonl"
    with records.open("wb") as opened:
        write_line(opened, Heading(1, "fuzz", ["--seed", "0"], {"config": "0"}, 20, WHOLE))
        for item in range(20):
            write_line(opened, Record(item, {"error": [0.1, 0.2], "status": "OK"}))
    yield Kind("records", [records], json, lambda file: list(read_records(file)))
    yield from _descriptions(folder)
    yield from _training_runs(folder)


def read_model(file: Path) -> None:
    """Read a model, and what the simulator takes from it."""
    model = KinematicModel.load(file)
    cubes = model.unit_cubes(*model.split(model.limits.mean(axis=1)))
    assert np.isfinite(cubes).all(), "it has bodies that are nowhere"
    if model.mechanics.values:
        Mechanics.of(model)


def read_camera(file: Path) -> None:
    """Read a camera as programs and labels do."""
    assert np.isfinite(Camera.load(file).pose).all(), "it is nowhere"
    describe_camera(file)


def read_parameters(file: Path) -> None:
    """Read a parameter file as morph_node does when it starts."""
    arguments = ["--ros-args", "--params-file", str(file)]
    initialise(arguments)
    try:
        with closing(_Closed("morph_node")) as node:
            MorphNodeSettings.check(declare_parameters(node, "morph_node"))
        useless_files("/morph_node", arguments)
    finally:
        try_shutdown()


class _Closed(Node):
    """A node that is destroyed at the end of a context."""

    close = Node.destroy_node


def change_picture(content: bytes, random: Random) -> bytes:
    """Return a PNG with hostile bytes, of another kind, or of a size that is not its own."""
    match random.randrange(4):
        case 0:
            kind = random.choice((np.uint8, np.uint16))
            shape = random.choice(((1, 1), (480, 640), (4, 4, 3), (2, 9, 4), (1, 4000)))
            encoded: bytes = cv2.imencode(".png", np.full(shape, 255, kind))[1].tobytes()
            return encoded
        case 1 if content.startswith(b"\x89PNG"):
            sizes = (0, 1, 639, 2**15, 2**31 - 1, 2**32 - 1)
            size = b"".join(random.choice(sizes).to_bytes(4, "big") for _ in range(2))
            header = b"IHDR" + size + content[24:29]
            checked = header + zlib.crc32(header).to_bytes(4, "big")
            return content[:12] + checked + content[33:]
    return mutations.change_bytes(content, random)


def _files(folder: Path, pattern: str) -> list[Path]:
    found = sorted(folder.glob(pattern))
    if not found:
        raise FileNotFoundError(f"there is no {folder / pattern}")
    return found


def _weights(share: Path) -> Iterator[Kind]:
    model, cells = KinematicModel.load(WEIGHTS_OF), describe_cells(DoorSettings.load())
    change = mutations.change_safetensors
    ours = [share / f"weights/{WEIGHTS_OF}.safetensors"]
    yield Kind("weights", ours, change, lambda file: weights.load(file, model))
    wall = [share / f"weights/{DoorSettings.load().model}.safetensors"]
    yield Kind("weights for walls", wall, change, lambda file: wall_weights.load(file, cells))


def _bags(folder: Path) -> Iterator[Kind]:
    """Yield the files of a bag, each beside the valid rest."""

    def read(bag: Path) -> None:
        read_topics(bag)
        list(read_messages(bag))

    def read_whole(metadata: Path) -> None:
        shutil.copy(metadata, folder / "mcap/metadata.yaml")
        read(folder / "mcap")

    folder.mkdir()
    said = [
        Message("/said", 10**18 + i, serialize_message(String(data=f"{i} " * 50))) for i in range(9)
    ]
    for storage in ("mcap", "sqlite3"):
        write_bag(folder / storage, {"/said": "std_msgs/msg/String"}, said, storage)
    change = mutations.change_bytes
    yield Kind("bag, mcap", _files(folder, "mcap/*.mcap"), change, read)
    yield Kind("bag, sqlite3", _files(folder, "sqlite3/*.db3"), change, read)
    metadata = folder / "metadata.yaml"
    shutil.copy(folder / "mcap/metadata.yaml", metadata)
    yield Kind(
        "bag, metadata", [metadata], mutations.change_yaml, read_whole, (str(folder / "mcap"),)
    )


def _pictures(folder: Path, share: Path, change: Mutation) -> Iterator[Kind]:
    """Yield depth images, labels and pictures of frames."""
    boxes = share / "data/kinect_boxes"
    yield Kind("depth image", _files(boxes, "*_d.png"), change, read_depth_image)
    labels = _files(boxes, "*_l.png")
    yield Kind("labels of boxes", labels, change, lambda file: read_picture(file, np.uint8))
    source: dict[str, Any]
    source = {"seed": 0, "sensor": "d455", "calibration": "calibrated", "kind": "door"}
    folder.mkdir()
    write_room(folder, "door_0", make_frame(**source), source)
    label, depth = folder / "door_0.json", folder / "door_0_d.png"
    description = read_description(label)

    def read_colour(file: Path) -> None:
        FrameFiles("door_0", depth, file, description).read()

    yield Kind("label of a door", [label], mutations.change_json, read_description)
    yield Kind("colour image", [folder / "door_0_colour.jpg"], change, read_colour)


def _descriptions(folder: Path) -> Iterator[Kind]:
    """Yield the descriptions of robots, which come by a topic."""
    made = robot_urdf(RobotSettings.load())
    urdf = folder / "robot.urdf"
    text = made.read_text(encoding="utf-8")
    urdf.write_text(text.replace('filename="', f'filename="file://{made.parent}/'))

    def read_drawn(file: Path) -> None:
        robot = RobotDescription.parse(_text(file))
        assert all(np.isfinite(pose).all() for pose in robot.poses({}).values()), "no poses"

    change = mutations.change_xml
    yield Kind("URDF, drawn", [urdf], change, read_drawn, ("robot_description",))
    yield Kind(
        "URDF, its limits", [urdf], change, lambda file: limits_of_urdf(_text(file)), ("it ",)
    )


def _text(file: Path) -> str:
    """Return a file as the text of a message."""
    return file.read_bytes().decode("utf-8", "replace")


def _training_runs(folder: Path) -> Iterator[Kind]:
    """Yield what a training reads again when it goes on."""
    run = Run(folder / "run", {"epochs": 1}, 1.0)
    run.save({"epoch": 1, "network": {"weight": torch.zeros(64, 64)}, "losses": [0.5]})
    checkpoint = folder / "checkpoint.pt"
    shutil.copy(folder / "run/checkpoint.pt", checkpoint)

    def resume(file: Path) -> None:
        shutil.copy(file, folder / "run/checkpoint.pt")
        run.load(torch.device("cpu"))

    change = mutations.change_bytes
    yield Kind("checkpoint", [checkpoint], change, resume, ("checkpoint.pt",))
    shard, doors = folder / "shard.npz", DoorSettings.load()
    rooms = WallTrainingSettings.load(doors.model)
    np.savez_compressed(
        shard,
        cells=np.zeros((3, 8, 20), np.int8),
        columns=np.array([8, 12]),
        targets=np.zeros((2, len(Target._fields))),
        rooms=np.array([0, 9999]),
        made_with=data_hash(rooms, doors),
    )
    yield Kind("rendered rooms", [shard], change, lambda file: read_shards([file], rooms, doors))
