"""Stamps and durations keep their nanoseconds, and go back and forth."""

from __future__ import annotations

import pytest
from rclpy.duration import Duration
from rclpy.time import Time

from kmn_perception.ros.stamps import duration_of, seconds, stamp_of


@pytest.mark.parametrize("time", [0.0, 0.1, 1.999999999, 12345.678])
def test_stamps_and_durations_are_those_of_rclpy(time: float) -> None:
    assert Time.from_msg(stamp_of(time)).nanoseconds == round(time * 1e9)
    assert Duration.from_msg(duration_of(time)).nanoseconds == round(time * 1e9)
    assert seconds(stamp_of(time)) == pytest.approx(time, abs=1e-9)
    assert seconds(duration_of(time)) == pytest.approx(time, abs=1e-9)


def test_a_negative_duration_keeps_its_sign() -> None:
    assert seconds(duration_of(-0.25)) == -0.25
