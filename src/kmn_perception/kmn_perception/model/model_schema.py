"""Print the JSON schema of a model's file, or with --tables the reference of its keys."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence

from kmn_perception.model.model_format import schema, tables


def main(argv: Sequence[str] | None = None) -> None:
    """Run the executable."""
    parser = argparse.ArgumentParser(prog="model_schema", description=__doc__)
    parser.add_argument("--tables", action="store_true", help="Markdown in place of the schema")
    options = parser.parse_args(argv)
    print(tables().rstrip() if options.tables else json.dumps(schema(), indent=2))
