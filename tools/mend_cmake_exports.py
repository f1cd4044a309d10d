"""Mend the CMake exports of the ROS wheels in the running virtual environment.

They name the Python and numpy headers of the machine that built them, and CMake refuses paths that
do not exist. This puts in those of the running Python. Mended files stay as they are.
"""

import re
import sys
import sysconfig
from pathlib import Path

import numpy as np

STALE_NUMPY = re.compile(r"/opt/python/[^/;\"]+/lib/python[\d.]+/site-packages/numpy/\w+/include")
STALE_PYTHON = re.compile(r"/opt/python/[^/;\"]+/include/python[\d.]+")


def main() -> None:
    """Rewrite both paths in every CMake file below the prefix's share."""
    python_include = sysconfig.get_paths()["include"]
    mended = 0
    for path in Path(sys.prefix, "share").rglob("*.cmake"):
        text = path.read_text(encoding="utf-8")
        fresh = STALE_NUMPY.sub(np.get_include(), text)
        fresh = STALE_PYTHON.sub(python_include, fresh)
        if fresh != text:
            path.write_text(fresh, encoding="utf-8")
            mended += 1
    print(f"  {mended} CMake files of the ROS wheels mended")


if __name__ == "__main__":
    main()
