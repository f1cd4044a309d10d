"""The page of an object of one's own: its file and all its commands, with a tiny budget."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("pybullet")
pytest.importorskip("robotic")

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs/your_object.md").read_text(encoding="utf-8")
LITTLE = {  # by executable; what a command has already stands before it
    "train": "--samples 60 --epochs 1 --rounds 0",
    "evaluate": "--samples 4",
    "make_prototypes": "--tries 6",
    "plan_doors": "--doors 2 --records plan_doors.jsonl",
}
OPENING = {
    "evaluate": "--doors 1 --records evaluate.jsonl",
    "demo": "--parameters true --noise none",
}


def commands() -> list[list[str]]:
    """Return the programs that the page runs to their end."""
    blocks = re.findall(r"```bash\n(.*?)```", PAGE, flags=re.DOTALL)
    lines = [line.split() for block in blocks for line in block.splitlines()]
    return [line for line in lines if line[0] == "./run" and "--ros-args" not in line]


def run(folder: Path, *command: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *command], cwd=folder, capture_output=True, text=True, timeout=250
    )
    assert done.returncode == 0, f"{command}\n{done.stdout[-2000:]}\n{done.stderr[-2000:]}"
    return done.stdout


@pytest.mark.slow
def test_the_page_leads_to_an_opened_object(tmp_path: Path) -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    (tmp_path / "oven.yaml").write_text(text, encoding="utf-8")
    ran = {}
    for _, package, program, *options in commands():
        little = OPENING if package == "kmn_skill" and program in OPENING else LITTLE
        command = (package, program, *options, *little.get(program, "").split())
        ran[package, program] = command, run(tmp_path, *command)
    assert [program for _, program in ran] == [
        *("draw_model", "train", "evaluate"),
        *("make_prototypes", "plan_doors", "evaluate", "demo"),
    ]
    for file in ("oven.png", "oven.safetensors", "oven_motions.json"):
        assert (tmp_path / file).stat().st_size > 1000
    for program in ("plan_doors", "evaluate"):
        command, table = ran["kmn_skill", program]
        assert run(tmp_path, *command) == table  # all is there: nothing is planned or opened anew
        assert run(tmp_path, "kmn_skill", "merge", f"{program}.jsonl") == table
