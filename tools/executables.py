"""Print what ``run`` asks of the executables of the packages, before there is an environment.

Usage: executables.py                       lists packages and executables
       executables.py PACKAGE EXECUTABLE    prints what the executable needs beside the nodes
"""

import runpy
import sys
from pathlib import Path

SOURCES = Path(__file__).parents[1] / "src"


def main() -> int:
    """Print it; 2 if there is no such executable."""
    tables = {
        path.parent.name: runpy.run_path(str(path))["EXECUTABLES"]
        for path in sorted(SOURCES.glob("*/*/executables.py"))
    }
    if len(sys.argv) == 1:
        for package, executables in tables.items():
            print(package, *(f"    {name}" for name in executables), sep="\n")
        return 0
    package, executable = sys.argv[1:]
    if executable not in tables.get(package, {}):
        return 2
    print(tables[package][executable][1])
    return 0


if __name__ == "__main__":
    sys.exit(main())
