"""The codes of the action's results: each reason has one, and the document states them.

rosbags, which shares no code with rosidl, reads the constants from the text of the action's file.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest
from rosbags.typesys import get_types_from_msg

from kmn_msgs.action import OpenDoor
from kmn_perception.model.kinematic_model import KinematicModel
from kmn_skill.execution.errors import Reason
from kmn_skill.execution.goal import SUCCESS, Result
from kmn_skill.ros.error_codes import NAMES, code_name, error_code
from kmn_skill.ros.goal_interfaces import OpenDoorInterface, OperateJointInterface

ROOT = Path(__file__).parents[3]
KIND = "kmn_msgs/msg/OpenDoorResult"
OUTCOMES = {SUCCESS, *get_args(Reason)}


def constants(action: str = "OpenDoor") -> dict[str, int]:
    """Return the codes that an action's file states, by their names."""
    text = (ROOT / f"src/kmn_msgs/action/{action}.action").read_text(encoding="utf-8")
    stated, _ = get_types_from_msg(text.split("---\n")[1], KIND)[KIND]
    return {name: int(value) for name, kind, value in stated if kind == "int32"}


def test_every_outcome_has_a_code_of_the_action_and_every_code_an_outcome() -> None:
    assert set(NAMES) == OUTCOMES
    assert set(NAMES.values()) == set(constants())
    assert {error_code(outcome) for outcome in OUTCOMES} == set(constants().values())


def test_both_actions_have_the_same_codes() -> None:
    assert constants("OperateJoint") == constants()


def test_no_two_codes_are_alike_and_only_success_is_zero() -> None:
    codes = constants()
    assert len(set(codes.values())) == len(codes)
    assert [name for name, code in codes.items() if code == 0] == ["SUCCESS"]


def test_codes_have_their_names() -> None:
    assert {code: code_name(code) for code in constants().values()} == {
        code: name for name, code in constants().items()
    }
    assert code_name(1234) == "1234"


@pytest.mark.parametrize("outcome", sorted(OUTCOMES))
def test_a_result_is_a_success_exactly_if_its_code_is(outcome: str) -> None:
    result = Result(outcome, "because")  # type: ignore[arg-type]
    drawer = KinematicModel.load("drawer")
    operate = OperateJointInterface(drawer)
    for message in (OpenDoorInterface().result(result), operate.result(result)):
        assert message.success == (message.error_code == OpenDoor.Result.SUCCESS)


def test_the_document_states_codes_names_and_outcomes() -> None:
    text = (ROOT / "docs/skill.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\d+) \| `(\w+)` \| (.*?) \|", text, flags=re.MULTILINE)
    assert {name: int(code) for code, name, _ in rows} == constants()
    assert {
        outcome: name for _, name, cell in rows for outcome in re.findall(r"`(\w+)`", cell)
    } == NAMES
