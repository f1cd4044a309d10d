"""Only doors that the policy can open come through, whatever their messages say."""

from __future__ import annotations

import math
from typing import Any

import pytest

from kmn_msgs.msg import MorphingParameters
from kmn_skill.ros.messages import observation_from_message


def problem(**fields: Any) -> str:
    return observation_from_message(MorphingParameters(**fields)).problem


@pytest.mark.parametrize("kind", ["", "lever"])
def test_a_door_with_a_lever_at_the_right_is_taken(kind: str) -> None:
    assert problem(status=MorphingParameters.OK, alternative=kind) == ""


@pytest.mark.parametrize("status", [*range(1, 7), 255])
def test_whatever_is_not_ok_is_refused(status: int) -> None:
    assert problem(status=status, reason="too dark") == "too dark"
    assert str(status) in problem(status=status)


def test_a_mirrored_door_and_other_handles_are_refused_with_the_reason() -> None:
    assert "handle is at the left" in problem(alternative="lever", mirrored=True)
    assert "the handle is a knob" in problem(alternative="knob")


@pytest.mark.parametrize(
    ("status", "kind", "mirrored", "lacks"),
    [
        (MorphingParameters.OK, "lever", False, False),
        (MorphingParameters.OK, "knob", False, True),
        (MorphingParameters.OK, "knob", True, False),
        (MorphingParameters.HANDLE_NOT_SEEN, "", False, True),
        (MorphingParameters.NOT_CONVERGED, "knob", False, False),
    ],
)
def test_a_door_whose_handle_may_be_a_lever_from_near_lacks_its_handle_only(
    status: int, kind: str, mirrored: bool, lacks: bool
) -> None:
    message = MorphingParameters(status=status, reason="so", alternative=kind, mirrored=mirrored)
    assert observation_from_message(message).lacks_handle == lacks


def test_the_recess_is_read_where_it_is_told() -> None:
    names, values = ["tilt", "recess"], [0.2, 0.07]
    message = MorphingParameters(surroundings_names=names, surroundings=values)
    assert observation_from_message(message).recess == 0.07
    for short in (MorphingParameters(), MorphingParameters(surroundings_names=["recess"])):
        assert math.isnan(observation_from_message(short).recess)


def test_joints_are_read_where_their_positions_are_told() -> None:
    message = MorphingParameters(joint_names=["handle", "hinge"], joint_positions=[-0.1, 0.3])
    assert observation_from_message(message).joints == {"handle": -0.1, "hinge": 0.3}
    for short in (MorphingParameters(), MorphingParameters(joint_names=["hinge"])):
        assert not observation_from_message(short).joints
