"""Settings in YAML files: what is wrong is said with file, key and value."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import yaml

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.configuration.settings import Count, Fraction, Interval, Positive, load_settings


class Edge(NamedTuple):
    """A named tuple within settings."""

    contrast: Positive
    outliers: Fraction


@dataclass(frozen=True)
class Level:
    """A dataclass within settings."""

    steps: Count


@dataclass(frozen=True)
class Settings:
    """What a file holds."""

    share: Fraction
    limits: Interval
    edge: Edge
    levels: tuple[Level, ...]
    by_name: dict[str, Level]
    optional: Count = 3
    absent: Level | None = None


GOOD: dict[str, Any] = {
    "share": 1,
    "limits": [0, 2.5],
    "edge": {"contrast": 0.1, "outliers": 0.0},
    "levels": [{"steps": 1}, {"steps": 2}],
    "by_name": {"first": {"steps": 4}},
}


def load(folder: Path, values: Any, key: str = "") -> Settings:
    file = folder / "mine.yaml"
    file.write_text(yaml.safe_dump(values))
    return load_settings(Settings, file, key)


def test_lists_become_tuples_and_whole_numbers_real_ones(tmp_path: Path) -> None:
    expected = Settings(1.0, (0.0, 2.5), Edge(0.1, 0.0), (Level(1), Level(2)), {"first": Level(4)})
    assert load(tmp_path, GOOD) == expected
    assert load(tmp_path, {"here": GOOD, "there": 1}, "here") == expected


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"share": 1.5}, "mine.yaml: 'share' must be less than or equal to 1, found 1.5"),
        ({"share": "0.5"}, "mine.yaml: 'share' must be a number, found '0.5'"),
        ({"share": True}, "mine.yaml: 'share' must be a number, found True"),
        ({"share": float("nan")}, "mine.yaml: share: must be finite, found nan"),
        ({"limits": [3, 2]}, "mine.yaml: 'limits' is wrong: lower 3 is not below upper 2"),
        ({"edge": {"contrast": 0.1}}, "mine.yaml: edge: key 'outliers' is missing"),
        ({"edge": 3}, "mine.yaml: 'edge' must be keys and values, found 3"),
        ({"levels": [{"steps": 1}, {"steps": 0.5}]}, "mine.yaml: levels[1]: 'steps' must be"),
        ({"levels": [{"step": 1}]}, "mine.yaml: levels[0]: unknown key 'step' (known: steps)"),
        ({"levels": 1}, "mine.yaml: 'levels' must be a list, found 1"),
        ({"by_name": {"a": {"steps": -1}}}, "mine.yaml: by_name: a: 'steps' must be greater"),
        ({"by_name": {"a": {"b": 1}}}, "mine.yaml: by_name: a: unknown key 'b' (known: steps)"),
        ({"absent": {"step": 1}}, "mine.yaml: absent: unknown key 'step' (known: steps)"),
        ({"other": 1}, "mine.yaml: unknown key 'other' (known: share, limits, edge, levels"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigurationError, match=re.escape(message)):
        load(tmp_path, {**GOOD, **change})


def test_a_missing_key_and_a_file_that_is_no_mapping_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match="mine.yaml: key 'share' is missing"):
        load(tmp_path, {key: value for key, value in GOOD.items() if key != "share"})
    with pytest.raises(ConfigurationError, match="mine.yaml: expected keys and values, found 3"):
        load(tmp_path, 3)
