"""What counts as right, imprecise, a lie and a refusal, by estimates and labels made by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.evaluation.doors.errors import DoorErrors
from kmn_perception.evaluation.doors.label import DoorLabel
from kmn_perception.evaluation.doors.outcome import Outcome, Verdict, judge
from kmn_perception.evaluation.doors.room_comparison import RoomSample, Traits
from kmn_perception.evaluation.doors.room_statistics import counts, statistics
from kmn_perception.evaluation.doors.room_tables import room_report
from kmn_perception.evaluation.doors.settings import RoomEvaluationSettings
from kmn_perception.rooms.sampling import NEGATIVES

from .door_example import LABEL, MODEL, SETTINGS, estimate_of

SURE = {
    "x": 0.01, "y": 0.01, "yaw": 0.01, "door_height": 0.01, "door_width": 0.01, "handle_y": 0.01,
    "handle_z": 0.01, "opening": 0.01,
}  # fmt: skip
UNSURE = {**SURE, "y": 0.1, "yaw": 0.1}
BARE = LABEL._replace(handle=None, handle_side="")
SETTINGS_OF_ROOMS = RoomEvaluationSettings.load()
METHOD = "by_hand"


def _not_seen(estimate: DoorEstimate) -> DoorEstimate:
    return replace(estimate, status=DoorStatus.HANDLE_NOT_SEEN, handle_side="")


RIGHT = estimate_of(SURE, y=0.005)
IMPRECISE = estimate_of(UNSURE, y=0.05)
LIE = estimate_of(SURE, door_height=0.1 + 0.031, handle_z=-0.0155)  # 3.1 deviations, top only
UNCERTAIN = DoorEstimate.none("the edge is known to 74 mm", DoorStatus.AMBIGUOUS)
REFUSED = DoorEstimate.none("nothing like a door")


@pytest.mark.parametrize(
    ("estimate", "label", "verdict", "faults"),
    [
        (RIGHT, LABEL, Verdict.RIGHT, ()),
        (_not_seen(RIGHT), BARE, Verdict.RIGHT, ()),
        (IMPRECISE, LABEL, Verdict.IMPRECISE, ("left", "right")),
        (estimate_of(UNSURE, yaw=np.radians(3.1)), LABEL, Verdict.IMPRECISE, ("yaw",)),
        (LIE, LABEL, Verdict.LIE, ("top",)),
        (_not_seen(LIE), LABEL, Verdict.LIE, ("top",)),
        (RIGHT, BARE, Verdict.LIE, ("handle",)),
        (RIGHT, None, Verdict.LIE, ("door",)),
        (UNCERTAIN, LABEL, Verdict.REFUSED, ()),
        (REFUSED, None, Verdict.REFUSED, ()),
    ],
)
def test_the_verdict_is_told_by_errors_and_what_is_stated(
    estimate: DoorEstimate, label: DoorLabel | None, verdict: Verdict, faults: tuple[str, ...]
) -> None:
    outcome = judge(estimate, label, MODEL, SETTINGS)
    assert (outcome.verdict, outcome.faults) == (verdict, faults)
    assert (outcome.errors is None) == (label is None or verdict is Verdict.REFUSED)


def _outcome(estimate: DoorEstimate, label: DoorLabel | None = LABEL) -> Outcome:
    return judge(estimate, label, MODEL, SETTINGS)


def test_every_door_is_counted_once() -> None:
    estimates = (RIGHT, _not_seen(RIGHT), IMPRECISE, LIE, _not_seen(LIE), UNCERTAIN, REFUSED)
    found = counts([_outcome(estimate) for estimate in estimates])
    assert found == {
        "doors": 7, "right": 2, "ok_and_right": 1, "ok_and_wrong": 2, "not_seen_and_wrong": 1,
        "imprecise": 1, "ambiguous": 1, "no_door": 1,
    }  # fmt: skip


def _room(
    seed: int,
    outcome: Outcome,
    recess: float,
    observable: bool = True,
    milliseconds: float = 50.0,
    limit: DoorErrors | None = None,
) -> RoomSample:
    traits = Traits(recess, distance=1.2, view_angle=20.0, handle="lever", state="closed")
    seconds = {METHOD: 1e-3 * milliseconds}
    return RoomSample("door", seed, traits, observable, {METHOD: outcome}, seconds, limit)


def _negative(kind: str, outcome: Outcome) -> RoomSample:
    return RoomSample(kind, 0, None, False, {METHOD: outcome}, {METHOD: 1.0}, None)


SAMPLES = (
    _room(11, _outcome(RIGHT), 0.003, limit=_outcome(RIGHT).errors),
    _room(12, _outcome(LIE), 0.02, milliseconds=70.0),
    _room(13, _outcome(UNCERTAIN), 0.02),
    _room(14, _outcome(replace(UNCERTAIN, reason="the edge is known to 9.5 mm")), 0.06),
    _room(15, _outcome(REFUSED), 0.06, limit=_outcome(IMPRECISE).errors),
    _room(16, _outcome(IMPRECISE), 0.05, observable=False),
    _negative("brick", _outcome(REFUSED, None)),
    _negative("brick", _outcome(RIGHT, None)),
    _negative("glass", _outcome(_not_seen(RIGHT), None)),
)


def test_statistics_of_doors_and_negatives_are_apart() -> None:
    found = statistics(SAMPLES, [METHOD], SETTINGS_OF_ROOMS)
    assert (found["observable"], found["negatives"]) == (5, 3)
    method = found["methods"][METHOD]
    assert [method[key]["doors"] for key in ("of_observable", "of_all")] == [5, 6]
    assert [method[key]["imprecise"] for key in ("of_observable", "of_all")] == [0, 1]
    assert method["refused"] == {
        "ambiguous: the edge is known to # mm": 2, "no door: nothing like a door": 1,
    }  # fmt: skip
    assert method["wrong"] == {
        "quantities": {"left": 1, "right": 1, "top": 1},
        "rooms": {"12": ["OK", "top"], "16": ["OK", "left", "right"]},
    }
    parts = method["by"]["recess"]
    assert {title: (part["doors"], part["right"]) for title, part in parts.items()} == {
        "below 1 cm": (1, 1), "1 to 5 cm": (2, 0), "from 5 cm": (2, 0),
    }  # fmt: skip
    for trait in method["by"].values():
        assert sum(part["doors"] for part in trait.values()) == 5
    # Edges are off by 5, 0 and 50 mm, each of both.
    assert method["edge_mm"]["median"] == pytest.approx(5.0)
    # The limit is that of doors that are found: with the edges told, one of them, off by 5 mm.
    assert method["limit"]["edge_mm"] == {"median": pytest.approx(5.0), "p95": pytest.approx(5.0)}
    assert method["top_mm"]["p95"] == pytest.approx(np.percentile([0.0, 31.0, 0.0], 95))
    assert method["milliseconds"]["median"] == pytest.approx(50.0)
    negatives = method["negatives"]
    assert list(negatives) == list(NEGATIVES)
    assert negatives["brick"] == {"rooms": 2, "ok": 1, "not_seen": 0}
    assert negatives["glass"] == {"rooms": 1, "ok": 0, "not_seen": 1}


def test_the_shares_are_printed() -> None:
    result = statistics(SAMPLES, [METHOD], SETTINGS_OF_ROOMS)
    given = {"model": "room_door", "samples": 6, "seed": 3, "noise": "d455"}
    lines = room_report({**given, **result}).splitlines()
    assert lines[0] == (
        "room_door: 6 rooms with a door, 5 with both edges in view, and 3 without, seed 3, "
        "noise d455"
    )
    in_view = lines[lines.index("Of 5 doors with both edges in view") + 2]
    assert in_view.split()[:3] == [METHOD, "20.0", "%"]
    assert any(line.split() == ["all", "3", "1", "/", "1"] for line in lines)
    assert "    2  ambiguous: the edge is known to # mm" in lines
