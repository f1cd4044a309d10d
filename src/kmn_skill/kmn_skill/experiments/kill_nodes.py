"""Kill a node at some moment of a goal, start it again, and see what the next goal does."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from rclpy.task import Future
from tqdm import tqdm

from kmn_msgs.action import OperateJoint
from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_perception.model.actions import Action
from kmn_perception.ros.node_process import NoAnswerError, ProcessClient
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.execution.goal import Goal
from kmn_skill.experiments.door_system import DoorSystem
from kmn_skill.experiments.evaluate import add_control
from kmn_skill.experiments.settings import MODES, Experiment, add_robot_option

NODES = ("skill_node", "sim_node", "morph_node")


class Kill(NamedTuple):
    """One node that was killed.

    Attributes
    ----------
    node
        Its executable.
    phase, progress
        Of the goal, and how much of it was done (0 to 1), when it was killed.
    opened
        Whether the door was open in the physics after the next goal, and the skill said so.
    reason
        Why not.
    """

    node: str
    phase: str
    progress: float
    opened: bool
    reason: str


class Pursuit:
    """A goal that is pursued.

    Attributes
    ----------
    last
        What was told last of it.
    """

    def __init__(
        self,
        client: ProcessClient,
        timeout: float,
        send: Callable[[Callable[[OperateJoint.Feedback], None]], Future],
    ) -> None:
        self._client, self._timeout = client, timeout
        self.last = OperateJoint.Feedback()
        self._answer = send(self._keep)

    def _keep(self, feedback: OperateJoint.Feedback) -> None:
        self.last = feedback

    def is_over(self) -> bool:
        """Tell whether there is a result."""
        return bool(self._answer.done())

    def wait(self, moment: float) -> None:
        """Wait until so much of it (0 to 1) is done, or it is over."""
        self._client.wait(
            lambda: self.is_over() or self.last.progress >= moment, self._timeout, "skill_node"
        )

    def result(self) -> OperateJoint.Result:
        """Wait for the result, and return it."""
        self._client.wait(self.is_over, self._timeout, "skill_node")
        return self._answer.result().result


class KilledSystem(DoorSystem):
    """A system of which a node dies."""

    def __enter__(self) -> KilledSystem:
        self._heard: set[str] = set()  # nodes that reported
        super().__enter__()
        return self

    def _connect(self) -> None:
        super()._connect()
        self._node.create_subscription(DiagnosticArray, "/diagnostics", self._hear, 10)

    def _hear(self, message: DiagnosticArray) -> None:
        self._heard |= {status.name.split(":")[0].rsplit("/")[-1] for status in message.status}

    def kill(self, node: str, goal: Goal, moment: float) -> tuple[str, float]:
        """Pursue a goal, kill a node once so much of the goal (0 to 1) is done, and start it again.

        Returns
        -------
        phase, progress
            Of the goal then.
        """
        pursuit = self.pursue(goal)
        pursuit.wait(moment)
        at = pursuit.last.phase, pursuit.last.progress
        self.restart(node)
        if node != "skill_node":
            pursuit.result()
        return at

    def pursue(self, goal: Goal) -> Pursuit:
        """Send a goal, and return the pursuit of it."""
        return Pursuit(self._client, self._timeouts.goal, partial(self._send, goal))

    def restart(self, node: str) -> None:
        """Kill a node, if it runs, start it again, and wait until it reports."""
        process = self._processes[node]
        process.kill()
        process.start()
        self._heard.clear()  # no report of the one before is under way: it loads for seconds
        self._client.wait(lambda: node in self._heard, self._timeouts.start, f"the new {node}")

    @property
    def hinge(self) -> float:
        """Angle of the door in the physics, radians."""
        return self._hinge


def run(options: argparse.Namespace, experiment: Experiment) -> list[Kill]:
    """Kill one node after the other."""
    random = np.random.default_rng(options.seed)
    model = experiment.kinematic_model()
    doors = experiment.random_objects(model, False, 2 * options.kills, options.seed)
    task = model.actions[0], options.mode
    sim = {**experiment.evaluation._asdict(), "seed": options.seed}
    kills: list[Kill] = []
    with KilledSystem(sim, options, experiment) as system, tqdm(doors[::2], unit="kill") as bar:
        for number, values in enumerate(bar):
            node, moment = NODES[number % len(NODES)], float(random.uniform(0.0, 0.95))
            kills.append(
                _kill(system, node, moment, (values, doors[2 * number + 1]), task, experiment)
            )
            bar.set_postfix_str(f"{sum(kill.opened for kill in kills)} opened next")
    return kills


def _kill(
    system: KilledSystem,
    node: str,
    moment: float,
    doors: tuple[NDArray[np.float64], NDArray[np.float64]],
    task: tuple[Action, str],
    experiment: Experiment,
) -> Kill:
    """Kill a node at a door, and pursue the next goal: there, or if it is open at another one."""
    goal, mode = experiment.goal(*task), task[1]
    system.show(doors[0], mode)
    phase, progress = system.kill(node, goal, moment)
    if node == "sim_node" or experiment.is_open(*task, system.hinge):
        system.show(doors[1], mode)
    try:
        opened = system.open(goal, lambda feedback: None)
    except NoAnswerError as error:
        return Kill(node, phase, progress, False, str(error))
    is_open = bool(opened.result.success) and experiment.is_open(*task, opened.hinge)
    return Kill(node, phase, progress, is_open, opened.result.reason)


def table(kills: Sequence[Kill]) -> str:
    """Return the kills for people to read."""
    rows = [["node", "phase", "done", "next goal"]]
    for kill in kills:
        next_goal = "opened" if kill.opened else kill.reason or "not open in the physics"
        rows.append([kill.node, kill.phase, f"{100 * kill.progress:.0f} %", next_goal])
    return f"{columns(rows)}\n\n{sum(k.opened for k in kills)} of {len(kills)} opened"


def arguments(argv: list[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog="kill_nodes", description=__doc__)
    parser.add_argument("--kills", type=whole_number(1), default=20, help="default 20")
    parser.add_argument("--mode", choices=tuple(MODES), default="pull")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of doors and moments")
    parser.add_argument("--json", type=output_file, help="file to write the result to")
    add_control(parser)
    add_robot_option(parser)
    return parser.parse_args(
        argv, argparse.Namespace(parameters="perceived", room=False, object="")
    )


def main() -> int:
    """Run the executable ``kill_nodes``; 1 if a door stayed shut."""
    options = arguments(own_arguments())
    with ros_session("kill_nodes"):
        kills = run(options, Experiment.load())
    print(table(kills))
    if options.json:
        _write(options.json, options, kills)
    return 0 if all(kill.opened for kill in kills) else 1


def _write(file: Path, options: argparse.Namespace, kills: Sequence[Kill]) -> None:
    named: dict[str, Any] = {name: getattr(options, name) for name in ("mode", "seed", "control")}
    opened = sum(kill.opened for kill in kills)
    write_json(file, {**named, "opened": opened, "kills": [kill._asdict() for kill in kills]})
