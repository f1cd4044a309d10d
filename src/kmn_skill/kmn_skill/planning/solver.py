"""Solves the policy for one first guess, coarse to fine."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import robotic as ry
from numpy.typing import NDArray

from kmn_skill.planning.check import PlanRejected, check
from kmn_skill.planning.layout import BASE, OBJECT_JOINTS, ROBOT
from kmn_skill.planning.motion import MotionError
from kmn_skill.planning.plan import Plan, PlanRequest
from kmn_skill.planning.planning_setup import PlanningSetup
from kmn_skill.planning.policy import Policy, near_pairs, pairs
from kmn_skill.planning.prototypes import Solution
from kmn_skill.planning.reach import check_reach
from kmn_skill.planning.release import release
from kmn_skill.planning.robot_frames import surfaces
from kmn_skill.planning.timing import preceded, timed_plan
from kmn_skill.planning.transfer import refine, transfer
from kmn_skill.planning.world import World


class Solver:
    """Solves the policy; what does not depend on the request is prepared once."""

    def __init__(self, setup: PlanningSetup) -> None:
        self._setup = setup
        World(setup, *setup.model.split(setup.model.prototype))
        surfaces(setup.robot, setup.settings.check.spacing)

    def world(self, request: PlanRequest) -> World:
        """Return the world of a request's object and of what stands around it."""
        return World(self._setup, request.theta, request.gamma, request.obstacles, request.hold)

    def plan(self, request: PlanRequest, guess: Solution, name: str) -> Plan:
        """Return a plan that passes the check.

        A robot that has turned a joint further than half around is planned for as if it had not:
        the solver knows a configuration by its bodies' poses, hence angles within a turn only.

        Parameters
        ----------
        guess
            Solution for another object, to be transferred.
        name
            Of the guess.

        Raises
        ------
        PlanRejected
            If the solution does not pass.
        """
        robot, settings = self._setup.robot, self._setup.settings
        turns = robot.whole_turns(request.start)
        request = replace(request, start=request.start + turns)
        world = self.world(request)
        if robot.is_fixed:
            check_reach(world, request)
        letting_go = release(world, request, settings)
        first = letting_go[-1][-1] if letting_go else request.configuration
        begin = replace(request, start=first[ROBOT], object_start=first[OBJECT_JOINTS])
        guessed = transfer(guess, self._setup.model, self._setup.action, begin)
        path = self._solve(world, begin, self._standing(guessed, begin))
        path = self._standing(path, begin)  # exactly
        try:
            plan = timed_plan(path, begin, world)
            if letting_go:
                plan = preceded(plan, letting_go, world)
        except MotionError as error:
            raise PlanRejected(str(error)) from error
        plan = replace(plan, report=replace(plan.report, seed_used=name))
        report = check(plan, request, world)
        return replace(plan, positions=plan.positions - turns, report=report)

    def coarse(
        self,
        world: World,
        request: PlanRequest,
        guess: NDArray[np.float64],
        near: float = np.inf,
    ) -> NDArray[np.float64]:
        """Return the solution (T, D) with few configurations, from a guess of as many.

        Parameters
        ----------
        near
            Pairs that are further apart in the guess are left out, metres.

        Raises
        ------
        PlanRejected
            If it is none.
        """
        settings = self._setup.settings
        around = near_pairs(world, pairs(world), guess, near)
        policy = Policy(world, request, settings.planner.coarse, around)
        path, violation = optimise(policy.problem, self._disturbed(guess), settings.solver)
        if violation > settings.planner.violation:
            raise PlanRejected("no motion was found that fulfils all constraints")
        return path

    def _solve(
        self, world: World, request: PlanRequest, guess: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        settings = self._setup.settings
        path = self.coarse(world, request, guess, settings.planner.near_guess)
        around = near_pairs(world, pairs(world), path, settings.planner.near)
        slices = settings.planner.fine
        policy = Policy(world, request, slices, around)
        finer = refine(path, request.configuration, slices)
        return optimise(policy.problem, finer, settings.solver)[0]

    def _standing(self, path: NDArray[np.float64], request: PlanRequest) -> NDArray[np.float64]:
        """Return a path (T, D) on which a base that is fixed stands where it starts."""
        if not self._setup.robot.is_fixed:
            return path
        standing = path.copy()
        standing[:, BASE] = request.start[BASE]
        return standing

    def _disturbed(self, path: NDArray[np.float64]) -> NDArray[np.float64]:
        """Add some noise (m and rad) to a guess (T, D), the same each time.

        On a guess that almost fulfils the constraints the solver ends at once, before it fulfils
        them.
        """
        generator = np.random.default_rng(0)
        return path + generator.normal(0.0, self._setup.settings.planner.noise, path.shape)


def optimise(
    problem: Any, guess: NDArray[np.float64], options: Mapping[str, float]
) -> tuple[NDArray[np.float64], float]:
    """Return where the solver ends (T, D), and how much it violates the constraints."""
    program = problem.nlp()
    low, high = program.getBounds()
    first = guess.reshape(-1)
    solver = ry.NLP_Solver(program, verbose=0)
    solver.setOptions(verbose=0, **options)
    solver.setInitialization(np.where(low < high, np.clip(first, low, high), first))
    result = solver.solve(resampleInitialization=0)
    return np.array(result.x).reshape(guess.shape), float(result.eq + result.ineq)
