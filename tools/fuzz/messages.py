"""Valid messages, requests and goals made hostile: values that have their type, or bytes."""

from __future__ import annotations

import copy
import importlib
import re
from array import array
from collections.abc import Iterator
from random import Random
from typing import Any

import numpy as np
from rclpy.serialization import serialize_message

from fuzz.mutations import MAX_CHANGES, TEXTS, change_bytes

FLOATS = (0.0, -0.0, -1.0, 1e-30, 3e38, float("nan"), float("inf"), -float("inf"))
MANY = 1000  # elements
MAX_WALKED = 20  # elements of a sequence of messages that are looked into
INTEGER = re.compile(r"(u?)int(\d+)")


def interface(name: str) -> Any:
    """Return the class of an interface such as ``sensor_msgs/msg/Image``."""
    package, kind, type_ = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), type_)


def hostile_message(valid: Any, random: Random) -> Any:
    """Return a message with hostile values, or the hostile bytes of one."""
    changed = hostile_values(valid, random)
    if random.random() < 0.3:
        return change_bytes(serialize_message(changed), random)
    return changed


def hostile_values(valid: Any, random: Random) -> Any:
    """Return a message of which some fields hold something hostile of their type."""
    message = copy.deepcopy(valid)
    for _ in range(random.randint(1, MAX_CHANGES)):
        places = list(_places(message))
        if not places:
            break
        holder, field, kind = random.choice(places)
        setattr(holder, field, _hostile(getattr(holder, field), kind, random))
    return message


def _places(message: Any) -> Iterator[tuple[Any, str, str]]:
    """Yield all messages in a message with the names and types of their fields."""
    for field, kind in message.get_fields_and_field_types().items():
        value = getattr(message, field)
        yield message, field, kind
        if hasattr(value, "get_fields_and_field_types"):
            yield from _places(value)
        elif isinstance(value, list):
            for element in value[:MAX_WALKED]:
                if hasattr(element, "get_fields_and_field_types"):
                    yield from _places(element)


def _hostile(value: Any, kind: str, random: Random) -> Any:
    if match := re.fullmatch(r"(?:sequence<)?([^,<>\[\]]+)(?:, (\d+))?(>|\[(\d+)\])", kind):
        element, fixed = match[1], match[4]
        return _sequence(value, element, int(fixed) if fixed else None, random)
    if hasattr(value, "get_fields_and_field_types"):
        return type(value)()
    return _scalar(kind, random)


def _scalar(kind: str, random: Random) -> Any:
    if match := INTEGER.fullmatch(kind):
        bits = int(match[2])
        low, high = (0, 2**bits - 1) if match[1] else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return random.choice((low, high, 0, 1, high // 2, random.randint(low, high)))
    if kind in ("float", "double"):
        return random.choice((*FLOATS, random.uniform(-10.0, 10.0)))
    if kind == "boolean":
        return random.random() < 0.5
    if kind == "octet":
        return bytes([random.randrange(256)])
    if "string" in kind:
        return random.choice((*TEXTS, "world", "base_footprint", "32FC1", "16UC1", "mono8"))
    return interface(kind.replace("/", "/msg/") if kind.count("/") == 1 else kind)()


def _sequence(value: Any, element: str, fixed: int | None, random: Random) -> Any:
    """Return a sequence that is empty, cut, repeated, or full of something hostile."""
    if isinstance(value, array | np.ndarray) and element in ("uint8", "octet"):
        return array("B", change_bytes(bytes(value), random)) if fixed is None else value
    there = list(value)
    if fixed is not None:
        filled = [_scalar(element, random)] * fixed
        return filled if isinstance(value, list) else np.array(filled, dtype=value.dtype)
    match random.randrange(5):
        case 0:
            there = []
        case 1:
            there = there[: random.randrange(len(there) + 1)]
        case 2:
            there = there + [_scalar(element, random)] * random.choice((1, MANY))
        case 3 if there:
            there[random.randrange(len(there))] = _scalar(element, random)
        case _:
            there = there * 2
    return array(value.typecode, there) if isinstance(value, array) else there
