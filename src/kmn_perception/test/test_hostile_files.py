"""Files that made readers stumble: each is refused by an error that names it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from kmn_perception.configuration.node_parameters import ParameterError, parameter_values
from kmn_perception.configuration.resources import share_directory
from kmn_perception.configuration.section import ConfigurationError, Section
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.model.camera import Camera
from kmn_perception.sharing.records import RecordsError, read_records
from kmn_perception.training.run import RunError
from kmn_perception.training.wall.settings import WallTrainingSettings
from kmn_perception.training.wall.shards import read_shards

BILLIONS = "a: &a [x, x]\n" + "".join(
    f"{new}: &{new} [{', '.join([f'*{old}'] * 10)}]\n"
    for old, new in zip("abcdefgh", "bcdefghi", strict=True)
)


@pytest.mark.parametrize("text", [
    "a: " + "[" * 20000,
    "a: " + "[" * 100 + "]" * 100,
    BILLIONS,
    "a: &a [*a]",
    "a: 2020-99-99",
    "a: " + "9" * 5000,
    "a: 0x" + "f" * 5000,
    "a: !!int ''",
    "a: !!python/object/apply:os.system ['touch canary']",
    "[a, b]",
])  # fmt: skip
def test_yaml_is_refused_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "mine.yaml"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match="mine.yaml: .+"):
        Section.load(file)
    assert [each.name for each in tmp_path.iterdir()] == ["mine.yaml"]


@pytest.mark.parametrize("text", ["[" * 20000, '{"a":' * 20000, f'{{"a": {10**400}}}', "{", "3"])
def test_json_is_refused_by_its_name(tmp_path: Path, text: str) -> None:
    file = tmp_path / "mine.json"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match="mine.json: .+"):
        Section.load_json(file)
    file.write_text(text + "\n")
    with pytest.raises(RecordsError, match="mine.json"):
        list(read_records(file))


def test_a_camera_must_look_somewhere_else_than_where_it_is(tmp_path: Path) -> None:
    text = (share_directory() / "config/cameras/d435.yaml").read_text(encoding="utf-8")
    file = tmp_path / "mine.yaml"
    for place in ("[-2.5, 0.0, 1.2]", "[-2.5, 0.0, 0.0]"):
        file.write_text(text.replace("[0.0, 0.0, 1.1]", place))
        with pytest.raises(ConfigurationError, match="mine.yaml: pose: 'look_at' must not be at"):
            Camera.load(file)


@pytest.mark.parametrize("value", ["[1, 2]", "many", "true", "{a: 1}"])
def test_a_parameter_of_another_type_is_refused_by_its_file(tmp_path: Path, value: str) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(f"/**: {{ros__parameters: {{iterations: {value}}}}}")
    with pytest.raises(ParameterError, match=r"mine.yaml.*'iterations' must be of type int"):
        parameter_values("morph_node", str(file))


def test_rooms_that_cannot_be_unpacked_are_refused_by_their_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.npz"
    np.savez_compressed(file, cells=np.arange(4000) % 7, columns=[1], targets=[], rooms=[])
    content = bytearray(file.read_bytes())
    content[60:200] = bytes(140)
    file.write_bytes(content)
    with pytest.raises(RunError, match=r"mine.npz is damaged"):
        read_shards([file], WallTrainingSettings.load("room_door"), DoorSettings.load())
