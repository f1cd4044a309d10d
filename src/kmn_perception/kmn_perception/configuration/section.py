"""Reading of YAML and JSON files, with errors that name the file and the key."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any, TypeGuard

from kmn_perception.configuration.plain_text import parse_json, parse_yaml


class ConfigurationError(ValueError):
    """A configuration file is wrong; the text names the file, the key and what was expected."""


class Section:
    """A mapping of a YAML or JSON file that knows its place, for errors that name the key.

    Parameters
    ----------
    values
        What the file holds at this place.
    place
        File and keys that lead here, e.g. ``door.yaml: bodies.panel``.
    """

    def __init__(self, values: object, place: str) -> None:
        if not isinstance(values, Mapping):
            raise ConfigurationError(f"{place}: expected keys and values, found {values!r}")
        self.values: Mapping[Any, Any] = values
        self.place = place

    @classmethod
    def load(cls, path: Path) -> Section:
        """Read a YAML file."""
        return cls(_read(path, parse_yaml), path.name)

    @classmethod
    def load_json(cls, path: Path) -> Section:
        """Read a JSON file."""
        return cls(_read(path, parse_json), path.name)

    def allow(self, required: Collection[str], optional: Collection[str] = ()) -> None:
        """Raise if a required key is missing or a key is unknown."""
        for key in required:
            if key not in self.values:
                raise self.error(f"key '{key}' is missing")
        for key in self.values:
            if key not in required and key not in optional:
                known = ", ".join((*required, *optional))
                raise self.error(f"unknown key '{key}' (known: {known})")

    def error(self, text: str) -> ConfigurationError:
        """Return an error that names this place."""
        return ConfigurationError(f"{self.place}: {text}")

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def section(self, key: str) -> Section:
        """Return the mapping below a key; an absent one is empty."""
        return Section(self.values.get(key, {}), f"{self.place}: {key}")

    def sections(self, key: str) -> list[Section]:
        """Return the mappings of a list below a key; an absent one is empty."""
        entries = self.values.get(key, [])
        if not isinstance(entries, list):
            raise self.error(f"'{key}' must be a list, found {entries!r}")
        return [Section(entry, f"{self.place}: {key}[{i}]") for i, entry in enumerate(entries)]

    def text(self, key: str, choices: Collection[str] = (), default: str | None = None) -> str:
        """Return a text, if ``choices`` are given one of these."""
        value = self.values.get(key, default)
        if not isinstance(value, str) or (choices and value not in choices):
            expected = f"one of {', '.join(choices)}" if choices else "a text"
            raise self.error(f"'{key}' must be {expected}, found {value!r}")
        return value

    def flag(self, key: str) -> bool:
        """Return true or false; an absent one is false."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            raise self.error(f"'{key}' must be true or false, found {value!r}")
        return value

    def number(self, key: str, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number within [low, high]."""
        value = self.values.get(key)
        if not is_number(value) or not low <= value <= high:
            raise self.error(f"'{key}' must be a number in [{low:g}, {high:g}], found {value!r}")
        return float(value)

    def whole_number(self, key: str, low: int, high: int) -> int:
        """Return a whole number within [low, high]."""
        value = self.values.get(key)
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            raise self.error(f"'{key}' must be a whole number in [{low}, {high}], found {value!r}")
        return value

    def numbers(self, key: str, length: int | None = None) -> list[float]:
        """Return a list of finite numbers of a given length, or of any."""
        value = self.values.get(key)
        if (
            not isinstance(value, list)
            or length not in (None, len(value))
            or not all(map(is_number, value))
        ):
            raise self.error(f"'{key}' must be {length or 'some'} numbers, found {value!r}")
        return [float(number) for number in value]

    def whole_numbers(self, key: str, low: int, high: int) -> list[int]:
        """Return a list of at least one whole number within [low, high]."""
        value = self.values.get(key)
        if (
            not isinstance(value, list | tuple)
            or not value
            or not all(isinstance(number, int) and low <= number <= high for number in value)
        ):
            raise self.error(f"'{key}' must be whole numbers in [{low}, {high}], found {value!r}")
        return list(value)

    def table(self, key: str, columns: int) -> list[list[float]]:
        """Return a list of at least one row, each of so many finite numbers."""
        value = self.values.get(key)
        if not isinstance(value, list | tuple) or not value:
            raise self.error(f"'{key}' must be rows of {columns} numbers, found {value!r}")
        rows = Section({str(i): row for i, row in enumerate(value)}, f"{self.place}: {key}")
        return [rows.numbers(row, columns) for row in rows.values]

    def limits(self, key: str) -> tuple[float, float]:
        """Return an interval; its lower end must lie below its upper end."""
        low, high = self.numbers(key, 2)
        if low >= high:
            raise self.error(f"'{key}' are reversed: lower {low:g} is not below upper {high:g}")
        return low, high


def _read(path: Path, parse: Callable[[bytes], Any]) -> Any:
    """Return what a file says; raise `ConfigurationError` if it says nothing sensible."""
    try:
        return parse(path.read_bytes())
    except ValueError as error:
        raise ConfigurationError(f"{path.name}: {error}") from error


def is_number(value: object) -> TypeGuard[int | float]:
    """Tell whether a YAML value is a finite number."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
