"""What a training frees it is given again without new pages from the system."""

from __future__ import annotations

import subprocess
import sys

import pytest

PROGRAM = """
import resource, sys
from kmn_perception.training.memory import keep_freed_memory
if sys.argv[1] == "kept":
    keep_freed_memory()
for _ in range(2):  # the first time all pages are new
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(20):
        batch = [b'1' * 24_000_000 for _ in range(4)]
        del batch
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""
PAGES = 20 * 4 * 24_000_000 // 4096  # of all that is asked for


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the library is glibc's")
def test_freed_memory_is_used_again() -> None:
    def faults(how: str) -> int:
        arguments = [sys.executable, "-c", PROGRAM, how]
        return int(subprocess.run(arguments, capture_output=True, check=True).stdout)

    assert faults("kept") < 0.1 * PAGES
    assert faults("given back") > 0.5 * PAGES
