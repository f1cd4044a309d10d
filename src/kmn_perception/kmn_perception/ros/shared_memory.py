"""Whether messages still reach this process by the shared memory of Fast DDS.

A process listens at files of ``/dev/shm``, one for each port. Where nodes are killed and started
again, another process may take the file of a living one for a dead one's, and remove it (Fast DDS
2.14, issues 5053 and 5469): all that others send then goes to a new file of that name, which
nobody reads. The node sends as ever, but is deaf, without an error on either side.
"""

from __future__ import annotations

import re
from pathlib import Path

MEMORY = Path("/dev/shm")
_LISTENER = re.compile(r"dds\.shm\.(\d+)")  # name of the thread that reads a port
_FILE = "fastrtps_port{}"


def lost_ports(process: str = "self") -> list[int]:
    """Return the ports at which a process listens, but whose files are not those it reads.

    Empty where there is no such transport, or nothing that tells (``/proc`` of Linux).

    Parameters
    ----------
    process
        Its number; ``self`` is the one that asks.
    """
    folder = Path("/proc", process)
    names = [_read(task / "comm") for task in folder.glob("task/*")]
    ports = [int(found[1]) for name in names if (found := _LISTENER.fullmatch(name.strip()))]
    mapped = {line.split()[4] for line in _read(folder / "maps").splitlines() if "_port" in line}
    return sorted(port for port in ports if _number(MEMORY / _FILE.format(port)) not in mapped)


def _number(file: Path) -> str:
    """Return the number of a file's content, by which maps name it; empty if there is no file."""
    try:
        return str(file.stat().st_ino)
    except OSError:
        return ""


def _read(file: Path) -> str:
    try:
        return file.read_text(errors="replace")
    except OSError:  # a thread that has ended
        return ""
