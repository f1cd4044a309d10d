"""Ask skill_node to open the door that it sees, and tell how it goes; Ctrl-C cancels the goal."""

from __future__ import annotations

import argparse
import signal
import sys
import time

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action.client import ActionClient
from rclpy.node import Node
from rclpy.task import Future

from kmn_msgs.action import OpenDoor
from kmn_perception.ros.node_process import ProcessError
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.execution.goal import Goal
from kmn_skill.experiments.narrator import Narrator
from kmn_skill.experiments.settings import MODES, Experiment
from kmn_skill.planning.prototypes import PULL

ACTION = "open_door"
POLL_PERIOD = 0.1  # seconds


class DoorOpener:
    """Sends a goal and waits for its result.

    Parameters
    ----------
    timeout
        Seconds in which the action's server must be there, and after which it counts as gone.

    Raises
    ------
    ProcessError
        If the server is not there, goes away, or rejects the goal; by all methods.
    """

    def __init__(self, node: Node, timeout: float) -> None:
        self._node, self._timeout = node, timeout
        self._action = ActionClient(node, OpenDoor, ACTION)

    def open(self, goal: Goal) -> OpenDoor.Result:
        """Open the door, or give up when interrupted."""
        if not self._action.wait_for_server(timeout_sec=self._timeout):
            raise ProcessError(
                f"no action server '{ACTION}' within {self._timeout:g} s, is skill_node running?"
            )
        narrator = Narrator()
        sent = self._action.send_goal_async(
            OpenDoor.Goal(**goal._asdict()), lambda message: narrator.tell(message.feedback)
        )
        interrupted = self._wait(sent)
        handle = sent.result()
        if not handle.accepted:
            raise ProcessError("the goal was rejected: another one runs, or skill_node ends")
        ended = handle.get_result_async()
        if interrupted or self._wait(ended):
            print("cancelling the goal", flush=True)
            handle.cancel_goal_async()
            self._wait(ended)
        answer = ended.result()
        if answer.status == GoalStatus.STATUS_UNKNOWN:
            raise ProcessError("skill_node does not know the goal any more")
        return answer.result

    def _wait(self, future: Future) -> bool:
        """Wait for an answer; return whether that was interrupted, which does not end it."""
        seen = time.monotonic()
        while not future.done():
            if self._action.server_is_ready():
                seen = time.monotonic()
            elif time.monotonic() - seen > self._timeout:
                raise ProcessError(f"the action server '{ACTION}' is gone, the goal has no result")
            try:
                rclpy.spin_once(self._node, timeout_sec=POLL_PERIOD)
            except KeyboardInterrupt:
                return True
        return False


def arguments(argv: list[str], experiment: Experiment) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog=ACTION, description=__doc__)
    parser.add_argument(
        "--handle-angle",
        type=float,
        default=experiment.handle_angle,
        help=f"to which the handle is pressed, radians; default {experiment.handle_angle:g}",
    )
    door = parser.add_mutually_exclusive_group()
    door.add_argument(
        "--door-angle", type=float, help="radians: negative to pull, positive to push"
    )
    door.add_argument(
        "--mode",
        choices=tuple(MODES),
        default=PULL,
        help=f"instead of the angle: {experiment.door_angle:g} rad to this side, default {PULL}",
    )
    return parser.parse_args(argv)


def main() -> int:
    """Run the executable ``open_door``; its exit status is 0 if the door is open."""
    experiment = Experiment.load()
    options = arguments(own_arguments(), experiment)
    angle = options.door_angle
    if angle is None:
        angle = experiment.goal(options.mode).door_angle
    with ros_session(ACTION):
        for number in (signal.SIGINT, signal.SIGTERM):  # a shell may have had them ignored
            signal.signal(number, signal.default_int_handler)
        node = Node(ACTION)
        try:
            opener = DoorOpener(node, experiment.timeouts.server)
            result = opener.open(Goal(options.handle_angle, angle))
        finally:
            node.destroy_node()
    if not result.success:
        print(f"the door was not opened: {result.reason}")
        return 1
    print(f"the door is open by {result.door_angle:.2f} rad")
    return 0


if __name__ == "__main__":
    sys.exit(main())
