"""Which frames are new, of a camera whose cloud and image come as two messages."""

from __future__ import annotations

from kmn_perception.ros.exposures import Exposures, Order

NEW, SUPERSEDED, JUMP = Order.NEW, Order.SUPERSEDED, Order.CLOCK_JUMP


def orders(*frames: tuple[str, int]) -> list[Order]:
    exposures = Exposures()
    return [exposures.add(source, stamp) for source, stamp in frames]


def test_of_one_exposure_the_first_message_counts() -> None:
    assert orders(("cloud", 1), ("image", 1), ("image", 2), ("cloud", 2)) == [
        NEW, SUPERSEDED, NEW, SUPERSEDED,
    ]  # fmt: skip


def test_a_clock_that_was_set_back_counts_once() -> None:
    found = orders(("cloud", 8), ("image", 8), ("cloud", 3), ("image", 3), ("cloud", 4))
    assert found == [NEW, SUPERSEDED, JUMP, SUPERSEDED, NEW]


def test_topics_of_a_recording_may_be_replayed_one_after_the_other() -> None:
    second = 10**9
    early = [("image", t * second) for t in range(1, 3)]
    clouds = [("cloud", t * second) for t in range(3, 23)]
    images = [("image", t * second) for t in range(9, 23)]
    assert orders(*clouds, *images) == [NEW] * 20 + [JUMP] + [NEW] * 13
    assert orders(*early, *clouds, *images) == [NEW] * 22 + [JUMP] + [NEW] * 13


def test_a_topic_that_is_late_by_a_period_never_goes_back_in_time() -> None:
    second = 10**9
    frames = [f for t in range(2, 9) for f in (("image", t * second), ("cloud", (t - 1) * second))]
    assert orders(*frames) == [NEW, SUPERSEDED] * 7


def test_messages_without_a_time_are_always_new() -> None:
    assert orders(("cloud", 0), ("image", 0), ("cloud", 0)) == [NEW] * 3
