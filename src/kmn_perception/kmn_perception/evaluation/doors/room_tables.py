"""The statistics of the evaluation on rendered rooms, as they are printed."""

from __future__ import annotations

from typing import Any

from kmn_perception.command_line.columns import NONE, columns, text
from kmn_perception.evaluation.doors.error_statistics import HEADS, error_cells, pair

COUNTS = {
    "right": "right",
    "ok_and_right": "of it OK",
    "ok_and_wrong": "OK, wrong",
    "not_seen_and_wrong": "not seen, wrong",
    "imprecise": "of wrong: imprecise",
    "ambiguous": "ambiguous",
    "no_door": "no door",
}
PARTS = ("right", "ok_and_wrong", "not_seen_and_wrong")  # of the breakdowns


def room_report(result: dict[str, Any]) -> str:
    """Return the tables of an evaluation on rendered rooms.

    Parameters
    ----------
    result
        As written to JSON.
    """
    methods: dict[str, Any] = result["methods"]
    doors, seen = result["samples"], result["observable"]
    title = (
        f"{result['model']}: {doors} rooms with a door, {seen} with both edges in view, and "
        f"{result['negatives']} without, seed {result['seed']}, noise {result['noise']}"
    )
    blocks = [
        title,
        f"Of {seen} doors with both edges in view\n{_counts(methods, 'of_observable')}",
        f"Of all {doors} doors\n{_counts(methods, 'of_all')}",
        "Errors of the doors that are found: median / 95th percentile, mm and degrees;\n"
        "limit: of the same doors, if their edges are told\n" + _errors(methods),
        "What is wrong, of all doors that are found\n"
        "limit: what is too far off of the same doors, if their edges are told\n"
        + _faults(methods),
        "By the larger deviation that is stated of the edges, of those in view that are found:\n"
        "doors, right / OK, wrong / not seen, wrong\n" + _by_stated(methods),
        *(f"Refused by {name}, of those in view\n{_reasons(m)}" for name, m in methods.items()),
        *_breakdowns(methods),
        "Doors that are not there: OK / handle not seen, of rooms\n" + _negatives(methods),
    ]
    return "\n\n".join(blocks)


def _counts(methods: dict[str, Any], key: str) -> str:
    rows = [["method", *COUNTS.values()]]
    for name, method in methods.items():
        rows.append([name, *(_share(method[key], count) for count in COUNTS)])
    return columns(rows)


def _share(counts: dict[str, int], key: str) -> str:
    """Return a count as a share of the doors."""
    doors = counts["doors"]
    return f"{100 * counts[key] / doors:.1f} %" if doors else NONE


def _errors(methods: dict[str, Any]) -> str:
    rows = [["method", *HEADS.values(), "in 95 %", "ms"]]
    for name, method in methods.items():
        covered = (
            NONE if method["coverage95"] is None else f"{text(method['coverage95'], 100, 1)} %"
        )
        rows.append([name, *error_cells(method), covered, pair(method["milliseconds"], 0)])
        rows.append(["limit", *error_cells(method["limit"]), "", ""])
    return columns(rows)


def _faults(methods: dict[str, Any]) -> str:
    rows = [["method", "wrong", "quantities"]]
    for name, method in methods.items():
        parts = (f"{fault} {count}" for fault, count in method["wrong"]["quantities"].items())
        rows.append([name, str(len(method["wrong"]["rooms"])), ", ".join(parts) or NONE])
        limit = method["limit"]
        rows.append(["limit", str(limit["far_off"]), f"of {limit['doors']}"])
    return columns(rows)


def _by_stated(methods: dict[str, Any]) -> str:
    first = next(iter(methods.values()))["by_stated"]
    rows = [["stated", *methods]]
    for part in first:
        counts = [method["by_stated"][part] for method in methods.values()]
        rows.append([part, *(f"{c['doors']}, {_triple(c)}" for c in counts)])
    return columns(rows)


def _reasons(method: dict[str, Any]) -> str:
    return "\n".join(f"{count:5d}  {why}" for why, count in method["refused"].items()) or NONE


def _breakdowns(methods: dict[str, Any]) -> list[str]:
    """Return a table for each trait: a line for each part of the doors in view."""
    first = next(iter(methods.values()))["by"]
    return [
        f"By {trait.replace('_', ' ')}, of those in view: right / OK, wrong / not seen, wrong\n"
        + columns(
            [
                [trait.replace("_", " "), "doors", *methods],
                *(
                    [
                        part,
                        str(parts[part]["doors"]),
                        *(_triple(method["by"][trait][part]) for method in methods.values()),
                    ]
                    for part in parts
                ),
            ]
        )
        for trait, parts in first.items()
    ]


def _triple(counts: dict[str, int]) -> str:
    return " / ".join(_share(counts, key) for key in PARTS) if counts["doors"] else NONE


def _negatives(methods: dict[str, Any]) -> str:
    first = next(iter(methods.values()))["negatives"]
    rows = [["kind", "rooms", *methods]]
    for kind in first:
        parts = [method["negatives"][kind] for method in methods.values()]
        rows.append(
            [kind, str(parts[0]["rooms"]), *(f"{p['ok']} / {p['not_seen']}" for p in parts)]
        )
    sums = [
        {
            key: sum(p[key] for p in method["negatives"].values())
            for key in ("rooms", "ok", "not_seen")
        }
        for method in methods.values()
    ]
    rows.append(["all", str(sums[0]["rooms"]), *(f"{s['ok']} / {s['not_seen']}" for s in sums)])
    return columns(rows)
