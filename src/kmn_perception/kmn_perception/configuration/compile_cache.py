"""Where numba keeps what it has compiled.

By default that is beside the sources, which not every user may write, and what it finds there after
an upgrade may name classes that no longer exist, which it cannot read.
"""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"  # numba reads it when it is imported
CLASS = re.compile(rb"^class (\w+)", re.MULTILINE)


def choose_compile_cache(sources: Path) -> None:
    """Choose a folder that can be written, unless the user has chosen one.

    Parameters
    ----------
    sources
        Folder of the package. The cache's name depends on the names of its modules and classes:
        sources that are edited go on with the same cache, where numba itself sees what is out of
        date.
    """
    if os.environ.get(VARIABLE):
        return
    name = f"numba-{_fingerprint(sources)}"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    own = f"kmn-{os.getuid()}"
    for folder in (Path(home, "kmn", name), Path(tempfile.gettempdir(), own, name)):
        if _is_ours(folder):
            os.environ[VARIABLE] = str(folder)
            return
    os.environ[VARIABLE] = tempfile.mkdtemp(prefix="kmn-numba-")  # compiles at each start


def _fingerprint(sources: Path) -> str:
    """Return a short text that changes with the names of modules and classes."""
    digest = hashlib.sha256()
    for path in sorted(sources.rglob("*.py")):
        digest.update(str(path.relative_to(sources)).encode())
        digest.update(b" ".join(CLASS.findall(path.read_bytes())))
    return digest.hexdigest()[:12]


def _is_ours(folder: Path) -> bool:
    """Make a folder where there is none; tell whether nobody else can put code into it."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        found = [path.lstat() for path in (folder.parent, folder)]
    except OSError:
        return False
    return os.access(folder, os.W_OK) and all(
        path.st_uid == os.getuid() and not path.st_mode & 0o022 for path in found
    )
