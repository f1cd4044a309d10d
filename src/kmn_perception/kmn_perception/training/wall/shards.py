"""The samples of many rooms in files, so that an interrupted run goes on from them."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from kmn_perception.configuration.hashes import text_hash
from kmn_perception.configuration.output import replacing
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.rooms.settings import RoomSettings
from kmn_perception.sharing.plain import to_plain
from kmn_perception.sharing.processes import in_order
from kmn_perception.sharing.records import WHOLE, Shard
from kmn_perception.training.run import RunError
from kmn_perception.training.wall.samples import Sample, is_validation, samples_of
from kmn_perception.training.wall.settings import WallTrainingSettings
from kmn_perception.training.wall.targets import Target

_WORTHWHILE = 20  # rooms of a process; for fewer its start, some seconds, does not pay


def make_shards(
    folder: Path,
    settings: WallTrainingSettings,
    doors: DoorSettings,
    jobs: int,
    interrupted: Callable[[], bool],
    shard: Shard = WHOLE,
) -> list[Path]:
    """Render the rooms of a shard of the files that are not there yet, and return these files.

    Raises
    ------
    RunError
        If a file cannot be written.
    KeyboardInterrupt
        When the run was interrupted.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rooms, size = settings.data.rooms, settings.data.shard
    parts = [range(first, min(first + size, rooms)) for first in range(0, rooms, size)]
    mine = [parts[i] for i in shard.items(len(parts))]
    files = {folder / f"rooms{part[0]:07d}.npz": part for part in mine}
    missing = {file: part for file, part in files.items() if not file.exists()}
    wanted = list(itertools.chain.from_iterable(missing.values()))
    make = partial(_renderer, settings, doors)
    rendered = in_order(make, wanted, jobs, _WORTHWHILE)
    total, made_with = sum(map(len, mine)), data_hash(settings, doors)
    bar: tqdm[Any] = tqdm(total=total, initial=total - len(wanted), unit=" rooms", desc="rooms")
    with bar, closing(rendered):
        for file, part in missing.items():
            samples: list[list[Sample]] = []
            for found in itertools.islice(rendered, len(part)):
                samples.append(found)
                bar.update()
                if interrupted():
                    raise KeyboardInterrupt
            _write(file, part, samples, made_with)
    return list(files)


def read_shards(
    files: Sequence[Path], settings: WallTrainingSettings, doors: DoorSettings
) -> tuple[list[Sample], list[Sample]]:
    """Return the samples that train and those that measure.

    Raises
    ------
    RunError
        If a file is damaged or made with other settings, or there is nothing to train on or to
        measure by.
    """
    made_with = data_hash(settings, doors)
    training: list[Sample] = []
    validation: list[Sample] = []
    for file in files:
        for room, sample in _read(file, made_with):
            (validation if is_validation(room, settings.data) else training).append(sample)
    if not training or not validation:
        raise RunError(
            f"{settings.data.rooms} rooms give {len(training)} views to train on and "
            f"{len(validation)} to measure by; ask for more with --rooms"
        )
    return training, validation


def data_depend_on(doors: DoorSettings) -> dict[str, Any]:
    """Return the settings of others on which the samples depend."""
    parts = {
        name: getattr(doors, name) for name in ("planes", "vertical", "floor", "view", "prior")
    }
    return to_plain({"doors": parts, "rooms": RoomSettings.load()})


def data_hash(settings: WallTrainingSettings, doors: DoorSettings) -> str:
    """Return a short hash of all settings on which the samples of a room depend."""
    data = settings.data._replace(rooms=2, shard=1, validation=0.5)  # do not change a room
    own = {"seed": settings.seed, "data": data, "target": settings.target}
    plain = to_plain({**own, **data_depend_on(doors)})
    return text_hash(json.dumps(plain, sort_keys=True))


def _write(
    file: Path, rooms: Sequence[int], samples: Sequence[Sequence[Sample]], made_with: str
) -> None:
    flat = [sample for found in samples for sample in found]
    cells = [sample.cells for sample in flat]
    try:
        with replacing(file) as new:
            np.savez_compressed(
                new,
                cells=np.concatenate(cells, axis=2) if cells else np.zeros((0, 0, 0), np.int8),
                columns=np.array([part.shape[2] for part in cells], np.int64),
                targets=np.array([sample.target for sample in flat]).reshape(
                    -1, len(Target._fields)
                ),
                rooms=np.repeat(rooms, [len(found) for found in samples]),
                made_with=made_with,
            )
    except OSError as error:
        raise RunError(
            f"cannot write {file}: {error.strerror}; the same command goes on from the last "
            "file when there is room again"
        ) from error


def _read(file: Path, made_with: str) -> Iterator[tuple[int, Sample]]:
    """Yield the room of each sample, and the sample."""
    try:
        with np.load(file) as arrays:
            ends = np.cumsum(arrays["columns"])
            cells = np.split(arrays["cells"], ends[:-1], axis=2) if len(ends) else []
            targets, rooms, other = arrays["targets"], arrays["rooms"], str(arrays["made_with"])
            samples = [
                (int(room), Sample(part, Target(*map(float, target))))
                for room, part, target in zip(rooms, cells, targets, strict=True)
            ]
    except Exception as error:  # numpy, zipfile and zlib raise errors of all kinds
        raise RunError(
            f"{file} is damaged ({error}); remove it to render its rooms anew"
        ) from error
    if other != made_with:
        raise RunError(f"{file} was made with other settings; remove it to render its rooms anew")
    yield from samples


def _renderer(settings: WallTrainingSettings, doors: DoorSettings) -> Callable[[int], list[Sample]]:
    """Return what renders a room, in a process that does nothing else."""
    return partial(samples_of, settings=settings, doors=doors)
