"""The reference of a model's file names what the simulator reads of its mechanics."""

from __future__ import annotations

from typing import Any

import pytest

from kmn_perception.model import model_format
from kmn_perception.model.model_format import REQUIRED, Keys
from kmn_sim.world import mechanics


@pytest.mark.parametrize(
    ("read", "keys"),
    [
        (mechanics.Mechanics, model_format.MECHANICS),
        (mechanics.BodyMechanics, model_format.BODY_MECHANICS),
        (mechanics.JointMechanics, model_format.JOINT_MECHANICS),
        (mechanics.LatchMechanics, model_format.LATCH),
    ],
)
def test_keys_and_defaults_are_those_of_the_simulator(read: Any, keys: Keys) -> None:
    assert tuple(keys) == read._fields
    for name, key in keys.items():
        if key.default.replace(".", "").isdigit():
            assert float(key.default) == read._field_defaults[name]
        elif key.default == REQUIRED:
            assert name not in read._field_defaults
        else:
            assert key.default == "none"
            assert not read._field_defaults[name]
