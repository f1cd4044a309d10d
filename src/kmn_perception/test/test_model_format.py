"""The format of a model's file: schema, reference and reader say the same."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_perception.model.model_format import GROUPS, schema, tables
from kmn_perception.network.paper_network import PaperNetwork

MODELS = resources.share_directory() / "config/models"
FILES = {path.stem: yaml.safe_load(path.read_text()) for path in sorted(MODELS.glob("*.yaml"))}
VALIDATOR = jsonschema.Draft7Validator(schema())
UNCHECKED = ("alternatives", "surroundings", "mechanics")  # by the reader of models alone
Place = tuple[Any, ...]


def mappings(value: Any, place: Place = ()) -> Iterator[tuple[Place, dict[str, Any]]]:
    """Yield all mappings of a file that have keys of their own, and where they are."""
    if isinstance(value, dict):
        if place not in {("bodies",), ("joints",), ("actions",)}:
            yield place, value
        for key, inner in value.items():
            if key not in (*UNCHECKED, "constant"):
                yield from mappings(inner, (*place, key))
    elif isinstance(value, list):
        for i, inner in enumerate(value):
            yield from mappings(inner, (*place, i))


def at(content: Any, place: Place) -> Any:
    for key in place:
        content = content[key]
    return content


def is_linear(place: Place) -> bool:
    """Tell whether a mapping is an entry that is linear in gamma: its keys are parameters."""
    return len(place) > 1 and place[-2] in ("centre", "size", "origin")


def is_read(content: Any, tmp_path: Path) -> bool:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    try:
        KinematicModel.load(file)
    except ConfigurationError as error:
        assert "mine.yaml" in str(error)
        return False
    return True


@pytest.mark.parametrize("name", FILES)
def test_shipped_models_follow_the_schema_that_they_name(name: str) -> None:
    VALIDATOR.validate(FILES[name])
    first = (MODELS / f"{name}.yaml").read_text().splitlines()[0]
    file = MODELS / first.removeprefix("# yaml-language-server: $schema=")
    assert json.loads(file.read_text()) == schema()


@pytest.mark.parametrize("name", ["door", "drawer", "lid"])
@pytest.mark.parametrize("change", ["missing", "unknown"])
def test_schema_and_reader_want_the_same_keys(name: str, change: str, tmp_path: Path) -> None:
    """Each key is taken out of each mapping, and an unknown one is put into it."""
    tried = 0
    for place, mapping in mappings(FILES[name]):
        if is_linear(place):
            continue
        for key in mapping if change == "missing" else ["colour"]:
            content = copy.deepcopy(FILES[name])
            if change == "missing":
                del at(content, place)[key]
            else:
                at(content, place)[key] = 1
            if change == "missing" and key in ("bodies", "joints", "gamma"):
                continue  # others refer to what is in there
            tried += 1
            assert is_read(content, tmp_path) == VALIDATOR.is_valid(content), (place, key)
    assert tried > 10


@pytest.mark.parametrize(
    "change",
    [
        lambda c: c["theta"][0].update(kind="shear"),
        lambda c: c["theta"][0].update(axis="w"),
        lambda c: c["theta"][0].update(limits=[1]),
        lambda c: c["gamma"][0].update(unit="cm"),
        lambda c: c["bodies"]["front"].update(size=[1, 2]),
        lambda c: c["bodies"]["front"].update(size=[1, 2, "x"]),
        lambda c: c["joints"]["slide"].update(type="screw"),
        lambda c: c["joints"]["slide"].update(origin=[0, 0, 0]),
        lambda c: c["joints"]["mount"].update(axis=[0, 0, 1]),
        lambda c: c["actions"]["open"]["grasp"].update(axis="up"),
        lambda c: c["actions"]["open"]["grasp"].update(others=[0.0, 0.0, 0.1]),
        lambda c: c.update(start="anywhere"),
        lambda c: c.update(theta=[]),
        lambda c: c.update(bodies={}),
    ],
)
def test_what_the_schema_refuses_the_reader_refuses(
    change: Callable[[Any], None], tmp_path: Path
) -> None:
    content = copy.deepcopy(FILES["drawer"])
    change(content)
    assert not VALIDATOR.is_valid(content)
    assert not is_read(content, tmp_path)


def test_the_reference_holds_all_keys() -> None:
    root = Path(__file__).resolve().parents[3]
    text = (root / "docs/model_format.md").read_text()
    assert text.endswith(f"## All keys\n\n{tables()}"), "make parameter-tables writes it anew"
    named = {key for _, keys in GROUPS.values() for key in keys}
    assert {key for file in FILES.values() for key in file} <= named


def test_the_example_of_the_reference_is_read(tmp_path: Path) -> None:
    root = Path(__file__).resolve().parents[3]
    example = (root / "docs/model_format.md").read_text().split("```yaml\n")[1].split("```")[0]
    content = yaml.safe_load(example)
    VALIDATOR.validate(content)
    assert is_read(content, tmp_path)


def test_a_camera_lies_beside_the_model_that_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    camera = yaml.safe_load(resources.find("config/cameras", "furniture").read_text())
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine/camera.yaml").write_text(yaml.safe_dump({**camera, "width": 320}))
    content = {**FILES["drawer"], "camera": "camera.yaml"}
    (tmp_path / "mine/model.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    monkeypatch.chdir(tmp_path)
    assert KinematicModel.load("mine/model.yaml").camera.width == 320
    content["camera"] = "lens.yaml"
    (tmp_path / "mine/model.yaml").write_text(yaml.safe_dump(content, sort_keys=False))
    with pytest.raises(ConfigurationError, match="model.yaml.*'lens.yaml' is neither a file nor"):
        KinematicModel.load("mine/model.yaml")


def test_the_papers_network_says_what_it_misses() -> None:
    model = KinematicModel.load("drawer")
    assert model.input is None
    with pytest.raises(ConfigurationError, match="drawer: key 'input' is missing"):
        PaperNetwork(model, [2, 2, 2, 2, 2])
