"""Settings in YAML files: dataclasses and named tuples whose annotations say what is valid."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, Field, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from kmn_perception.configuration.section import ConfigurationError, Section

Settings = TypeVar("Settings")

WORDS = {  # of pydantic, and of those who write YAML
    "Input should be": "must be",
    "Arguments must be an array or an object": "must be keys and values",
    "an array or an object": "keys and values",
    "Value error,": "is wrong:",
    "a valid integer": "a whole number",
    "a valid number": "a number",
    "a valid boolean": "true or false",
    "a valid string": "a text",
    "a valid array": "a list",
    "an object": "keys and values",
    "Tuple should have": "must have",
    "List should have": "must have",
    " after validation": "",
    "a valid dictionary": "keys and values",
}

Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Positive = Annotated[float, Field(gt=0.0)]
Count = Annotated[int, Field(ge=1)]
Pixels = Annotated[int, Field(ge=0)]


def _ordered(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] >= interval[1]:
        raise ValueError(f"lower {interval[0]:g} is not below upper {interval[1]:g}")
    return interval


Interval = Annotated[tuple[float, float], AfterValidator(_ordered)]


def load_settings(kind: type[Settings], file: Path, key: str = "") -> Settings:
    """Read settings from a YAML file, or from the mapping below one of its keys.

    Parameters
    ----------
    kind
        A dataclass or named tuple; its annotations are checked as they stand, without conversions
        but those from whole to real numbers and from lists to tuples.

    Raises
    ------
    ConfigurationError
        If a key is missing, unknown or of a wrong value; the text names file, key and value.
    """
    section = Section.load(file)
    return read_settings(kind, section.section(key) if key else section)


def read_settings(kind: type[Settings], section: Section) -> Settings:
    """Read settings from a section of a file; see `load_settings`."""
    adapter = TypeAdapter(kind)
    for problem in _problems(section.values, adapter.json_schema(), section.place):
        raise ConfigurationError(problem)
    try:
        # As JSON, where a strict reader still takes a list for a tuple.
        return adapter.validate_json(json.dumps(section.values, default=str), strict=True)
    except ValidationError as error:
        raise ConfigurationError(_explain(error.errors()[0], section.place)) from error


def _problems(
    values: Any, schema: Mapping[str, Any], place: str, definitions: Mapping[str, Any] | None = None
) -> Iterator[str]:
    """Yield what types do not tell: keys that the schema lacks, and numbers that are not finite."""
    definitions = schema.get("$defs", {}) if definitions is None else definitions
    schema = next((option for option in schema.get("anyOf", ()) if "$ref" in option), schema)
    schema = definitions.get(schema.get("$ref", "").rpartition("/")[2], schema)
    if isinstance(values, float) and not math.isfinite(values):
        yield f"{place}: must be finite, found {values}"
    if isinstance(values, Mapping):
        known = schema.get("properties", {})
        for key, value in values.items():
            if known and key not in known:
                yield f"{place}: unknown key '{key}' (known: {', '.join(known)})"
            inner = known.get(key, schema.get("additionalProperties"))
            inner = inner if isinstance(inner, Mapping) else {}
            yield from _problems(value, inner, f"{place}: {key}", definitions)
    if isinstance(values, list):
        inner = schema.get("items")
        inner = inner if isinstance(inner, Mapping) else {}
        for i, value in enumerate(values):
            yield from _problems(value, inner, f"{place}[{i}]", definitions)


def _explain(error: ErrorDetails, place: str) -> str:
    """Return what is wrong in one line that names the key."""
    *keys, last = error["loc"] or ("",)
    for key in keys:
        place += f"[{key}]" if isinstance(key, int) else f": {key}"
    if error["type"].startswith("missing"):
        return f"{place}: key '{last}' is missing"
    if error["type"] == "unexpected_keyword_argument":
        return f"{place}: unknown key '{last}'"
    name = f"{place}[{last}]" if isinstance(last, int) else f"{place}: '{last}'"
    expected = error["msg"]
    for text, plain in WORDS.items():
        expected = expected.replace(text, plain)
    return f"{name} {expected}, found {error['input']!r}"
