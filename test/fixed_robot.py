"""A robot that stands where it is: its base has no joints in messages, and no controller."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import yaml

from kmn_perception.configuration import resources

PANDA = "panda_ranger"
STANDS = (-0.82, -0.49, 0.0)  # before the prototype, whose handle is at (-0.07, -0.29)


def write_robot(folder: Path) -> Path:
    """Write the file of a Panda on a pedestal, and its motions beside it."""
    values: dict[str, Any] = yaml.safe_load(resources.find("config/robots", PANDA).read_text())
    values["base"]["kind"] = "fixed"
    del values["controllers"]["base"]
    for name, position in zip(values["base"]["limits"], STANDS, strict=True):
        values["joints"][name]["home"] = position
    file = folder / "fixed.yaml"
    file.write_text(yaml.safe_dump(values, sort_keys=False))
    motions = resources.find("config/skill/prototypes", f"{PANDA}/door", ".json")
    file.with_suffix("").mkdir()
    shutil.copy(motions, file.with_suffix(""))
    return file
