"""Plans in a process of its own: it may hang or die without harm to who asks."""

from __future__ import annotations

import math
import multiprocessing
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess

import numpy as np
from numpy.typing import NDArray

from kmn_skill.planning.kinematic_chain import KinematicChain
from kmn_skill.planning.look import furthest, look_plan
from kmn_skill.planning.plan import Plan, PlanningCancelled, PlanningFailed, PlanRequest
from kmn_skill.planning.planning_process import Ready, serve
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.prototypes import Guess, Prototypes

POLL_PERIOD = 0.02  # seconds
TOLERANCE = 0.03  # metres, by which opening fingers may reach further
STOP_TIMEOUT = 2.0  # seconds for the process to end
NO_MOTION = "no motion is known that moves it to this side; make_prototypes makes them"


class Planner:
    """Plans one request at a time; to be used as a context, which owns the process.

    Parameters
    ----------
    setup
        Object, robot and policy.
    prototypes
        Solutions to start from.
    time_limit
        Seconds for a plan.

    Attributes
    ----------
    restarts
        How often the process had to be started anew.

    Raises
    ------
    ConfigurationError
        If the solutions are for other joints than those of robot and object.
    """

    def __init__(
        self, setup: PlanningSetup, prototypes: Prototypes, time_limit: float = math.inf
    ) -> None:
        prototypes.check(setup.joint_names)
        self._setup, self._prototypes, self._time_limit = setup, prototypes, time_limit
        self._settings = setup.settings.planner
        self._process: BaseProcess | None = None
        self._connection: Connection | None = None
        self._folder: tempfile.TemporaryDirectory[str] | None = None  # where the process works
        self._loaded = False
        self._chain: KinematicChain | None = None  # of the robot
        self.restarts = 0

    def __enter__(self) -> Planner:
        self._start()
        return self

    def __exit__(self, *exception: object) -> None:
        self._stop()

    @property
    def pid(self) -> int | None:
        """Number of the process."""
        return None if self._process is None else self._process.pid

    @property
    def drives(self) -> bool:
        """Whether the robot can drive to see the door from elsewhere."""
        return not self._setup.robot.is_fixed

    def plan(self, request: PlanRequest, cancelled: Callable[[], bool] = lambda: False) -> Plan:
        """Return a plan that has passed the check.

        Parameters
        ----------
        cancelled
            Is asked again and again whether the plan is still wanted.

        Raises
        ------
        PlanningFailed
            If there is none within the time limit.
        PlanningCancelled
            If it is not wanted any more.
        """
        if not request.is_finite():
            raise PlanningFailed("the request has numbers that are not finite")
        begin, left = time.monotonic(), self._time_limit
        reasons = []
        holds = len(self._setup.action.grasp.offsets)
        for guess in self._prototypes.guesses(
            request, self._settings.attempts, self._settings.spread, holds
        ):
            if left <= 0.0:
                reasons.append(f"the {self._time_limit:g} s are over")
                break
            connection = self._ready(cancelled)
            attempted = time.monotonic()
            limit = min(left, self._settings.attempt_limit)
            answer = self._attempt(connection, request, guess, limit, cancelled)
            left -= time.monotonic() - attempted
            if isinstance(answer, Plan):
                passed = time.monotonic() - begin
                return replace(answer, report=replace(answer.report, planning_time=passed))
            reasons.append(answer)
        raise PlanningFailed("; ".join(dict.fromkeys(reasons)) or NO_MOTION)

    def pads(self, positions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where the fingers touch (2, 3), world frame, at positions (J,) of the robot."""
        poses = self.links(positions)
        pads = self._setup.robot.planning.pads[:2]
        points = [(poses[pad.joint] @ [*pad.point, 1.0])[:3] for pad in pads]
        return np.array(points)

    def look(
        self,
        values: NDArray[np.float64],
        start: NDArray[np.float64],
        place: NDArray[np.float64],
        clearance: float,
    ) -> Plan:
        """Return the plan to drive to where the handle of a door can be seen from.

        Parameters
        ----------
        values
            (n + m,) parameters of the closed door.
        start, place
            (J,) present positions of the robot, and those from where it is seen.
        clearance
            By which the robot keeps before the door, as far as it does so now, metres.

        Raises
        ------
        PlanningFailed
            If it would come nearer, or does not drive.
        """
        if not self.drives:
            raise PlanningFailed("the robot stands where it is: its base cannot drive elsewhere")
        is_near = self.reach(values, start) > -clearance
        back = abs(self._setup.settings.policy.pre_grasp) if is_near else 0.0
        plan = look_plan(self._setup, values, start, place, back)
        reach = [self.reach(values, each) for each in plan.positions]
        if max(reach) > max(-clearance, reach[0] + TOLERANCE):
            raise PlanningFailed(
                f"to see the handle the robot would come within {-max(reach):.2f} m of the door, "
                f"expected {clearance:g} m"
            )
        return plan

    def reach(self, values: NDArray[np.float64], positions: NDArray[np.float64]) -> float:
        """Return how far the robot at positions (J,) reaches into a door at most, metres.

        Raises
        ------
        PlanningFailed
            As `links`.
        """
        links = np.array(list(self.links(positions).values()))
        return furthest(self._setup.model, self._setup.action.joint.body, values, links)

    def links(self, positions: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Return the poses (4, 4) of the robot's links in the world at positions (J,).

        Raises
        ------
        PlanningFailed
            If the process that knows the robot does not start.
        """
        if self._chain is None:
            self._ready(lambda: False)
        assert self._chain is not None
        return self._chain.poses(positions)

    def _ready(self, cancelled: Callable[[], bool]) -> Connection:
        """Return the connection to a process that has loaded all it needs.

        That takes seconds, and is no part of a plan's time.

        Raises
        ------
        PlanningFailed
            If the process does not start.
        PlanningCancelled
            If the plan is not wanted any more.
        """
        if self._process is None or not self._process.is_alive():
            self._restart()
        assert self._connection is not None
        deadline = time.monotonic() + self._settings.start_limit
        while not self._loaded:
            if cancelled():
                raise PlanningCancelled
            if time.monotonic() > deadline:
                raise PlanningFailed("the planner's process does not start")
            try:
                if self._connection.poll(POLL_PERIOD):
                    ready: Ready | str = self._connection.recv()
                    if isinstance(ready, str):
                        raise PlanningFailed(ready)
                    self._chain, self._loaded = ready.chain, True
            except (EOFError, OSError):
                raise PlanningFailed("the planner's process died while it started") from None
        return self._connection

    def _attempt(
        self,
        connection: Connection,
        request: PlanRequest,
        guess: Guess,
        limit: float,
        cancelled: Callable[[], bool],
    ) -> Plan | str:
        """Return the plan that a first guess leads to, or why there is none."""
        deadline = time.monotonic() + limit
        try:
            connection.send((replace(request, hold=guess.hold), guess))
            while not connection.poll(POLL_PERIOD):
                if cancelled():
                    self._restart()
                    raise PlanningCancelled
                if time.monotonic() > deadline:
                    self._restart()
                    return f"the solver took longer than {limit:.1f} s"
            answer: Plan | str = connection.recv()
        except (EOFError, OSError):
            self._restart()
            return "the planner's process died"
        return answer

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._connection, other = context.Pipe()
        self._folder = tempfile.TemporaryDirectory()
        self._process = context.Process(
            target=serve, args=(other, self._setup, self._folder.name), name="planner", daemon=True
        )
        self._process.start()
        self._loaded = False
        other.close()

    def _restart(self) -> None:
        self._stop()
        self._start()
        self.restarts += 1

    def _stop(self) -> None:
        if self._process is None or self._connection is None or self._folder is None:
            return
        self._connection.close()
        self._process.kill()
        self._process.join(STOP_TIMEOUT)
        self._folder.cleanup()
        self._process = self._connection = self._folder = None
