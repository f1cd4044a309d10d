"""Join what the shards of an experiment measured, and print and write what one run would."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from kmn_perception.command_line.arguments import output_file
from kmn_perception.sharing.experiment import ExperimentCommand
from kmn_perception.sharing.records import WHOLE, RecordsError, join


def merge(commands: Sequence[ExperimentCommand], words: Sequence[str] | None = None) -> None:
    """Run the executable ``merge`` of a package with such commands."""
    parser = argparse.ArgumentParser(prog="merge", description=__doc__)
    parser.add_argument("files", type=Path, nargs="+", help="--records of all shards of one run")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    parser.add_argument("--records", type=output_file, help="file to keep all records in")
    options = parser.parse_args(words)
    try:
        _merge(commands, options)
    except (OSError, RecordsError) as error:
        sys.exit(f"merge: {error}")


def _merge(commands: Sequence[ExperimentCommand], options: argparse.Namespace) -> None:
    with ExitStack() as stack:
        joined = options.records
        if joined is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            joined = Path(folder) / "records.jsonl"
        elif joined in options.files:
            raise RecordsError(f"{joined} is one of the files to join: name another")
        heading = join(options.files, joined)
        by_name = {f"{command.package} {command.name}": command for command in commands}
        if heading.command not in by_name:
            known = ", ".join(by_name)
            raise RecordsError(
                f"{options.files[0]} is of '{heading.command}'; joined here are: {known}"
            )
        command = by_name[heading.command]
        again = command.parse(heading.arguments)
        again.records, again.shard, again.json = joined, WHOLE, options.json
        for name in command.outputs:
            setattr(again, name, None)
        try:
            command.run(again)
        except command.errors as error:
            raise RecordsError(str(error)) from error
