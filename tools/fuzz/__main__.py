"""Send hostile files and messages to all that reads them, and count what falls."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from fuzz import talks, trials
from fuzz.files import kinds
from fuzz.outcome import VERDICTS, Fault, Outcome
from kmn_perception.command_line.arguments import output_folder, whole_number
from kmn_perception.command_line.columns import columns
from kmn_perception.ros.program import own_arguments, ros_session

SHOWN = 10  # faults of a kind


def arguments(argv: Sequence[str] | None = None) -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
    parser.add_argument("--cases", type=whole_number(1), default=10000, help="default 10000")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="default 0")
    parser.add_argument("--what", choices=("all", "files", "messages"), default="all")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="send what was kept again")
    parser.add_argument("--only", nargs="+", default=[], metavar="KIND", help="kinds of files")
    parser.add_argument("--case", type=whole_number(0), help="this case again, of one kind")
    parser.add_argument(
        "--out", type=output_folder, default=Path("outputs/fuzz"), help="folder for what falls"
    )
    return parser.parse_args(argv)


def fuzz_files(options: argparse.Namespace, folder: Path) -> list[Outcome]:
    """Let hostile files be read."""
    chosen = [kind for kind in kinds(folder) if not options.only or kind.name in options.only]
    outcomes = []
    for number, kind in enumerate(tqdm(chosen, unit="kind", desc="files")):
        cases = list(range(number, options.cases, len(chosen)))
        outcomes.append(trials.run(kind, options.seed, cases, folder, options.out))
    return outcomes


def table(outcomes: Sequence[Outcome]) -> str:
    """Return what became of all cases for people to read."""
    rows = [["kind", "cases", *VERDICTS, "faults"]]
    total: Counter[str] = Counter()
    for kind, cases, counts, faults in outcomes:
        numbers = counts + Counter(cases=cases, faults=len(faults))
        total += numbers
        rows.append([kind, *(str(numbers[name]) for name in rows[0][1:])])
    return columns([*rows, ["all", *(str(total[name]) for name in rows[0][1:])]])


def report(faults: Sequence[Fault]) -> str:
    """Return each fault once, with how to see it again."""
    places = Counter(fault.place for fault in faults)
    first = {fault.place: fault for fault in reversed(faults)}
    return "\n".join(
        f"{places[place]} x {place}\n    {fault.again}  ({fault.file})"
        for place, fault in sorted(first.items())
    )


def main() -> int:
    """Run it; 1 if there were faults."""
    options = arguments(own_arguments())
    options.out = options.out.absolute()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.replay:
        with ros_session("fuzz"):
            print(talks.replay(options.replay, options.seed))
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if options.case is not None:
            (kind,) = (kind for kind in kinds(folder) if kind.name in options.only)
            print(trials.replay(kind, options.seed, options.case, folder))
            return 0
        outcomes = [] if options.what == "messages" else fuzz_files(options, folder)
    if options.what != "files":
        with ros_session("fuzz"):
            outcomes += talks.run(options.cases, options.seed, options.out)
    print(table(outcomes))
    faults = [fault for outcome in outcomes for fault in outcome.faults]
    if faults:
        print(report(faults))
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
