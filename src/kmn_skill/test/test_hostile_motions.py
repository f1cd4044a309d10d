"""Files of motions, and limits of a URDF, that hold something else: refused with a reason."""

from __future__ import annotations

from pathlib import Path

import pytest

from kmn_perception.configuration.section import ConfigurationError
from kmn_skill.planning.prototypes import Prototypes
from kmn_skill.planning.urdf_limits import limits_of_urdf


@pytest.mark.parametrize("text", [
    "{",
    "[]",
    "{}",
    '{"joints": 3}',
    '{"joints": ["a"], "pull": 3}',
    '{"joints": ["a"], "pull": [[[0.1]]]}',
    '{"joints": ["a"], "pull": [[[0.1], [[0.1, 0.2]]]]}',
    '{"joints": ["a"], "pull": [[[0.1], [[NaN]]]]}',
    '{"joints": ["a"], "pull": [[[0.1], [[{}]]]]}',
    '{"joints": ["a"], "drag": []}',
])  # fmt: skip
def test_motions_are_refused_by_their_file(tmp_path: Path, text: str) -> None:
    file = tmp_path / "mine.json"
    file.write_text(text)
    with pytest.raises(ConfigurationError, match="mine.json"):
        Prototypes.load(str(file))


@pytest.mark.parametrize("limit", ["nan", "0 1", "far", ""])
def test_a_limit_that_is_no_number_is_not_taken_for_one(limit: str) -> None:
    """No comparison with NaN ever finds a difference."""
    joint = f'<joint name="elbow" type="revolute"><limit upper="{limit}"/></joint>'
    with pytest.raises(ValueError, match="limits joint elbow, upper, by no number"):
        limits_of_urdf(f"<robot>{joint}</robot>")
