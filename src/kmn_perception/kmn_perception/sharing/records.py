"""Files of records: what was measured of each item, a line of JSON for each, and of what run.

The first line says which command made them, of which items, and on what they depend. A line that
was being written when a run was killed is made anew; anything else that is damaged is refused.
"""

from __future__ import annotations

import fcntl
import heapq
import json
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any, NamedTuple

from kmn_perception.configuration.plain_text import parse_json
from kmn_perception.sharing.plain import from_plain, to_plain

FORMAT = 1


class RecordsError(ValueError):
    """A file of records cannot be used; the text says why, and what to do."""


class Shard(NamedTuple):
    """Every ``step``-th item from ``first`` on."""

    first: int
    step: int

    def __str__(self) -> str:
        return f"{self.first}/{self.step}"

    def items(self, total: int) -> range:
        """Return its items of so many."""
        return range(self.first, total, self.step)


WHOLE = Shard(0, 1)


@dataclass(frozen=True)
class Heading:
    """What a file of records is about.

    Attributes
    ----------
    command
        Package and executable.
    arguments
        As they were given, for who joins the files.
    depends_on
        What the results depend on: the same in all that belong together.
    items
        Of the whole run.
    """

    format: int
    command: str
    arguments: list[str]
    depends_on: dict[str, Any]
    items: int
    shard: Shard

    def check(self, other: Heading, file: Path) -> None:
        """Raise `RecordsError` if the heading of a file is of another run."""
        for name in ("format", "command", "items"):
            ours, theirs = getattr(self, name), getattr(other, name)
            if ours != theirs:
                raise RecordsError(f"{file} is of another run: {name} {theirs}, expected {ours}")
        for name in dict.fromkeys((*self.depends_on, *other.depends_on)):
            ours, theirs = (each.depends_on.get(name) for each in (self, other))
            if ours != theirs:
                raise RecordsError(f"{file} is of another run: {name} {theirs}, expected {ours}")


class Record(NamedTuple):
    """The result of an item, as JSON has it."""

    item: int
    result: Any


def read_heading(file: Path) -> Heading:
    """Return the heading of a file; raise `RecordsError` if it is none of records."""
    with file.open("rb") as lines:
        return _heading(file, lines.readline())


def read_records(file: Path) -> Iterator[Record]:
    """Yield all records of a file that were written to their end."""
    heading = read_heading(file)
    expected = heading.shard.items(heading.items)
    with file.open("rb") as lines:
        for number, line in enumerate(lines, start=1):
            if number > 1 and line.endswith(b"\n"):
                record = _record(file, number, line)
                if number - 2 >= len(expected) or record.item != expected[number - 2]:
                    raise _damaged(file, number, f"item {record.item} does not follow here")
                yield record


@contextmanager
def appending(file: Path, heading: Heading) -> Iterator[tuple[IO[bytes], list[Any]]]:
    """Yield a file of records to write to, which is made if it is not there, and its results.

    Raises
    ------
    RecordsError
        If the file is of another run or shard, damaged, or written to by another process.
    """
    with file.open("a+b") as opened:
        try:
            fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RecordsError(f"{file} is being written to by another process") from None
        opened.seek(0)
        results: list[Any] = []
        first = opened.readline()
        if first != _line(heading) and _line(heading).startswith(first):  # hardly begun
            opened.truncate(0)
            write_line(opened, heading)
        else:
            there = _heading(file, first)
            heading.check(there, file)
            if there.shard != heading.shard:
                raise RecordsError(f"{file} is of shard {there.shard}, expected {heading.shard}")
            results = [record.result for record in read_records(file)]
            opened.seek(0)
            opened.truncate(sum(len(line) for line in opened if line.endswith(b"\n")))
        yield opened, results


def write_line(opened: IO[bytes], value: Heading | Record) -> None:
    """Write a heading or a record, to be there whatever happens to this process."""
    opened.write(_line(value))
    opened.flush()


def join(files: Sequence[Path], joined: Path) -> Heading:
    """Write the records of all shards of a run to one file, and return its heading.

    Raises
    ------
    RecordsError
        If the files are not all shards of one run, each once and at its end.
    """
    headings = [read_heading(file) for file in files]
    heading = replace(headings[0], shard=WHOLE)
    for file, other in zip(files, headings, strict=True):
        heading.check(other, file)
    there = Counter(other.shard for other in headings)
    count = headings[0].shard.step
    wrong = {Shard(i, count) for i in range(count)} ^ there.keys()
    if wrong or there.total() > count:
        each = ", ".join(map(str, sorted(wrong) or [s for s, n in there.items() if n > 1]))
        raise RecordsError(f"each shard of {count} must be there once, see {each}")
    done = 0
    with joined.open("wb") as opened:
        write_line(opened, heading)
        for record in heapq.merge(*map(read_records, files), key=lambda record: record.item):
            if record.item != done:
                break
            write_line(opened, record)
            done += 1
    if done < heading.items:
        shard = Shard(done % count, count)
        raise RecordsError(
            f"shard {shard} is not at its end: item {done} of {heading.items} is missing; the same "
            "command as before goes on with it"
        )
    return heading


def _line(value: Heading | Record) -> bytes:
    return json.dumps(to_plain(value)).encode() + b"\n"


def _heading(file: Path, line: bytes) -> Heading:
    try:
        return from_plain(Heading, parse_json(line))
    except ValueError as error:
        raise RecordsError(f"{file} is no file of records ({error})") from error


def _record(file: Path, number: int, line: bytes) -> Record:
    try:
        return from_plain(Record, parse_json(line))
    except ValueError as error:
        raise _damaged(file, number, str(error)) from error


def _damaged(file: Path, number: int, why: str) -> RecordsError:
    return RecordsError(
        f"{file} is damaged at line {number} ({why}); remove it to measure its items anew"
    )
