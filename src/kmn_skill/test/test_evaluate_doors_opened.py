"""What evaluate counts: who claims success with a closed door is told apart."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from kmn_skill.experiments.stopwatch import Measured
from kmn_skill.experiments.trials import Trial, table, tally

STILL = Measured(seconds={"open": 2.0}, opened=8.0, force=100.0, errors={"base_x": 0.01})


def trial(**changes: Any) -> Trial:
    good = Trial(np.zeros(7), True, True, 1.0, 0.0001, 0.01, 1, -0.9, -0.88, "", STILL)
    return good._replace(**changes)


def test_success_that_is_none_is_counted() -> None:
    lie = trial(opened=False, hinge=0.0, told=-0.9, reason="the door is not open in the physics")
    refused = trial(executed=False, opened=False, clearance=math.nan, reason="no plan")
    result = tally([trial(), trial(attempts=2), lie, refused])
    counts = [result[name] for name in ("planned", "executed", "opened", "false_success")]
    assert counts == [3, 3, 2, 1]
    assert result["first_attempt"] == 1
    assert result["hinge_error_rad"]["max"] == pytest.approx(0.9)
    assert result["hinge_error_rad"]["median"] == pytest.approx(0.02)
    assert [failure["door"] for failure in result["failures"]] == [2, 3]
    text = table(result)
    assert "false_success" in text
    assert "door 2: the door is not open in the physics" in text
