"""The interfaces against the contract, and against rosbags' own parser and CDR of the same text.

rosbags shares no code with rosidl and Fast CDR: it reads the text of the interface files itself.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from std_msgs.msg import Header

from kmn_msgs.action import OpenDoor, OperateJoint
from kmn_msgs.msg import MorphingParameters
from kmn_msgs.srv import EstimateMorphing

INTERFACES = Path(__file__).parents[1]
TYPE = "kmn_msgs/msg/MorphingParameters"

FIELDS = {
    MorphingParameters: {
        "header": "std_msgs/Header",
        "model": "string",
        "id": "uint32",
        "alternative": "string",
        "mirrored": "boolean",
        "truncated": "boolean",
        "theta_names": "sequence<string>",
        "theta": "sequence<double>",
        "gamma_names": "sequence<string>",
        "gamma": "sequence<double>",
        "covariance": "sequence<double>",
        "transform": "double[16]",
        "joint_names": "sequence<string>",
        "joint_positions": "sequence<double>",
        "joint_deviations": "sequence<double>",
        "surroundings_names": "sequence<string>",
        "surroundings": "sequence<double>",
        "surroundings_deviations": "sequence<double>",
        "iterations": "uint32",
        "converged": "boolean",
        "residual": "double",
        "points_used": "uint32",
        "status": "uint8",
        "reason": "string",
    },
    EstimateMorphing.Request: {"points": "sensor_msgs/PointCloud2"},
    EstimateMorphing.Response: {"parameters": "kmn_msgs/MorphingParameters"},
    OpenDoor.Goal: {"handle_angle": "double", "door_angle": "double"},
    OpenDoor.Result: {
        "success": "boolean",
        "error_code": "int32",
        "reason": "string",
        "handle_angle": "double",
        "door_angle": "double",
        "planning_time": "double",
        "contact_error": "double",
        "clearance": "double",
        "attempts": "uint32",
    },
    OpenDoor.Feedback: {
        "phase": "string",
        "progress": "float",
        "handle_angle": "double",
        "door_angle": "double",
    },
    OperateJoint.Goal: {
        "model": "string",
        "object_id": "uint32",
        "joint": "string",
        "target": "double",
    },
    OperateJoint.Result: {
        "success": "boolean",
        "error_code": "int32",
        "reason": "string",
        "position": "double",
        "planning_time": "double",
        "contact_error": "double",
        "clearance": "double",
        "attempts": "uint32",
    },
    OperateJoint.Feedback: {"phase": "string", "progress": "float", "position": "double"},
}

uint32 = st.integers(0, 2**32 - 1)
text = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"))
numbers = st.lists(st.floats(), max_size=50)
values = st.fixed_dictionaries(
    {
        "model": text,
        "id": uint32,
        "alternative": text,
        "mirrored": st.booleans(),
        "truncated": st.booleans(),
        "theta_names": st.lists(text, max_size=4),
        "theta": numbers,
        "gamma_names": st.lists(text, max_size=4),
        "gamma": numbers,
        "covariance": numbers,
        "transform": st.lists(st.floats(), min_size=16, max_size=16),
        "joint_names": st.lists(text, max_size=2),
        "joint_positions": numbers,
        "joint_deviations": numbers,
        "surroundings_names": st.lists(text, max_size=2),
        "surroundings": numbers,
        "surroundings_deviations": numbers,
        "iterations": uint32,
        "converged": st.booleans(),
        "residual": st.floats(),
        "points_used": uint32,
        "status": st.integers(0, 255),
        "reason": text,
    }
)
stamps = st.tuples(st.integers(-(2**31), 2**31 - 1), uint32)


def typestore() -> Any:
    store = get_typestore(Stores.ROS2_JAZZY)
    text = (INTERFACES / "msg/MorphingParameters.msg").read_text(encoding="utf-8")
    store.register(get_types_from_msg(text, TYPE))
    return store


TYPES = typestore()


def rosidl_message(
    values: dict[str, Any], stamp: tuple[int, int], frame: str
) -> MorphingParameters:
    header = Header(stamp=Time(sec=stamp[0], nanosec=stamp[1]), frame_id=frame)
    return MorphingParameters(
        header=header, **{**values, "transform": np.array(values["transform"])}
    )


def rosbags_message(values: dict[str, Any], stamp: tuple[int, int], frame: str) -> Any:
    time = TYPES.types["builtin_interfaces/msg/Time"](*stamp)
    header = TYPES.types["std_msgs/msg/Header"](time, frame)
    states = ("joint_positions", "joint_deviations", "surroundings", "surroundings_deviations")
    vectors = ("theta", "gamma", "covariance", "transform", *states)
    arrays = {name: np.array(values[name], dtype=np.float64) for name in vectors}
    return TYPES.types[TYPE](header, **{**values, **arrays})


def assert_same(message: Any, values: dict[str, Any], stamp: tuple[int, int], frame: str) -> None:
    time = message.header.stamp
    assert (time.sec, time.nanosec, message.header.frame_id) == (*stamp, frame)
    for name, value in values.items():
        np.testing.assert_array_equal(getattr(message, name), value, err_msg=name)


@pytest.mark.parametrize("interface", FIELDS, ids=lambda interface: interface.__name__)
def test_fields_are_those_of_the_contract(interface: Any) -> None:
    assert interface.get_fields_and_field_types() == FIELDS[interface]


def test_status_constants() -> None:
    names = ["OK", "NO_OBJECT", "TOO_FEW_POINTS", "NOT_CONVERGED", "OUT_OF_LIMITS"]
    names += ["HANDLE_NOT_SEEN", "AMBIGUOUS"]
    assert [getattr(MorphingParameters, name) for name in names] == list(range(7))


@pytest.mark.parametrize(
    "path", sorted(INTERFACES.glob("*/*.[msa]*")), ids=lambda path: str(path.name)
)
def test_every_field_is_documented(path: Path) -> None:
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]
    fields = [line for line in lines if not line.lstrip().startswith(("#", "---"))]
    assert fields
    assert [line for line in fields if "#" not in line] == []


@given(values=values, stamp=stamps, frame=text)
def test_rosidl_reads_what_rosbags_writes(
    values: dict[str, Any], stamp: tuple[int, int], frame: str
) -> None:
    cdr = TYPES.serialize_cdr(rosbags_message(values, stamp, frame), TYPE)
    assert_same(deserialize_message(bytes(cdr), MorphingParameters), values, stamp, frame)


@given(values=values, stamp=stamps, frame=text)
def test_rosbags_reads_what_rosidl_writes(
    values: dict[str, Any], stamp: tuple[int, int], frame: str
) -> None:
    cdr = serialize_message(rosidl_message(values, stamp, frame))
    # rmw_fastrtps counts an alignment for empty sequences which Fast CDR does not write, so that
    # unused bytes may follow the message; rosbags knows the exact length.
    exact = len(TYPES.serialize_cdr(rosbags_message(values, stamp, frame), TYPE))
    assert exact <= len(cdr) < exact + 32
    assert_same(TYPES.deserialize_cdr(cdr[:exact], TYPE), values, stamp, frame)
