"""Read and write rosbag2 recordings: messages stay the CDR bytes that were recorded."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import (
    Connection,
    ConnectionExtRosbag2,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

_INFINITE = QosTime(sec=9223372036, nsec=854775807)  # rosbag2's way to write "no limit"
_OFFERED_QOS = Qos(
    history=QosHistory.KEEP_LAST,
    depth=10,
    reliability=QosReliability.RELIABLE,
    durability=QosDurability.VOLATILE,
    deadline=_INFINITE,
    lifespan=_INFINITE,
    liveliness=QosLiveliness.AUTOMATIC,
    liveliness_lease_duration=_INFINITE,
    avoid_ros_namespace_conventions=False,
)


class BagError(ValueError):
    """A bag that cannot be read or written; the text says what was wrong and what was expected."""


@dataclass(frozen=True)
class Topic:
    """What a bag holds of one topic.

    Attributes
    ----------
    type : str
        Message type, e.g. ``sensor_msgs/msg/Image``.
    count : int
        Number of messages.
    latched : bool
        Whether the recorded publisher was transient local, as for ``/tf_static``.
    """

    type: str
    count: int
    latched: bool


class Message(NamedTuple):
    """One recorded message: its topic, the time of recording in nanoseconds, its CDR bytes."""

    topic: str
    stamp: int
    data: bytes


def read_topics(bag: Path) -> dict[str, Topic]:
    """List the topics of a bag.

    Parameters
    ----------
    bag : Path
        Folder with a ``metadata.yaml``, or a single ``.mcap`` or ``.db3`` file.

    Raises
    ------
    BagError
        The bag is missing, truncated, corrupt or not a rosbag2 recording.
    """
    with _open(bag) as reader:
        return _topics(bag, _connections(bag, reader))


def read_messages(bag: Path, topics: Collection[str] = ()) -> Iterator[Message]:
    """Read a bag's messages in the order in which they were recorded.

    Parameters
    ----------
    bag : Path
        Folder with a ``metadata.yaml``, or a single ``.mcap`` or ``.db3`` file.
    topics : collection of str
        Names of the topics to read; all if empty.

    Raises
    ------
    BagError
        As for `read_topics`, or a topic is not in the bag.
    """
    with _open(bag) as reader:
        connections = _connections(bag, reader)
        check_topics(bag, _topics(bag, connections), topics)
        wanted = [c for c in connections if not topics or c.topic in topics]
        for connection, stamp, data in reader.messages(wanted) if wanted else ():
            yield Message(connection.topic, stamp, bytes(data))


def check_topics(bag: Path, available: Collection[str], wanted: Iterable[str]) -> None:
    """Raise a `BagError` that lists the available topics if a wanted one is not among them."""
    if missing := sorted(set(wanted) - set(available)):
        raise BagError(
            f"{bag}: no topic {', '.join(missing)}; "
            f"the bag holds {', '.join(sorted(available)) or 'no topics'}"
        )


def write_bag(
    bag: Path, types: Mapping[str, str], messages: Iterable[Message], storage: str = "mcap"
) -> None:
    """Write a new bag that ``ros2 bag info`` and ``ros2 bag play`` open.

    Parameters
    ----------
    bag : Path
        Folder to make; it must not exist.
    types : mapping of str to str
        Message type of each topic, by the topic's absolute name.
    messages : iterable of Message
        What to record.
    storage : {"mcap", "sqlite3"}
        Storage plugin; ``mcap`` is the default of ROS 2 Jazzy.

    Raises
    ------
    BagError
        The folder exists, or a type or the storage is unknown.
    """
    if storage.upper() not in StoragePlugin.__members__:
        raise BagError(f"no bag storage {storage!r}; expected mcap or sqlite3")
    typestore = get_typestore(Stores.ROS2_JAZZY)
    if unknown := sorted(set(types.values()) - set(typestore.fielddefs)):
        raise BagError(f"{bag}: message types {', '.join(unknown)} are not ROS 2 Jazzy's own")
    if bag.exists():
        raise BagError(f"{bag} exists already; remove it or choose another place")
    try:
        with Writer(bag, version=9, storage_plugin=StoragePlugin[storage.upper()]) as writer:
            connections = {
                topic: writer.add_connection(
                    topic, type_, typestore=typestore, offered_qos_profiles=[_OFFERED_QOS]
                )
                for topic, type_ in types.items()
            }
            for message in messages:
                writer.write(connections[message.topic], message.stamp, message.data)
    except BaseException:
        shutil.rmtree(bag, ignore_errors=True)  # half a bag would look like a whole one
        raise


@contextmanager
def _open(bag: Path) -> Iterator[Reader]:
    """Open a bag; whatever its bytes make the reader stumble over becomes a `BagError`."""
    if not bag.exists():
        raise BagError(f"{bag}: no such bag")
    if bag.is_dir() and not (bag / "metadata.yaml").is_file():
        raise BagError(
            f"{bag}: not a rosbag2 recording, it has no metadata.yaml; "
            "give the folder that `ros2 bag record` made, or a single .mcap or .db3 file"
        )
    try:
        with Reader(bag) as reader:
            yield reader
    except BagError:
        raise
    except Exception as error:
        raise BagError(
            f"{bag}: truncated, corrupt or not a rosbag2 recording "
            f"({type(error).__name__}: {error})"
        ) from error


def _connections(bag: Path, reader: Reader) -> list[Connection]:
    """List the topics as the storage files state them.

    Those of ``metadata.yaml`` may state another quality of service, for which rosbags then finds
    no message in the files.
    """
    files: list[Any] = getattr(reader.storage, "storages", [reader.storage])
    connections = [connection for file in files for connection in file.connections]
    for connection in connections:
        if (encoding := _extension(connection).serialization_format) != "cdr":
            raise BagError(f"{bag}: {connection.topic} is serialised as {encoding!r}, not 'cdr'")
    return connections


def _topics(bag: Path, connections: Iterable[Connection]) -> dict[str, Topic]:
    topics: dict[str, Topic] = {}
    for connection in connections:
        name, type_ = connection.topic, connection.msgtype
        known = topics.get(name, Topic(type_, 0, latched=False))
        if known.type != type_:
            raise BagError(f"{bag}: {name} is recorded both as {known.type} and as {type_}")
        offered = _extension(connection).offered_qos_profiles
        topics[name] = Topic(
            type_,
            known.count + connection.msgcount,
            known.latched or any(q.durability is QosDurability.TRANSIENT_LOCAL for q in offered),
        )
    return topics


def _extension(connection: Connection) -> ConnectionExtRosbag2:
    assert isinstance(connection.ext, ConnectionExtRosbag2)
    return connection.ext
