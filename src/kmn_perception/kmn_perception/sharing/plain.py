"""Results as JSON has them, and back: named tuples, dataclasses, arrays, enumerations."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from enum import Enum
from functools import cache
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

Kind = TypeVar("Kind")


def to_plain(value: Any) -> Any:
    """Return a value as dictionaries, lists, numbers, texts and None."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Enum):
        return value.name
    if fields := _fields(value.__class__):
        return {name: to_plain(getattr(value, name)) for name in fields}
    if isinstance(value, Mapping):
        return {name: to_plain(each) for name, each in value.items()}
    return [to_plain(each) for each in value] if isinstance(value, list | tuple) else value


def from_plain(kind: type[Kind], plain: Any) -> Kind:
    """Return the value of a kind that `to_plain` was given.

    Raises
    ------
    ValueError
        If it is not of that kind.
    """
    return _read(kind, plain)


def _read(kind: Any, plain: Any) -> Any:
    if kind is Any:
        return plain
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        (some,) = (each for each in inner if each is not type(None))
        return None if plain is None else _read(some, plain)
    if origin is np.ndarray:
        _check(isinstance(plain, list), kind, plain)
        return np.array(plain, dtype=get_args(inner[1])[0])
    if origin is dict:
        _check(isinstance(plain, dict), kind, plain)
        return {name: _read(inner[1], each) for name, each in plain.items()}
    if origin in (list, tuple):
        _check(isinstance(plain, list), kind, plain)
        of_all = origin is list or inner[-1] is Ellipsis
        kinds = [inner[0]] * len(plain) if of_all else inner
        _check(len(kinds) == len(plain), kind, plain)
        return origin(_read(each, part) for each, part in zip(kinds, plain, strict=True))
    if issubclass(kind, Enum):
        _check(plain in kind.__members__, kind, plain)
        return kind[plain]
    if fields := _fields(kind):
        _check(isinstance(plain, dict) and plain.keys() == fields.keys(), kind, plain)
        return kind(**{name: _read(each, plain[name]) for name, each in fields.items()})
    # JSON has whole numbers for some real ones, but True is neither.
    _check(type(plain) in ((int, float) if kind is float else (kind,)), kind, plain)
    return kind(plain)


@cache
def _fields(kind: type) -> dict[str, Any]:
    """Return names and kinds of the fields; none of what is no named tuple or dataclass."""
    if not (dataclasses.is_dataclass(kind) or hasattr(kind, "_fields")):
        return {}
    hints = get_type_hints(kind)
    if dataclasses.is_dataclass(kind):
        return {field.name: hints[field.name] for field in dataclasses.fields(kind)}
    return {name: hints[name] for name in getattr(kind, "_fields")}  # noqa: B009


def _check(is_so: bool, kind: Any, plain: Any) -> None:
    if not is_so:
        name = kind.__name__ if isinstance(kind, type) else str(kind)
        raise ValueError(f"{str(plain)[:60]!r} is no {name}")
