"""The mailbox between the thread that takes messages and the one that estimates."""

from __future__ import annotations

import threading

from hypothesis import given
from hypothesis import strategies as st

from kmn_perception.ros.mailbox import Mailbox


@given(st.lists(st.one_of(st.integers(), st.just("take"))))
def test_newest_item_is_taken_and_every_replaced_one_is_reported(events: list[int | str]) -> None:
    mailbox: Mailbox[int | str] = Mailbox()
    waiting: list[int | str] = []  # all that were put since the last one was taken
    for event in events:
        if event != "take":
            assert mailbox.put(event) == bool(waiting)
            waiting.append(event)
        elif waiting:
            assert mailbox.take() == waiting[-1]
            waiting.clear()


def test_taking_waits_for_an_item() -> None:
    mailbox: Mailbox[int] = Mailbox()
    taken: list[int | None] = []
    taker = threading.Thread(target=lambda: taken.append(mailbox.take()))
    taker.start()
    mailbox.put(1)
    taker.join()
    assert taken == [1]


def test_closing_ends_the_waiting() -> None:
    mailbox: Mailbox[int] = Mailbox()
    taken: list[int | None] = []
    taker = threading.Thread(target=lambda: taken.append(mailbox.take()))
    taker.start()
    mailbox.close()
    taker.join()
    assert taken == [None]
