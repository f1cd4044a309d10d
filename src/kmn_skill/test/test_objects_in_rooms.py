"""Where what an experiment opens stands: alone, or in a room."""

from __future__ import annotations

from typing import Any

import pytest

from kmn_perception.configuration.section import ConfigurationError
from kmn_skill.experiments import evaluate, plan_doors
from kmn_skill.experiments.settings import Experiment

IN_ROOMS = Experiment.load().room.model


@pytest.mark.parametrize("program", [evaluate, plan_doors])
@pytest.mark.parametrize(
    ("arguments", "in_room"),
    [
        ((), False),
        (("--room",), True),
        (("--object", IN_ROOMS), True),
        (("--object", "lid"), False),
    ],
)
def test_a_door_whose_file_has_walls_stands_in_them(
    program: Any, arguments: tuple[str, ...], in_room: bool
) -> None:
    options = program.parser().parse_args(["--doors", "1", *arguments])
    program.prepare(options)
    assert options.room == in_room


@pytest.mark.parametrize("program", [evaluate, plan_doors])
def test_what_is_no_door_does_not_stand_in_a_room(program: Any) -> None:
    options = program.parser().parse_args(["--doors", "1", "--room", "--object", "lid"])
    with pytest.raises(ConfigurationError, match=f"rooms are for '{IN_ROOMS}', not for 'lid'"):
        program.prepare(options)
