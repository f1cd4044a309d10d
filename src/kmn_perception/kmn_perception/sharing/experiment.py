"""Experiments as commands: any number of processes and machines share one, and resume it."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from tqdm import tqdm

from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.configuration.hashes import shipped_hash
from kmn_perception.network.threads import use_one_thread
from kmn_perception.sharing.plain import from_plain, to_plain
from kmn_perception.sharing.processes import in_order
from kmn_perception.sharing.records import (
    FORMAT,
    WHOLE,
    Heading,
    Record,
    RecordsError,
    Shard,
    appending,
    write_line,
)

Result = TypeVar("Result")

SHARING = ("jobs", "shard", "records", "json", "words")  # on which no result depends


@dataclass(frozen=True)
class SharedExperiment(Generic[Result]):
    """What is measured of items 0, 1, ..., and what follows from that.

    Attributes
    ----------
    title, unit
        Of the bar that shows how far it is.
    items
        Their number.
    kind
        Of the results.
    make
        Makes what measures an item, see `in_order`.
    conclude
        Returns from all results what is printed, and what is written as JSON.
    worthwhile
        See `in_order`.
    depends_on
        What the results depend on beside the options, as hashes of files.
    """

    title: str
    unit: str
    items: int
    kind: Any
    make: Callable[[], Callable[[int], Result]]
    conclude: Callable[[list[Result]], tuple[str, Any]]
    worthwhile: int = 1
    depends_on: Mapping[str, Any] = field(default_factory=dict)

    def run(self, jobs: int) -> tuple[str, Any]:
        """Measure all items, and return what is concluded."""
        return self.conclude(list(self.measure(range(self.items), jobs)))

    def measure(self, items: Sequence[int], jobs: int, done: int = 0) -> Iterator[Result]:
        """Yield the results of items but the first ``done``, and show how far it is."""
        use_one_thread()
        bar: Any = tqdm(
            total=len(items), initial=done, desc=self.title, unit=f" {self.unit}", mininterval=1.0
        )
        results = in_order(self.make, items[done:], jobs, self.worthwhile)
        with bar, closing(results):
            for result in results:
                yield result
                bar.update()


@dataclass(frozen=True)
class ExperimentCommand:
    """An executable that runs an experiment.

    Attributes
    ----------
    package, name
        Of the executable.
    parser
        Returns the parser of the options that tell the experiment.
    prepare
        Returns the experiment that options tell; may complete them.
    expected
        Errors of it that are said in one line, beside those of files.
    outputs
        Names of options on which no result depends: files to write.
    jobs
        Processes where none are asked for.
    """

    package: str
    name: str
    parser: Callable[[], argparse.ArgumentParser]
    prepare: Callable[[argparse.Namespace], SharedExperiment[Any]]
    expected: tuple[type[Exception], ...]
    outputs: tuple[str, ...] = ()
    jobs: int = 1

    @property
    def errors(self) -> tuple[type[Exception], ...]:
        """All that are said in one line."""
        return (*self.expected, OSError, RecordsError)

    def parse(self, words: Sequence[str] | None) -> argparse.Namespace:
        """Return all options of a command line."""
        parser = self.parser()
        parser.add_argument("--json", type=output_file, help="file to write the result to")
        add_jobs(parser, self.jobs)
        add_shard(parser)
        parser.add_argument(
            "--records",
            type=output_file,
            help="file to keep what is measured in; where it is there, the run goes on from it",
        )
        options = parser.parse_args(words)
        if options.shard != WHOLE and options.records is None:
            parser.error("--shard needs --records, a file of its own")
        options.words = list(sys.argv[1:] if words is None else words)
        return options

    def start(self, words: Sequence[str] | None = None) -> None:
        """Run the executable; exit with what went wrong in one line."""
        options = self.parse(words)
        try:
            self.run(options)
        except KeyboardInterrupt:
            goes_on = f"; the same command goes on from {options.records}"
            sys.exit(f"{self.name}: interrupted{goes_on if options.records else ''}")
        except self.errors as error:
            sys.exit(f"{self.name}: {error}")

    def run(self, options: argparse.Namespace) -> None:
        """Measure what is not measured yet; of all items, print and write what follows."""
        experiment = self.prepare(options)
        results = self._results(experiment, options)
        if options.shard != WHOLE:
            print(
                f"{options.records} holds shard {options.shard}: {len(results)} of "
                f"{experiment.items} {experiment.unit}; ./run {self.package} merge joins all shards"
            )
            return
        text, result = experiment.conclude(results)
        print(text)
        if options.json:
            write_json(options.json, result)

    def _results(
        self, experiment: SharedExperiment[Result], options: argparse.Namespace
    ) -> list[Result]:
        items = options.shard.items(experiment.items)
        if options.records is None:
            return list(experiment.measure(items, options.jobs))
        with appending(options.records, self._heading(experiment, options)) as (file, done):
            try:
                results = [from_plain(experiment.kind, plain) for plain in done]
            except ValueError as error:
                raise RecordsError(f"{options.records} is damaged ({error})") from error
            new = experiment.measure(items, options.jobs, len(done))
            for item, result in zip(items[len(done) :], new, strict=True):
                write_line(file, Record(item, to_plain(result)))
                results.append(result)
        return results

    def _heading(self, experiment: SharedExperiment[Any], options: argparse.Namespace) -> Heading:
        kept = {
            name: str(value)
            for name, value in vars(options).items()
            if name not in (*SHARING, *self.outputs)
        }
        return Heading(
            format=FORMAT,
            command=f"{self.package} {self.name}",
            arguments=options.words,
            depends_on={**kept, "shipped files": shipped_hash(), **experiment.depends_on},
            items=experiment.items,
            shard=options.shard,
        )


def add_jobs(parser: argparse.ArgumentParser, default: int = 1) -> None:
    """Let several processes of a machine share the work of a program."""
    parser.add_argument(
        "--jobs",
        type=whole_number(1),
        default=default,
        help="processes that share the work (default %(default)s)",
    )


def add_shard(parser: argparse.ArgumentParser) -> None:
    """Let several machines share the work of a program."""
    parser.add_argument(
        "--shard",
        type=shard,
        default=WHOLE,
        metavar="I/N",
        help="do share I of N of the work, from 0; others are done elsewhere",
    )


def shard(text: str) -> Shard:
    """Parse ``I/N``."""
    index, _, count = text.partition("/")
    if not (index.isdecimal() and count.isdecimal() and int(index) < int(count)):
        raise argparse.ArgumentTypeError(f"{text} is not I/N with 0 <= I < N, e.g. 0/2")
    return Shard(int(index), int(count))
