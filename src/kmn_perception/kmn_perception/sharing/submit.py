"""Run an experiment as jobs of Slurm, or as processes of this machine, and join their shards."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

import submitit

from kmn_perception.command_line.arguments import output_folder, whole_number
from kmn_perception.sharing.experiment import ExperimentCommand
from kmn_perception.sharing.merge import merge
from kmn_perception.sharing.records import WHOLE

WEEK = 7 * 24 * 60  # minutes; two, submitit's default, would kill most experiments


def submit(commands: Sequence[ExperimentCommand], words: Sequence[str] | None = None) -> None:
    """Run the executable ``submit`` of a package with such commands."""
    by_name = {command.name: command for command in commands}
    parser = argparse.ArgumentParser(prog="submit", description=__doc__)
    parser.add_argument("--shards", type=whole_number(1), required=True, help="number of jobs")
    parser.add_argument(
        "--folder", type=output_folder, required=True, help="for the records and the jobs' output"
    )
    parser.add_argument(
        "--executor",
        choices=("slurm", "local"),
        help="where the jobs run; local: all at once (default slurm where it is installed)",
    )
    parser.add_argument(
        "--parameter",
        type=_parameter,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="of the jobs, as submitit has them: timeout_min=600, cpus_per_task=8, "
        "slurm_partition=long",
    )
    parser.add_argument("experiment", choices=by_name, help="what to run")
    parser.add_argument("options", nargs=argparse.REMAINDER, help="its options")
    given = parser.parse_args(words)
    command = by_name[given.experiment]
    asked = command.parse(given.options)
    if asked.shard != WHOLE or asked.records is not None:
        parser.error("--shard and --records are given to each job by this program")
    records = [given.folder / f"{i}.jsonl" for i in range(given.shards)]
    shares = [
        [*given.options, "--shard", f"{i}/{given.shards}", "--records", str(file.resolve())]
        for i, file in enumerate(records)
    ]
    given.folder.mkdir(parents=True, exist_ok=True)
    problems = _run(given, command, shares)
    if problems:
        print(*problems, "the same command goes on with these", sep="\n", file=sys.stderr)
        sys.exit(1)
    to_json = ["--json", str(asked.json)] if asked.json else []
    merge(commands, [*map(str, records), *to_json])


def run_shard(command: ExperimentCommand, words: Sequence[str]) -> str:
    """Run one shard in a process of its own; return what went wrong, or nothing."""
    try:
        command.run(command.parse(words))
    except command.errors as error:
        return str(error)
    return ""


def _run(
    given: argparse.Namespace, command: ExperimentCommand, shares: Sequence[Sequence[str]]
) -> list[str]:
    """Run all shards, and return what went wrong."""
    try:
        executor = submitit.AutoExecutor(given.folder / "jobs", cluster=given.executor)
        executor.update_parameters(
            **{"name": command.name, "timeout_min": WEEK, **dict(given.parameter)}
        )
        jobs = executor.map_array(run_shard, [command] * len(shares), shares)
    except (NameError, RuntimeError, TypeError, ValueError) as error:  # what submitit raises
        sys.exit(f"submit: {error}")
    print(f"{len(jobs)} jobs; their output is in {given.folder / 'jobs'}", file=sys.stderr)
    problems = []
    try:
        for i, job in enumerate(jobs):
            ended = job.exception()  # when it has
            problem = f"it ended, see {job.paths.stderr}" if ended else job.result()
            problems += [f"submit: shard {i}/{len(jobs)}: {problem}"] if problem else []
    except KeyboardInterrupt:
        for job in jobs:
            job.cancel(check=False)
        sys.exit("submit: interrupted, jobs cancelled; the same command goes on with them")
    return problems


def _parameter(text: str) -> tuple[str, object]:
    name, equals, value = text.partition("=")
    if not (name and equals):
        raise argparse.ArgumentTypeError(f"{text} is not NAME=VALUE")
    return name, int(value) if value.isdecimal() else value
