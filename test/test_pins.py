"""Set-up installs known files only: every requirement has a version and hashes, and pip asks."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PIN = re.compile(r"([a-z0-9-]+)==([^ \n]+)(?: \\\n    --hash=sha256:[0-9a-f]{64})+\n")
WHEEL = {
    "tiny.py": "",
    "tiny-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: tiny\nVersion: 1.0\n",
    "tiny-1.0.dist-info/WHEEL": "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    "tiny-1.0.dist-info/RECORD": "",
}


def pins(file: str) -> dict[str, str]:
    """Return the versions of a file of which every line belongs to a pin with hashes."""
    text = re.sub(r"(?m)^#.*\n", "", (ROOT / file).read_text(encoding="utf-8"))
    assert PIN.sub("", text) == ""
    return dict(PIN.findall(text))


def needed(file: Path) -> list[str]:
    """Return the names of a file's requirements, as indices spell them."""
    lines = re.sub(r"(?m)\s*#.*$", "", file.read_text(encoding="utf-8")).split("\n")
    names = [re.split(r"[<>=~! ]", line)[0] for line in lines if line]
    return [re.sub(r"[-_.]+", "-", name).lower() for name in names]


def test_every_requirement_has_a_version_and_hashes() -> None:
    files = sorted(ROOT.glob("requirements*.txt"))
    assert len(files) > 9
    pinned = pins("constraints.txt")
    assert len(pinned) > 250
    assert {name for file in files for name in needed(file)} - pinned.keys() == set()


def test_the_torch_without_cuda_is_of_the_same_version() -> None:
    assert pins("torch-cpu.txt") == {"torch": f"{pins('constraints.txt')['torch']}+cpu"}


@pytest.mark.parametrize("hashed", ["right", "wrong", "not at all"])
def test_the_set_up_refuses_a_file_of_another_hash(hashed: str, tmp_path: Path) -> None:
    for folder in ("tools", ".venv/bin", "wheels"):
        (tmp_path / folder).mkdir(parents=True)
    shutil.copy(ROOT / "tools/setup.sh", tmp_path / "tools")
    python = tmp_path / ".venv/bin/python"
    python.write_text(f'#!/bin/sh\nexec {sys.executable} "$@"\n')
    python.chmod(0o755)
    wheel = tmp_path / "wheels/tiny-1.0-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as opened:
        for name, text in WHEEL.items():
            opened.writestr(name, text)
    right = hashlib.sha256(wheel.read_bytes()).hexdigest()
    digest = {"right": f" --hash=sha256:{right}", "wrong": f" --hash=sha256:{'0' * 64}"}
    (tmp_path / "constraints.txt").write_text(f"tiny==1.0{digest.get(hashed, '')}\n")
    (tmp_path / "requirements-tiny.txt").write_text("tiny\n")
    ended = subprocess.run(
        ["tools/setup.sh", "wheels", "tiny"],
        cwd=tmp_path,
        env={
            **os.environ,
            "PIP_CONFIG_FILE": os.devnull,
            "PIP_DRY_RUN": "1",
            "PIP_FIND_LINKS": str(wheel.parent),
            "PIP_NO_INDEX": "1",
        },
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (ended.returncode == 0) == (hashed == "right"), ended.stderr
    if hashed != "right":
        assert "HASH" in ended.stderr.upper()
