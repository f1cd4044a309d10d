"""Buttons that open, cancel and reset, and what becomes of the goal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.action.client import ActionClient
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

from kmn_msgs.action import OperateJoint
from kmn_perception.viewer.controls import Clicks, write
from kmn_perception.viewer.drawing import plain
from kmn_perception.viewer.inputs import Inputs
from kmn_perception.viewer.viewer_parameters import ViewerSettings

ACTIONS = ("open_door", "operate_joint")  # of which a running goal is cancelled
GOALS = ": goals"  # how the name ends of the status that tells what is being done
QUEUE_DEPTH = 10
STEPS = 100  # of the slider


class SkillPanel:
    """Sends goals of ``operate_joint``, and tells their phases and results.

    What is clicked comes in a thread of the web server, and is done in the executor's.
    """

    def __init__(
        self, node: Node, gui: viser.GuiApi, settings: ViewerSettings, inputs: Inputs
    ) -> None:
        self._node, self._inputs = node, inputs
        self._model = settings.model
        self._clicks = Clicks()
        self._goal, self._phase, self._outcome = "no goal of this page yet", "unknown", ""
        inputs.expect("/diagnostics")
        node.create_subscription(DiagnosticArray, "/diagnostics", self._on_reports, QUEUE_DEPTH)
        self._text = gui.add_markdown("")
        self._buttons: list[tuple[viser.GuiButtonHandle, Callable[[], bool]]] = []
        if settings.page.buttons:
            self._connect(gui, settings.target)

    def _connect(self, gui: viser.GuiApi, target: float) -> None:
        """Make the buttons and the clients that they need."""
        node = self._node
        self._reset = node.create_client(Trigger, "reset")
        self._add(gui, "reset", "red", self._ask_reset, self._reset.service_is_ready)
        if not self._model.actions:
            return
        action = self._model.actions[0]
        low, high = action.joint.limits
        self._target = gui.add_slider(
            f"{action.joint.name} [{action.joint.unit}]",
            min=low,
            max=high,
            step=(high - low) / STEPS,
            initial_value=min(max(target or action.target, low), high),
        )
        self._action = ActionClient(node, OperateJoint, "operate_joint")
        self._cancel = [
            node.create_client(CancelGoal, f"{name}/_action/cancel_goal") for name in ACTIONS
        ]
        self._add(gui, "open", "green", self._open, self._action.server_is_ready)
        self._add(gui, "cancel", "yellow", self._ask_cancel, self._action.server_is_ready)

    def _add(
        self,
        gui: viser.GuiApi,
        label: str,
        colour: Any,
        act: Callable[[], None],
        is_ready: Callable[[], bool],
    ) -> None:
        button = gui.add_button(label, color=colour, disabled=True)
        self._clicks.on(button, act)
        self._buttons.append((button, is_ready))

    def update(self) -> None:
        """Do what was clicked, and tell how it goes."""
        while act := self._clicks.take():
            with self._inputs.part("button"):
                act()
        for button, is_ready in self._buttons:
            if button.disabled is is_ready():
                button.disabled = not button.disabled
        lines = [f"**goal** {plain(self._goal)}", f"**skill** {plain(self._phase)}"]
        write(self._text, "\n\n".join([*lines, plain(self._outcome)]))

    def _open(self) -> None:
        action = self._model.actions[0]
        goal = OperateJoint.Goal(
            model=self._model.name, joint=action.joint.name, target=float(self._target.value)
        )
        self._goal, self._outcome = f"sent: {action.joint.name} to {goal.target:.2f}", ""
        self._action.send_goal_async(goal, self._on_feedback).add_done_callback(self._on_answer)

    def _on_feedback(self, message: Any) -> None:
        now = message.feedback
        self._goal = f"{now.phase}, {100.0 * now.progress:.0f} %, joint at {now.position:.2f}"

    def _on_answer(self, future: Future) -> None:
        handle = future.result()
        if not handle.accepted:
            self._goal = "rejected: another goal runs, or skill_node ends"
            return
        handle.get_result_async().add_done_callback(self._on_result)

    def _on_result(self, future: Future) -> None:
        result = future.result().result
        self._goal = "succeeded" if result.success else f"ended, {code_name(result.error_code)}"
        self._outcome = (
            f"{result.reason} joint at {result.position:.2f}, attempts {result.attempts}, planned "
            f"within {result.planning_time:.2f} s, clearance {1e3 * result.clearance:.0f} mm"
        ).strip()

    def _ask_cancel(self) -> None:
        """Cancel all goals, whoever sent them: a request that names none means all."""
        for client in self._cancel:
            if client.service_is_ready():
                client.call_async(CancelGoal.Request())

    def _ask_reset(self) -> None:
        answer = self._reset.call_async(Trigger.Request())
        answer.add_done_callback(self._on_reset)

    def _on_reset(self, future: Future) -> None:
        self._goal, self._outcome = f"reset: {future.result().message}", ""

    def _on_reports(self, message: DiagnosticArray) -> None:
        """Take what the skill of this node's namespace reports, whoever sent its goal."""
        self._inputs.hear("/diagnostics")
        space = self._node.get_namespace().rstrip("/")
        with self._inputs.part("/diagnostics"):
            for status in message.status:
                name, _, what = status.name.rpartition("/")
                if name == space and what.endswith(GOALS):
                    last = next((v.value for v in status.values if v.key == "last"), "")
                    self._phase = f"{status.message}; last: {last}"


def code_name(code: int) -> str:
    """Return the name of an error code of the action; the number where it has none."""
    result = OperateJoint.Result
    names = {getattr(result, name): name for name in dir(type(result)) if name.isupper()}
    return str(names.get(code, code))
