"""Frames of one door: what they have in common stays, rivals are told, a changed door is learnt."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from kmn_perception.doors.door_estimate import DoorEstimate, DoorStatus
from kmn_perception.doors.frame_fusion import FrameFusion
from kmn_perception.doors.fusion import DoorFusion, agree, fuse
from kmn_perception.doors.fusion_settings import FusionSettings, ParameterShares
from kmn_perception.doors.geometry import DOOR
from kmn_perception.doors.resting import RestingCamera
from kmn_perception.doors.settings import DoorSettings
from kmn_perception.doors.walls import Frame
from kmn_perception.evaluation.doors.evaluate_fusion import main
from kmn_perception.rooms import frame as rooms
from kmn_perception.rooms.sequence import make_sequence

SETTINGS = DoorSettings.load().fusion
DEVIATION = 0.01
SEED = 6100  # of a room whose door is in view


def shared(share: float) -> FusionSettings:
    return SETTINGS._replace(shared=ParameterShares(*[share] * len(DOOR)))


def door(
    status: DoorStatus = DoorStatus.OK, side: str = "right", kind: str = "lever", **values: float
) -> DoorEstimate:
    """Return an estimate of a door; values that are not given are 0."""
    if status is not DoorStatus.OK:
        side = kind = ""
    return replace(
        DoorEstimate.none(f"it is {status.value}", status),
        values=np.array([values.get(name, 0.0) for name in DOOR]),
        covariance=DEVIATION**2 * np.eye(len(DOOR)),
        handle_side=side,
        handle_kind=kind,
        latch_side=side or "right",
        hinge_is_known=bool(side),
        camera_pose=np.eye(4),
        corners=np.zeros((4, 3)),
        handle=np.zeros(3),
        normal=np.zeros(3),
    )


def apart(count: int, deviation: float) -> list[DoorEstimate]:
    """Return doors whose parameters differ with just this standard deviation."""
    signs = np.where(np.arange(count) % 2, 1.0, -1.0)
    size = deviation * np.sqrt((count - 1) / count)  # as of the mean that they tell themselves
    return [replace(door(), values=np.full(len(DOOR), size * sign)) for sign in signs]


def add_all(*frames: DoorEstimate, count: int = 30, **changes: Any) -> DoorEstimate:
    """Return what is known after all frames."""
    fusion = DoorFusion(count, SETTINGS._replace(**changes))
    return [fusion.add(frame) for frame in frames][-1]


NONE = DoorEstimate.none("nothing is seen")
DOUBT = door(DoorStatus.AMBIGUOUS)
UNSEEN = door(DoorStatus.HANDLE_NOT_SEEN)


@pytest.mark.parametrize("count", [2, 10, 100])
def test_independent_errors_fall_by_the_root_of_their_number(count: int) -> None:
    fused = fuse(apart(count, DEVIATION), shared(0.0))
    assert np.allclose(fused.values, 0.0)
    assert fused.deviation("door_width") == pytest.approx(DEVIATION / np.sqrt(count))


@pytest.mark.parametrize("count", [2, 10, 100])
def test_errors_fall_to_what_frames_share(count: int) -> None:
    share = 0.3
    fused = fuse(apart(count, np.sqrt(1.0 - share) * DEVIATION), shared(share))
    expected = DEVIATION * np.sqrt(share + (1.0 - share) / count)
    assert fused.deviation("door_width") == pytest.approx(expected)


def test_equal_frames_tell_no_more_than_one() -> None:
    """What does not change from frame to frame cannot average out, whatever the settings say."""
    fused = fuse([door()] * 30, shared(0.0))
    np.testing.assert_allclose(fused.covariance, door().covariance)


def test_frames_that_scatter_more_than_they_say_widen_the_deviation() -> None:
    fused = fuse(apart(10, 2.0 * DEVIATION), shared(0.5))
    assert fused.deviation("door_width") > 1.5 * DEVIATION


def test_errors_with_a_shared_part_stay_within_the_deviations() -> None:
    generator, share, count = np.random.default_rng(0), 0.7, 20
    ratios = []
    for _ in range(300):
        common = np.sqrt(share) * generator.standard_normal(len(DOOR))
        own = np.sqrt(1.0 - share) * generator.standard_normal((count, len(DOOR)))
        frames = [replace(door(), values=DEVIATION * (common + one)) for one in own]
        fused = fuse(frames, shared(share))
        ratios.append(fused.values / np.sqrt(np.diag(fused.covariance)))
    assert 0.8 < np.std(ratios) <= 1.0


def test_the_better_frame_counts_more() -> None:
    good, bad = door(door_width=0.0), door(door_width=0.03)
    bad = replace(bad, covariance=9.0 * bad.covariance)
    assert fuse([bad, good], shared(0.5)).value("door_width") == pytest.approx(0.003)


def test_yaws_are_averaged_across_the_half_turn() -> None:
    fused = fuse([door(yaw=np.pi - 0.01), door(yaw=-np.pi + 0.01)], SETTINGS)
    assert abs(np.cos(fused.value("yaw")) + 1.0) < 1e-6


def test_a_handle_seen_in_one_frame_is_seen() -> None:
    found = add_all(UNSEEN, door(handle_z=0.02), UNSEEN)
    assert (found.status, found.handle_side, found.handle_kind) == (DoorStatus.OK, "right", "lever")
    assert found.value("handle_z") == 0.02
    assert found.deviation("handle_z") == pytest.approx(DEVIATION)


def test_a_handle_that_one_of_many_frames_shows_is_not_seen() -> None:
    """The more frames, the likelier one of them takes something else for a handle."""
    found = add_all(*[UNSEEN] * 5, door(), *[UNSEEN] * 4)
    assert found.status is DoorStatus.HANDLE_NOT_SEEN
    assert not found.handle_side


def test_an_open_door_without_a_handle_in_sight_may_be_hinged_on_either_side() -> None:
    left = door(side="left", opening=-0.3)
    assert agree(door(DoorStatus.HANDLE_NOT_SEEN, opening=0.3, x=0.2), left, 3.0)
    assert not agree(door(DoorStatus.HANDLE_NOT_SEEN, opening=0.3, x=0.5), left, 3.0)
    assert not agree(door(DoorStatus.HANDLE_NOT_SEEN, opening=0.4), left, 3.0)


@pytest.mark.parametrize(
    "rival", [door(side="left"), door(kind="knob"), door(door_width=0.1), door(opening=0.2)]
)
def test_rivals_leave_the_question_open(rival: DoorEstimate) -> None:
    found = add_all(*[door(), rival] * 5, door())
    assert found.status is DoorStatus.AMBIGUOUS
    assert "6 of the last 11 frames show this door, 5 another one" in found.reason


def test_doubts_do_not_become_certain_by_repetition() -> None:
    assert add_all(*[DOUBT] * 20).status is DoorStatus.AMBIGUOUS
    found = add_all(*[door(), DOUBT] * 10, *[door()] * 6)  # however many agree at the end
    assert found.status is DoorStatus.AMBIGUOUS
    assert "10 are ambiguous" in found.reason


def test_a_rare_doubt_does_not_count() -> None:
    assert add_all(*[door()] * 8, DOUBT, door()).status is DoorStatus.OK


def test_who_walks_by_does_not_make_the_door_forgotten() -> None:
    found = add_all(*[door(x=1.0)] * 10, *[NONE] * (SETTINGS.confirm - 1))
    assert found.status is DoorStatus.OK
    assert found.value("x") == 1.0
    assert add_all(*[door()] * 10, *[NONE] * SETTINGS.confirm).status is DoorStatus.NO_DOOR


def test_a_door_that_is_seen_now_and_then_is_not_certain() -> None:
    assert add_all(*[door(), NONE, NONE] * 4, door()).status is DoorStatus.AMBIGUOUS
    assert add_all(*[NONE] * 10, door()).status is DoorStatus.AMBIGUOUS
    assert add_all(*[NONE] * 10, *[door()] * SETTINGS.confirm).status is DoorStatus.OK


def test_a_door_that_was_opened_is_learnt_anew_and_not_averaged() -> None:
    fusion = DoorFusion(30, SETTINGS)
    for _ in range(20):
        assert fusion.add(door()).status is DoorStatus.OK
    for _ in range(SETTINGS.confirm - 1):
        assert fusion.add(door(opening=0.3)).status is DoorStatus.AMBIGUOUS
    found = fusion.add(door(opening=0.3))
    assert found.status is DoorStatus.OK
    assert found.value("opening") == pytest.approx(0.3)


def test_a_door_that_opens_slowly_is_never_told_wrongly() -> None:
    fusion = DoorFusion(30, SETTINGS)
    for angle in np.arange(0.0, 0.3, 0.002):
        found = fusion.add(door(opening=float(angle)))
        wrong = abs(found.value("opening") - angle) > 3.0 * found.deviation("opening")
        assert not (wrong and found.status is DoorStatus.OK)


def test_old_frames_are_forgotten() -> None:
    found = add_all(*[door(x=0.0)] * 5, *[door(x=0.01)] * 10, count=10)
    assert found.value("x") == pytest.approx(0.01)


def test_what_is_seen_from_elsewhere_is_told_in_the_newest_frame() -> None:
    moved = np.eye(4)
    moved[0, 3] = 0.5
    seen = replace(door(), corners=np.ones((4, 3)))
    found = add_all(*[seen] * 5, replace(NONE, camera_pose=moved))
    np.testing.assert_allclose(found.corners, np.tile([0.5, 1.0, 1.0], (4, 1)))


def frames(count: int, step: float = 0.0) -> list[Frame]:
    return [as_seen(seen) for seen in make_sequence(SEED, count, step)]


def as_seen(seen: rooms.Frame) -> Frame:
    grey = seen.images.grey.astype(np.float32) / np.float32(255.0)
    return Frame(np.nan_to_num(seen.depth).astype(np.float32), grey, seen.room.camera)


def test_a_camera_rests_while_its_picture_stays() -> None:
    camera, (first, *later) = RestingCamera(SETTINGS.resting), frames(3)
    assert not camera.rests(first)
    assert all(camera.rests(frame) for frame in later)
    brighter = later[0]._replace(grey=np.float32(0.9) * np.asarray(later[0].grey))
    assert camera.rests(brighter)
    someone = np.array(later[0].grey)
    someone[:, :200] = 0.1
    assert camera.rests(later[0]._replace(grey=someone))


def test_a_camera_that_creeps_does_not_rest() -> None:
    camera, seen = RestingCamera(SETTINGS.resting), frames(6, step=0.001)
    assert not all([camera.rests(frame) for frame in seen][1:])


def test_depth_alone_does_not_prove_rest() -> None:
    camera, seen = RestingCamera(SETTINGS.resting), frames(2)
    assert not any(camera.rests(frame._replace(grey=None)) for frame in seen)


def test_fusion_begins_anew_where_the_camera_moves_unless_its_pose_is_known() -> None:
    first, second = frames(2, step=0.02)
    for pose, expected in ((None, 0.01), (np.eye(4), 0.005)):
        fusion, camera = FrameFusion(10), RestingCamera(SETTINGS.resting)
        fusion.add(door(door_width=0.0), pose, camera.rests(first))
        found = fusion.add(door(door_width=0.01), pose, camera.rests(second))
        assert found.value("door_width") == pytest.approx(expected)


def test_the_program_tells_what_is_known_after_one_frame_and_after_more(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["--doors", "1", "--frames", "3", "--seed", "5002"]) == 0
    lines = capsys.readouterr().out.splitlines()
    for camera in ("resting", "moving"):
        start = next(i for i, line in enumerate(lines) if line.startswith(f"{camera} camera"))
        heads = [line.split("  ")[0] for line in lines[start + 1 : start + 8]]
        assert heads == ["frames", "each alone", "1", "3", "", "shared by frames", "median"]
