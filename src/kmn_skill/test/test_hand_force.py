"""The force along the way of what the hand holds, of late."""

from __future__ import annotations

import math

import numpy as np
import pytest

from kmn_skill.execution.hand_force import SPAN, HandForce

AHEAD = np.array([-1.0, 0.0, 0.0])
NOW = 50.0  # seconds


def test_it_is_the_mean_of_a_short_time_along_the_way() -> None:
    """What presses the bar from above does not count."""
    force = HandForce()
    force.put(NOW - 2.0 * SPAN, np.array([-500.0, 0.0, 0.0]))
    force.put(NOW - 0.5 * SPAN, np.array([-100.0, 7.0, 120.0]))
    force.put(NOW, np.array([-20.0, -7.0, 120.0]))
    force.put(NOW + 0.1 * SPAN, np.array([-900.0, 0.0, 0.0]))
    assert force.along(AHEAD, NOW) == pytest.approx(60.0)
    assert force.along(-AHEAD, NOW) == pytest.approx(-60.0)


def test_where_nobody_tells_it_no_limit_is_exceeded() -> None:
    force = HandForce()
    assert math.isnan(force.along(AHEAD, NOW))
    force.put(NOW, np.array([-100.0, 0.0, 0.0]))
    assert math.isnan(force.along(AHEAD, NOW + 2.0 * SPAN))
