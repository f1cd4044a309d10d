"""Whether messages still reach this process by the shared memory of Fast DDS.

A process listens at files of ``/dev/shm``, one for each port. Where nodes are killed and started
again, another process may take the file of a living one for a dead one's, and remove it (Fast DDS
2.14, issues 5053 and 5469): all that others send then goes to a new file of that name, which
nobody reads. The node sends as ever, but is deaf, without an error on either side.
"""

from __future__ import annotations

import re
from pathlib import Path

_LISTENER = re.compile(r"dds\.shm\.(\d+)")  # name of the thread that reads a port
_PORT = re.compile(r"/dev/shm/\w+_port(\d+)( \(deleted\))?$", re.MULTILINE)  # of the memory map


def lost_ports(process: str = "self") -> list[int]:
    """Return the ports at which a process listens, but whose files were removed.

    Empty where there is no such transport, or nothing that tells (``/proc`` of Linux).

    Parameters
    ----------
    process
        Its number; ``self`` is the one that asks.
    """
    folder = Path("/proc", process)
    names = [_read(task / "comm").strip() for task in folder.glob("task/*")]
    ports = {found[1] for name in names if (found := _LISTENER.fullmatch(name))}
    mapped = _PORT.findall(_read(folder / "maps"))
    there = {port for port, gone in mapped if not gone}
    removed = {port for port, gone in mapped if gone}
    return sorted(int(port) for port in ports & removed - there)


def _read(file: Path) -> str:
    try:
        return file.read_text(errors="replace")
    except OSError:  # a thread that has ended
        return ""
