"""One of two drawers in one world is opened, as it is perceived, and the other one stays closed."""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from sensor_msgs.msg import JointState

from kmn_msgs.msg import MorphingParameters
from kmn_perception.model.kinematic_model import KinematicModel

pytest.importorskip("pybullet")
pytest.importorskip("robotic")
from kmn_skill.experiments.beside import Beside  # noqa: E402
from kmn_skill.experiments.settings import Experiment  # noqa: E402

TRUTH = MorphingParameters(model="drawer", id=1, theta=[0.1, 0.3, 0.2])


def beside(names: str = "cupboard_door, drawer") -> Beside:
    return Beside(argparse.Namespace(beside=names), closed=0.02)


def told(second: int, number: int, **fields: Any) -> MorphingParameters:
    values = {"model": "drawer", "status": MorphingParameters.OK, "theta": [0.1, 0.3, 0.2]}
    message = MorphingParameters(id=number, **{**values, **fields})
    message.header.stamp.sec = second
    return message


def test_the_nodes_are_told_of_all_models() -> None:
    assert beside().of_sim_node() == {"beside": "cupboard_door,drawer"}
    assert beside().of_morph_node("drawer") == {"model": "drawer,cupboard_door", "objects": "all"}
    alone = Beside(argparse.Namespace(), closed=0.02)
    assert (alone.count, alone.of_morph_node("drawer")) == (0, {})
    assert alone.of_sim_node() == {}  # on a command line no parameter can be empty


def test_the_object_that_is_meant_is_the_one_at_its_place_in_the_newest_frame() -> None:
    other = {"theta": [0.2, -0.4, 0.2]}
    unsure = {"status": MorphingParameters.NOT_CONVERGED, "theta": [], "model": "drawer"}
    seen = [
        told(1, 3),
        told(2, 4, **other),
        told(2, 5),
        told(2, 6, model="cupboard_door"),
        told(3, 0, **unsure),
    ]
    assert beside().meant(seen, TRUTH).id == 5
    assert beside().meant(seen[:2], TRUTH).id == 4  # what is at its place was not seen since
    assert beside().meant(seen[4:], TRUTH).header.stamp.sec == 3
    unseen = beside().meant(seen[3:4], TRUTH)
    assert (unseen.id, len(unseen.theta)) == (0, 3)
    assert np.isnan(unseen.theta).all()


def test_a_joint_beside_it_that_was_moved_is_told_even_where_it_is_closed_again() -> None:
    watched, names = beside(), ["cupboard_door_2/hinge", "drawer_3/slide"]
    watched.on_state(JointState(name=names, position=[-0.5, 0.0]))
    watched.watch()
    for position in (0.0, -0.12, -0.001):
        watched.on_state(JointState(name=names, position=[position, 0.01]))
    assert watched.moved() == "cupboard_door_2/hinge beside it was moved by 0.120 [m, rad]"
    watched.watch()
    assert watched.moved() == ""


def test_objects_in_a_row_are_drawn_where_the_first_one_beside_can_be_perceived() -> None:
    experiment, model = Experiment.load(), KinematicModel.load("drawer")
    drawn = experiment.random_objects(model, False, 200, 0, in_row=True)
    low, high = model.limits.T
    assert ((low <= drawn) & (drawn <= high)).all()
    for name, (least, most) in experiment.row.limits.items():
        column = [parameter.name for parameter in model.parameters].index(name)
        assert least <= drawn[:, column].min() < drawn[:, column].max() <= most


@pytest.mark.slow
def test_the_one_that_is_meant_is_opened_and_the_other_one_is_not(
    domain: int, tmp_path: Path
) -> None:
    result = tmp_path / "result.json"
    program = [sys.executable, "-m", "kmn_skill", "evaluate", "--json", str(result)]
    options = ["--object", "drawer", "--beside", "drawer", "--doors", "1", "--seed", "2"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain)}
    subprocess.run([*program, *options], check=True, env=environment)
    counts = json.loads(result.read_text())
    assert (counts["opened"], counts["failures"]) == (1, [])
