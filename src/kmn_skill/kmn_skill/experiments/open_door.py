"""Ask skill_node to open the door that it sees, and tell how it goes; Ctrl-C cancels the goal."""

from __future__ import annotations

import argparse
import signal
import time
from collections.abc import Callable
from types import FrameType

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.node import Node

from kmn_msgs.action import OpenDoor
from kmn_perception.model.actions import Action
from kmn_perception.ros.node_process import ProcessError
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.execution.goal import Goal
from kmn_skill.experiments.narrator import Narrator
from kmn_skill.experiments.settings import MODES, Experiment
from kmn_skill.planning.prototypes import PULL
from kmn_skill.ros.error_codes import code_name
from kmn_skill.ros.locked_action_client import LockedActionClient

ACTION = "open_door"
POLL_PERIOD = 0.1  # seconds


class DoorOpener:
    """Sends a goal and waits for its result.

    Parameters
    ----------
    timeout
        Seconds in which the action's server must be there, and after which it counts as gone.
    """

    def __init__(self, node: Node, timeout: float) -> None:
        self._node, self._timeout = node, timeout
        self._action = LockedActionClient(node, OpenDoor, ACTION)
        self._interrupted = False

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Give up the goal, as the handler of a signal; a second one ends the program at once.

        To raise an exception at the first one could lose an answer that was just taken.
        """
        if self._interrupted:
            raise KeyboardInterrupt
        self._interrupted = True

    def open(self, goal: Goal) -> OpenDoor.Result:
        """Open the door, or cancel that when interrupted.

        Raises
        ------
        ProcessError
            If the server is not there, goes away, or rejects the goal.
        KeyboardInterrupt
            If it is interrupted before there is a goal to cancel, or twice.
        """
        self._wait(
            lambda: self._action.server_is_ready() or self._interrupted,
            "no action server '{}' within {:g} s",
        )
        if self._interrupted:
            raise KeyboardInterrupt
        narrator = Narrator()

        def tell(feedback: OpenDoor.Feedback) -> None:
            narrator.tell(feedback.phase, feedback.progress, feedback.door_angle)

        gone = "the action server '{}' is gone since {:g} s"
        sent = self._action.send_goal_async(
            OpenDoor.Goal(handle_angle=goal.unlatched, door_angle=goal.target),
            lambda message: tell(message.feedback),
        )
        self._wait(sent.done, gone)
        handle = sent.result()
        if not handle.accepted:
            raise ProcessError("the goal was rejected: another one runs, or skill_node ends")
        ended = handle.get_result_async()
        self._wait(lambda: ended.done() or self._interrupted, gone)
        if not ended.done():
            print("cancelling the goal", flush=True)
            handle.cancel_goal_async()
            self._wait(ended.done, gone)
        answer = ended.result()
        if answer.status == GoalStatus.STATUS_UNKNOWN:
            raise ProcessError("skill_node does not know the goal any more")
        return answer.result

    def _wait(self, done: Callable[[], bool], problem: str) -> None:
        """Wait until something is done, as long as the server is there."""
        seen = time.monotonic()
        while not done():
            if self._action.server_is_ready():
                seen = time.monotonic()
            elif time.monotonic() - seen > self._timeout:
                text = problem.format(ACTION, self._timeout)
                raise ProcessError(f"{text}, is skill_node running?")
            rclpy.spin_once(self._node, timeout_sec=POLL_PERIOD)


def arguments(argv: list[str], action: Action) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog=ACTION, description=__doc__)
    parser.add_argument(
        "--handle-angle",
        type=float,
        default=action.unlatched,
        help=f"to which the handle is pressed, radians; default {action.unlatched:g}",
    )
    door = parser.add_mutually_exclusive_group()
    door.add_argument(
        "--door-angle", type=float, help="radians: negative to pull, positive to push"
    )
    door.add_argument(
        "--mode",
        choices=tuple(MODES),
        default=PULL,
        help=f"instead of the angle: {abs(action.target):g} rad to this side, default {PULL}",
    )
    return parser.parse_args(argv)


def main() -> int:
    """Run the executable ``open_door``; its exit status is 0 if the door is open."""
    experiment = Experiment.load()
    action = experiment.kinematic_model().actions[0]
    options = arguments(own_arguments(), action)
    angle = options.door_angle
    if angle is None:
        angle = experiment.goal(action, options.mode).target
    with ros_session(ACTION):
        node = Node(ACTION)
        try:
            opener = DoorOpener(node, experiment.timeouts.server)
            for number in (signal.SIGINT, signal.SIGTERM):  # a shell may have had them ignored
                signal.signal(number, opener.interrupt)
            result = opener.open(Goal(options.handle_angle, angle))
        finally:
            node.destroy_node()
    if not result.success:
        print(f"the door was not opened, {code_name(result.error_code)}: {result.reason}")
        return 1
    print(f"the door is open by {result.door_angle:.2f} rad")
    return 0
