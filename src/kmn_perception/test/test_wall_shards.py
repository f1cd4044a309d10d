"""The rooms that the network for walls trains on, rendered by several machines."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from kmn_perception.doors.settings import DoorSettings
from kmn_perception.sharing.records import Shard
from kmn_perception.training.run import RunError
from kmn_perception.training.wall.settings import WallTrainingSettings
from kmn_perception.training.wall.shards import make_shards, read_shards


def test_shards_are_joined_by_copying_them(tmp_path: Path) -> None:
    doors, settings = DoorSettings.load(), WallTrainingSettings.load("room_door")
    data = settings.data._replace(rooms=4, shard=2, validation=0.5)
    settings = replace(settings, data=data)
    whole = make_shards(tmp_path / "whole", settings, doors, 1, bool)
    parts = [make_shards(tmp_path / str(i), settings, doors, 1, bool, Shard(i, 2)) for i in (0, 1)]
    assert [[file.name] for file in whole] == [[file.name for file in part] for part in parts]
    shutil.copy(parts[1][0], tmp_path / "0")
    joined = make_shards(tmp_path / "0", settings, doors, 1, lambda: pytest.fail("renders"))
    for ours, theirs in zip(
        read_shards(whole, settings, doors), read_shards(joined, settings, doors), strict=True
    ):
        for a, b in zip(ours, theirs, strict=True):
            np.testing.assert_array_equal(a.target, b.target)
            np.testing.assert_array_equal(a.cells, b.cells)
    with pytest.raises(RunError, match="was made with other settings"):
        read_shards(joined, replace(settings, seed=settings.seed + 1), doors)
