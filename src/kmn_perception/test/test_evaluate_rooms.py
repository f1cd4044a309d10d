"""The evaluation of doors in rendered rooms, as a command."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from kmn_perception.configuration import resources
from kmn_perception.evaluation import evaluate
from kmn_perception.evaluation.doors.error_statistics import ERRORS
from kmn_perception.evaluation.doors.room_comparison import ROOM_METHODS, room_frame
from kmn_perception.evaluation.evaluate import main
from kmn_perception.rooms.frame import make_frame
from kmn_perception.rooms.sampling import KINDS, NEGATIVES

FOUR = ("--model", "room_door", "--samples", "4", "--seed", "3", "--noise", "d455")
PARTITION = ("right", "ok_and_wrong", "not_seen_and_wrong", "ambiguous", "no_door")


def _run(folder: Path, *more: str) -> tuple[dict[str, Any], str]:
    out, printed = folder / "result.json", io.StringIO()
    with contextlib.redirect_stdout(printed):
        main([*FOUR, "--json", str(out), *more])
    return json.loads(out.read_text()), printed.getvalue()


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str]:
    return _run(tmp_path_factory.mktemp("rooms"), "--jobs", "1")


def test_all_methods_see_the_same_rooms(run: tuple[dict[str, Any], str]) -> None:
    result, _ = run
    assert {key: result[key] for key in ("model", "samples", "seed", "noise", "negatives")} == {
        "model": "room_door", "samples": 4, "seed": 3, "noise": "d455", "negatives": 1,
    }  # fmt: skip
    file = resources.find("weights", "room_door", ".safetensors")
    assert result["weights"] == {"own": hashlib.sha256(file.read_bytes()).hexdigest()[:12]}
    assert list(result["methods"]) == list(ROOM_METHODS)
    for method in result["methods"].values():
        for key, doors in (("of_all", 4), ("of_observable", result["observable"])):
            found = method[key]
            assert found["doors"] == doors == sum(found[part] for part in PARTITION)
        found = method["of_all"]
        wrong = found["ok_and_wrong"] + found["not_seen_and_wrong"]
        assert len(method["wrong"]["rooms"]) == wrong >= found["imprecise"]
        for key in ERRORS:
            assert set(method[key]) == {"median", "p95"}
        assert method["milliseconds"]["p95"] >= method["milliseconds"]["median"] > 0.0
        assert list(method["by"]) == ["recess", "distance", "view_angle", "handle", "state"]
        for parts in method["by"].values():
            assert sum(part["doors"] for part in parts.values()) == result["observable"]
        found = sum(part["doors"] for part in method["by_stated"].values())
        assert found <= result["observable"]
        assert found == sum(
            part["right"] + part["ok_and_wrong"] + part["not_seen_and_wrong"]
            for part in method["by_stated"].values()
        )
        assert method["limit"]["far_off"] <= method["limit"]["doors"] <= result["samples"]
        rooms = {kind: part["rooms"] for kind, part in method["negatives"].items()}
        assert rooms == {kind: int(kind == NEGATIVES[0]) for kind in NEGATIVES}


def test_a_row_of_each_table_is_printed(run: tuple[dict[str, Any], str]) -> None:
    lines = run[1].splitlines()
    for method in ROOM_METHODS:
        # Of those in view, of all, errors, and what is wrong.
        assert sum(line.startswith(method) for line in lines) == 4
    for kind in NEGATIVES:
        assert sum(line.startswith(f"{kind} ") for line in lines) == 1


@pytest.mark.slow
def test_several_processes_find_the_same_as_one(
    run: tuple[dict[str, Any], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(evaluate, "WORTHWHILE", 1)
    again = _run(tmp_path, "--jobs", "2")[0]["methods"]
    for name, method in run[0]["methods"].items():
        for statistics in (method, again[name]):
            statistics.pop("milliseconds")
        assert again[name] == method


def test_rooms_are_those_of_seeds_that_never_train() -> None:
    first, again, other, negative = (
        room_frame(seed, number, "none", kind)
        for seed, number, kind in ((3, 0, "door"), (3, 0, "door"), (3, 1, "door"), (3, 0, "brick"))
    )
    assert first[0] == again[0] != other[0]
    assert first[0] > 2**32  # those that train are below
    np.testing.assert_array_equal(first[1].depth, make_frame(first[0], "none").depth)
    assert negative[1].room.kind == "brick"


@pytest.mark.parametrize("kind", KINDS)
def test_negatives_are_the_rooms_without_a_door(kind: str) -> None:
    room = room_frame(5, 0, "none", kind)[1].room
    assert (room.door is None) == (kind in NEGATIVES)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--noise", "mm"], "rooms are seen with the noise none, kinect, d455, d435, azure_kinect"),
        (["--methods", "icp"], "methods for 'room_door' are with_network, without_network, depth"),
        (["--weights", "door"], "not one that proposes doors in walls"),
        (["--paper-weights", "door"], "the paper has no network for 'room_door'"),
        (["--model", "door", "--noise", "d455"], "'door' is seen with the noise none, mm, kinect"),
        (
            ["--model", "door", "--noise", "none", "--methods", "depth_alone"],
            "no method for 'door'",
        ),
    ],
)
def test_what_does_not_suit_a_model_is_refused(more: list[str], message: str) -> None:
    with pytest.raises(SystemExit, match=f"evaluate: .*{message}"):
        main([*FOUR, *more])
