"""Reading and writing rosbag2 recordings."""

from __future__ import annotations

import shutil
from array import array
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import String

from kmn_perception.bags.rosbag2 import (
    BagError,
    Message,
    Topic,
    read_messages,
    read_topics,
    write_bag,
)

STORAGES = ("mcap", "sqlite3")
TALKER = Path(__file__).parent / "data" / "talker"
FILES = {"mcap": "talker.mcap", "sqlite3": "talker.db3"}
TYPES = get_typestore(Stores.ROS2_JAZZY)
IMAGE, INFO = "sensor_msgs/msg/Image", "sensor_msgs/msg/CameraInfo"


@pytest.mark.parametrize("storage", STORAGES)
def test_reads_what_ros2_bag_record_wrote(storage: str) -> None:
    assert read_topics(TALKER / storage) == {
        "/topic": Topic("std_msgs/msg/String", 10, latched=False),
        "/rosout": Topic("rcl_interfaces/msg/Log", 10, latched=True),
        "/parameter_events": Topic("rcl_interfaces/msg/ParameterEvent", 0, latched=False),
    }
    heard = [
        deserialize_message(message.data, String).data
        for message in read_messages(TALKER / storage, ["/topic"])
    ]
    assert heard == [f"Hello, world! {number}" for number in range(10)]
    stamps = [message.stamp for message in read_messages(TALKER / storage)]
    assert len(stamps) == 20
    assert stamps == sorted(stamps)


@pytest.mark.parametrize("storage", STORAGES)
def test_reads_a_storage_file_without_its_metadata(storage: str) -> None:
    bag = TALKER / storage
    assert list(read_messages(bag / FILES[storage])) == list(read_messages(bag))


def _image(number: int) -> Image:
    image = Image(height=3, width=2, encoding="16UC1", step=4)
    image.header.frame_id = "camera_optical_frame"
    image.header.stamp.sec = number
    image.data = array("B", [number] * 12)
    return image


@pytest.mark.parametrize("storage", STORAGES)
def test_what_is_written_is_read_as_it_was_in_the_order_of_its_stamps(
    storage: str, tmp_path: Path
) -> None:
    images = [_image(number) for number in range(3)]
    info = CameraInfo(height=3, width=2, k=[525.0, 0, 0.5, 0, 525, 1, 0, 0, 1], d=[0.1, 0.2])
    late_first = [
        Message("/depth/image", 10 * number, serialize_message(images[number]))
        for number in (2, 0, 1)
    ]
    write_bag(
        tmp_path / "bag",
        {"/depth/image": IMAGE, "/depth/camera_info": INFO},
        [Message("/depth/camera_info", 5, serialize_message(info)), *late_first],
        storage,
    )
    read = list(read_messages(tmp_path / "bag"))
    assert [message.stamp for message in read] == [0, 5, 10, 20]
    assert deserialize_message(read.pop(1).data, CameraInfo) == info
    assert [deserialize_message(message.data, Image) for message in read] == images


@pytest.mark.parametrize("storage", STORAGES)
def test_the_metadata_say_all_that_ros2_bag_needs(storage: str, tmp_path: Path) -> None:
    messages = [Message("/i", 10**9 * n, serialize_message(_image(n))) for n in (1, 3)]
    write_bag(tmp_path / "bag", {"/i": IMAGE}, messages, storage)
    written = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())
    metadata = written["rosbag2_bagfile_information"]
    assert metadata["version"] == 9
    assert metadata["storage_identifier"] == storage
    assert metadata["message_count"] == 2
    assert metadata["duration"]["nanoseconds"] == 2 * 10**9
    assert metadata["starting_time"]["nanoseconds_since_epoch"] == 10**9
    assert metadata["ros_distro"]
    for name in metadata["relative_file_paths"]:
        assert (tmp_path / "bag" / name).is_file()
    (topic,) = metadata["topics_with_message_count"]
    assert topic["message_count"] == 2
    assert topic["topic_metadata"]["type"] == IMAGE
    assert topic["topic_metadata"]["serialization_format"] == "cdr"
    # As `ros2 topic info --verbose` of ROS 2 Jazzy prints it.
    assert topic["topic_metadata"]["type_description_hash"] == (
        "RIHS01_d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"
    )
    (profile,) = topic["topic_metadata"]["offered_qos_profiles"]
    assert profile["reliability"] == "reliable"
    assert profile["durability"] == "volatile"
    assert profile["history"] == "keep_last"


def test_a_missing_bag_is_named(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="nowhere: no such bag"):
        read_topics(tmp_path / "nowhere")


def test_a_folder_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BagError, match=r"not a rosbag2 recording, it has no metadata\.yaml"):
        read_topics(tmp_path)


def test_a_file_that_is_no_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("not a bag")
    with pytest.raises(BagError, match=r"not a rosbag2 recording .*\.txt"):
        read_topics(tmp_path / "notes.txt")


@pytest.mark.parametrize("storage", STORAGES)
@pytest.mark.parametrize("fraction", [0.0, 0.3, 0.7])
def test_a_truncated_bag_is_refused(storage: str, fraction: float, tmp_path: Path) -> None:
    bag = shutil.copytree(TALKER / storage, tmp_path / "bag")
    content = (bag / FILES[storage]).read_bytes()
    (bag / FILES[storage]).write_bytes(content[: int(fraction * len(content))])
    with pytest.raises(BagError, match="truncated, corrupt"):
        list(read_messages(bag))


@pytest.mark.parametrize("storage", STORAGES)
def test_a_bag_without_its_storage_file_is_refused(storage: str, tmp_path: Path) -> None:
    bag = shutil.copytree(TALKER / storage, tmp_path / "bag")
    (bag / FILES[storage]).unlink()
    with pytest.raises(BagError, match=f"missing.*{FILES[storage]}"):
        read_topics(bag)


@pytest.mark.parametrize("storage", STORAGES)
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(position=st.floats(0, 1), junk=st.binary(min_size=1, max_size=64))
def test_corrupt_bytes_raise_nothing_but_a_bag_error(
    storage: str, position: float, junk: bytes, tmp_path: Path
) -> None:
    content = bytearray((TALKER / storage / FILES[storage]).read_bytes())
    start = int(position * (len(content) - len(junk)))
    content[start : start + len(junk)] = junk
    broken = tmp_path / FILES[storage]
    broken.write_bytes(content)
    with suppress(BagError):
        list(read_messages(broken))


def test_a_topic_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(BagError, match="no topic /points; the bag holds /parameter_events, /rosou"):
        list(read_messages(TALKER / "mcap", ["/topic", "/points"]))


def test_a_topic_of_two_types_is_refused(tmp_path: Path) -> None:
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/a", IMAGE, typestore=TYPES)
        writer.add_connection("/a", INFO, typestore=TYPES)
    with pytest.raises(BagError, match="/a is recorded both as .*Image and as .*CameraInfo"):
        read_topics(tmp_path / "bag")


def test_a_topic_that_is_not_cdr_is_refused(tmp_path: Path) -> None:
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        writer.add_connection("/a", IMAGE, typestore=TYPES, serialization_format="protobuf")
    with pytest.raises(BagError, match="/a is serialised as 'protobuf', not 'cdr'"):
        read_topics(next((tmp_path / "bag").glob("*.mcap")))


def test_writing_refuses_what_it_cannot_write(tmp_path: Path) -> None:
    with pytest.raises(BagError, match="no bag storage 'zip'; expected mcap or sqlite3"):
        write_bag(tmp_path / "bag", {}, [], storage="zip")
    with pytest.raises(BagError, match="message types acme_msgs/msg/Anvil"):
        write_bag(tmp_path / "bag", {"/a": "acme_msgs/msg/Anvil"}, [])
    with pytest.raises(BagError, match="exists already"):
        write_bag(tmp_path, {"/a": IMAGE}, [])


def test_an_interrupted_recording_leaves_nothing_behind(tmp_path: Path) -> None:
    def interrupted() -> Iterator[Message]:
        yield Message("/a", 0, serialize_message(_image(0)))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_bag(tmp_path / "bag", {"/a": IMAGE}, interrupted())
    assert not (tmp_path / "bag").exists()
