"""Hostile files, each read in a process that may die or hang, and what becomes of them."""

from __future__ import annotations

import linecache
import multiprocessing
import os
import resource
import traceback
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from random import Random

from rclpy.exceptions import ParameterException

from fuzz.files import Kind
from fuzz.mutations import CANARY
from fuzz.outcome import ACCEPTED, REFUSED, Fault, Outcome
from kmn_perception.ros.program import EXPECTED

TIMEOUT = 30.0  # seconds for a file; a busy machine needs some
MEMORY = 2 * 2**30  # bytes that reading a file may take
OURS = (f"{os.sep}kmn_perception{os.sep}", f"{os.sep}kmn_sim{os.sep}", f"{os.sep}kmn_skill{os.sep}")


def hostile(kind: Kind, seed: int, case: int) -> tuple[Path, bytes]:
    """Return the valid file and the hostile content that it is made to."""
    random = Random(f"{kind.name} {seed} {case}")
    valid = random.choice(kind.valid)
    return valid, kind.change(valid.read_bytes(), random)


def run(kind: Kind, seed: int, cases: list[int], folder: Path, kept: Path) -> Outcome:
    """Let hostile files of a kind be read, and keep those that make faults.

    Parameters
    ----------
    folder, kept
        To write files to, and to keep some in.
    """
    counts: Counter[str] = Counter()
    found: dict[int, str] = {}
    left = list(cases)
    while left:
        here, there = multiprocessing.Pipe()
        process = multiprocessing.get_context("fork").Process(
            target=_read_all, args=(kind, seed, left, folder, there)
        )
        process.start()
        there.close()
        text = _follow(here, left, counts, found)
        process.kill()
        process.join()
        if left:  # the process died or hung at the first that is left
            code = process.exitcode if text != "hangs" else None
            what = f"dies (exit code {code})" if code is not None else f"hangs for {TIMEOUT:g} s"
            found[left.pop(0)] = what
    faults = []
    for case, text in found.items():
        valid, content = hostile(kind, seed, case)
        file = kept / f"{kind.name.replace(',', '').replace(' ', '_')}_{case}{valid.suffix}"
        file.write_bytes(content)
        again = f"--only '{kind.name}' --seed {seed} --case {case}"
        faults.append(Fault(kind.name, text, again, file))
    return Outcome(kind.name, len(cases), counts, faults)


def _follow(here: Connection, left: list[int], counts: Counter[str], found: dict[int, str]) -> str:
    """Take results until all are there, or the process dies or hangs."""
    while left:
        if not here.poll(TIMEOUT):
            return "hangs"
        try:
            result, text = here.recv()
        except EOFError:
            return "dies"
        case = left.pop(0)
        if text:
            found[case] = text
        else:
            counts[result] += 1
    return ""


def _read_all(kind: Kind, seed: int, cases: list[int], folder: Path, there: Connection) -> None:
    """Read hostile files one after the other, silently, and tell how each went."""
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    os.chdir(folder)
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, resource.RLIM_INFINITY))
    for case in cases:
        valid, content = hostile(kind, seed, case)
        file = folder / f"hostile{valid.suffix}"
        file.write_bytes(content)
        there.send(judge(kind.read, file, (file.name, *kind.named)))
    os._exit(0)


def judge(read: Callable[[Path], object], file: Path, named: tuple[str, ...]) -> tuple[str, str]:
    """Read a file; return how that went, and what is wrong with it, which is nothing mostly."""
    canary = file.parent / CANARY
    result, text = ACCEPTED, ""
    try:
        read(file)
    except Exception as error:
        result, text = REFUSED, _fault(error, named)
    if canary.exists():
        canary.unlink()
        text = "executes what the file says"
    return result, text


def _fault(error: Exception, named: tuple[str, ...]) -> str:
    """Return why an error is no refusal of ours; nothing if it is.

    A refusal is raised by a statement of the project, or by rclpy for a parameter, is one that the
    programs print in a line, and names what it refuses.
    """
    *_, last = traceback.extract_tb(error.__traceback__)
    line = linecache.getline(last.filename, last.lineno or 0).strip()
    is_ours = any(part in last.filename for part in OURS) and line.startswith("raise ")
    is_ours = is_ours or isinstance(error, ParameterException)
    where = f"{Path(last.filename).name}:{last.lineno}"
    told = f"{type(error).__name__} at {where}: {str(error)[:200]}"
    if not is_ours or not isinstance(error, EXPECTED):
        return "".join([f"{told}\n", *traceback.format_exception(error)[-20:]])
    if not any(name in str(error) for name in named):
        return f"does not name {' or '.join(named)}: {told}"
    return ""


def replay(kind: Kind, seed: int, case: int, folder: Path) -> str:
    """Read a hostile file in this process, and return what comes of it."""
    valid, content = hostile(kind, seed, case)
    file = folder / f"hostile{valid.suffix}"
    file.write_bytes(content)
    result, text = judge(kind.read, file, (file.name, *kind.named))
    return text or result
