"""What is told of a door's handle where fit, panel and network disagree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from kmn_perception.doors import measuring
from kmn_perception.doors.door_estimate import DoorStatus
from kmn_perception.doors.door_finder import DoorFinder
from kmn_perception.doors.handle import Handle, find_handle
from kmn_perception.doors.walls import Frame
from kmn_perception.rooms.frame import make_frame
from kmn_perception.rooms.sampling import sample_room

from .clear_rooms import CAMERA, finder, render, settings


def test_a_handle_beside_the_panel_tells_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is seen too far from the edge is no handle: its place and its side are not stated."""
    room = sample_room(1, CAMERA, settings(), "door")
    frame = render(room, 1)
    seen = finder().find(frame)
    assert seen.status is DoorStatus.OK

    def beside(*given: Any) -> Handle | None:
        handle = find_handle(*given)
        left, right = given[1]
        inner = left + 0.35 if handle and handle.side == "left" else right - 0.35
        return handle and handle._replace(s=inner)

    monkeypatch.setattr(measuring, "find_handle", beside)
    found = finder().find(frame)
    assert found.status is not DoorStatus.OK
    assert found.handle_side == ""
    assert found.deviation("handle_y") > 0.3
    assert found.deviation("handle_z") > 0.1


def test_a_handle_that_the_network_sees_elsewhere_is_known_less_well(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    room = sample_room(1, CAMERA, settings(), "door")
    frame = render(room, 1)
    found = []
    for off in (0.0, 0.08):

        def doubted(*given: Any, off: float = off) -> Handle | None:
            hint = given[-1]._replace(s=given[-1].s + off, probability=0.9)
            return find_handle(*(*given[:-1], hint))

        monkeypatch.setattr(measuring, "find_handle", doubted)
        found.append(finder().find(frame))
    assert found[0].status is found[1].status is DoorStatus.OK
    assert found[1].deviation("handle_y") > found[0].deviation("handle_y") + 0.03


def test_what_the_network_takes_for_a_handle_near_the_floor_is_none(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    room = sample_room(1, CAMERA, settings(handle={"none": 1.0}), "door")

    def low(*given: Any) -> Handle | None:
        return find_handle(*(*given[:-1], given[-1]._replace(z=0.2, probability=0.99)))

    monkeypatch.setattr(measuring, "find_handle", low)
    assert finder().find(render(room, 1)).handle_side == ""


@pytest.mark.parametrize(
    ("seed", "kind"), [(100106, "lever"), (100150, "lever"), (100149, "knob"), (100087, "knob")]
)
def test_a_kind_of_handle_must_explain_all_that_is_seen_about_it(seed: int, kind: str) -> None:
    """Faint levers with a rosette, and knobs on a plate, whose visible length tells another one."""
    seen = make_frame(seed)
    assert seen.room.door is not None
    assert seen.room.door.handle == kind
    grey = seen.images.grey.astype(np.float32) / np.float32(255.0)
    camera = seen.room.camera
    up, height = camera.pose[2, :3].copy(), float(camera.pose[2, 3])
    found = finder().find(Frame(np.nan_to_num(seen.depth), grey, camera, up, height))
    assert found.handle_kind == kind
    truth = seen.room.door.handle_centre
    assert truth is not None
    np.testing.assert_allclose(found.handle[:2], truth[:2], atol=0.03)


def test_a_handle_that_two_kinds_explain_nearly_as_well_is_not_told() -> None:
    room = sample_room(1, CAMERA, settings(), "door")
    frame = render(room, 1)
    sure = finder().find(frame)
    assert (sure.status, sure.handle_kind) == (DoorStatus.OK, "lever")
    shipped = finder().settings
    handle = replace(shipped.handle, min_odds=1e9)
    doubting = DoorFinder(replace(shipped, handle=handle), finder().network)
    found = doubting.find(frame)
    assert (found.status, found.handle_kind) == (DoorStatus.HANDLE_NOT_SEEN, "")
    assert found.handle_side == sure.handle_side
    assert "a lever and a knob explain the handle nearly as well" in found.reason
