"""The statistics of the evaluation on rendered rooms, as written to JSON."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Any

from kmn_perception.doors.door_estimate import DoorStatus
from kmn_perception.evaluation.doors.error_statistics import ERRORS, coverage, error_sizes, times
from kmn_perception.evaluation.doors.errors import EDGES, MM
from kmn_perception.evaluation.doors.outcome import Outcome, Verdict
from kmn_perception.evaluation.doors.room_comparison import RoomSample
from kmn_perception.evaluation.doors.settings import DoorErrorSettings, RoomEvaluationSettings
from kmn_perception.rooms.sampling import NEGATIVES

Statistics = dict[str, Any]
STATES = ("closed", "ajar")
HANDLES = ("lever", "knob", "bar", "none")


def statistics(
    samples: Sequence[RoomSample], methods: Sequence[str], settings: RoomEvaluationSettings
) -> Statistics:
    """Return the statistics of all methods; errors are of all doors that are found.

    ``limit`` holds the errors of who is told the edges of the same doors, and how many of these
    are ``far_off`` all the same.
    """
    doors = [sample for sample in samples if sample.traits is not None]
    return {
        "observable": sum(sample.observable for sample in doors),
        "negatives": len(samples) - len(doors),
        "methods": {name: _of_method(name, samples, settings) for name in methods},
    }


def _of_method(
    name: str, samples: Sequence[RoomSample], settings: RoomEvaluationSettings
) -> Statistics:
    doors = [sample for sample in samples if sample.traits is not None]
    seen = [sample for sample in doors if sample.observable]
    outcomes = [sample.outcomes[name] for sample in doors]
    off = [outcome.errors for outcome in outcomes if outcome.errors is not None]
    found = [sample for sample in doors if sample.outcomes[name].errors is not None]
    limits = [sample.limit for sample in found if sample.limit is not None]
    return {
        "of_observable": counts([sample.outcomes[name] for sample in seen]),
        "of_all": counts(outcomes),
        "wrong": _faults(name, doors),
        "refused": _reasons([sample.outcomes[name] for sample in seen], settings.reasons),
        **{key: error_sizes(off, key) for key in ERRORS},
        "limit": {
            **{key: error_sizes(limits, key) for key in ERRORS},
            "doors": len(limits),
            "far_off": sum(bool(errors.far_off(DoorErrorSettings.load())) for errors in limits),
        },
        "by_stated": _by_stated([sample.outcomes[name] for sample in seen], settings),
        "coverage95": coverage(off, settings.confidence),
        "milliseconds": times([sample.seconds[name] for sample in doors]),
        "by": {
            trait: {
                title: counts([sample.outcomes[name] for sample in part]) for title, part in parts
            }
            for trait, parts in _breakdowns(seen, settings)
        },
        "negatives": {
            kind: _found([sample.outcomes[name] for sample in samples if sample.kind == kind])
            for kind in NEGATIVES
        },
    }


def counts(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """Return how many doors are right, wrong and refused.

    ``right``, ``ok_and_wrong``, ``not_seen_and_wrong`` and the two refusals add up to ``doors``.
    """
    found = Counter((outcome.status, outcome.verdict.is_wrong) for outcome in outcomes)
    verdicts = Counter(outcome.verdict for outcome in outcomes)
    return {
        "doors": len(outcomes),
        "right": verdicts[Verdict.RIGHT],
        "ok_and_right": found[DoorStatus.OK, False],
        "ok_and_wrong": found[DoorStatus.OK, True],
        "not_seen_and_wrong": found[DoorStatus.HANDLE_NOT_SEEN, True],
        "imprecise": verdicts[Verdict.IMPRECISE],
        "ambiguous": found[DoorStatus.AMBIGUOUS, False],
        "no_door": found[DoorStatus.NO_DOOR, False],
    }


def _found(outcomes: Sequence[Outcome]) -> dict[str, int]:
    """Return in how many rooms a door is found that is not there."""
    statuses = Counter(outcome.status for outcome in outcomes)
    return {
        "rooms": len(outcomes),
        "ok": statuses[DoorStatus.OK],
        "not_seen": statuses[DoorStatus.HANDLE_NOT_SEEN],
    }


def _faults(name: str, doors: Sequence[RoomSample]) -> Statistics:
    """Return which quantities are wrong how often, and in which rooms, by the seeds of these."""
    wrong = [(s.seed, s.outcomes[name]) for s in doors if s.outcomes[name].verdict.is_wrong]
    faults = Counter(fault for _, outcome in wrong for fault in outcome.faults)
    return {
        "quantities": dict(sorted(faults.items(), key=lambda item: (-item[1], item[0]))),
        "rooms": {str(seed): [outcome.status.name, *outcome.faults] for seed, outcome in wrong},
    }


def _reasons(outcomes: Sequence[Outcome], number: int) -> dict[str, int]:
    """Return the commonest reasons of refusals, without their numbers."""
    reasons = Counter(
        f"{outcome.status.value}: {re.sub(r'-?[0-9]+([.][0-9]+)?', '#', outcome.reason)}"
        for outcome in outcomes
        if outcome.verdict is Verdict.REFUSED
    )
    # Of equally common ones the same are named, in whatever order they came.
    return dict(sorted(reasons.items(), key=lambda item: (-item[1], item[0]))[:number])


def _by_stated(outcomes: Sequence[Outcome], settings: RoomEvaluationSettings) -> Statistics:
    """Return the counts of doors that are found, by the deviation that is stated of their edges."""
    stated = [
        (outcome, outcome.errors.stated[EDGES].max() / MM)
        for outcome in outcomes
        if outcome.errors is not None
    ]
    return {
        _title(1e3 * low, 1e3 * high, "mm"): counts(
            [outcome for outcome, deviation in stated if low <= deviation < high]
        )
        for low, high in pairwise((0.0, *settings.bins.stated, float("inf")))
    }


def _breakdowns(
    seen: Sequence[RoomSample], settings: RoomEvaluationSettings
) -> Iterator[tuple[str, list[tuple[str, list[RoomSample]]]]]:
    """Yield the name of each trait with its parts: their titles, and the samples in them."""
    traits = [(sample, sample.traits) for sample in seen if sample.traits is not None]
    scales = (("recess", 100.0, "cm"), ("distance", 1.0, "m"), ("view_angle", 1.0, "deg"))
    for name, scale, unit in scales:
        limits = (0.0, *getattr(settings.bins, name), float("inf"))
        parts = [
            (
                _title(scale * low, scale * high, unit),
                [sample for sample, trait in traits if low <= getattr(trait, name) < high],
            )
            for low, high in pairwise(limits)
        ]
        yield name, parts
    for name, values in (("handle", HANDLES), ("state", STATES)):
        yield name, [(v, [s for s, trait in traits if getattr(trait, name) == v]) for v in values]


def _title(low: float, high: float, unit: str) -> str:
    if low == 0.0:
        return f"below {high:g} {unit}"
    return f"from {low:g} {unit}" if high == float("inf") else f"{low:g} to {high:g} {unit}"
