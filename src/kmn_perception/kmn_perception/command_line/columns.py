"""Text in columns, for the tables that the offline tools print."""

from __future__ import annotations

from collections.abc import Sequence

NONE = "-"


def columns(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of text in columns: the first to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join([row[0].ljust(widths[0]), *map(str.rjust, row[1:], widths[1:])]) for row in rows
    )


def text(value: float | None, scale: float, digits: int) -> str:
    """Return a number for a table."""
    return NONE if value is None else f"{scale * value:.{digits}f}"
