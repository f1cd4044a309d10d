"""What runs in the planner's process: it answers requests with plans or reasons."""

from __future__ import annotations

import os
import signal
from multiprocessing.connection import Connection
from typing import NamedTuple

from kmn_perception.configuration.section import ConfigurationError
from kmn_skill.planning.kinematic_chain import KinematicChain
from kmn_skill.planning.planning_setup import PlanningSetup


class Ready(NamedTuple):
    """Is sent when all is loaded."""

    chain: KinematicChain


def serve(connection: Connection, setup: PlanningSetup, folder: str) -> None:
    """Say when ready, or why never; answer each (request, guess) with a plan, or why not."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started it ends it
    os.chdir(folder)  # the package robotic writes a log where it is
    _silence()
    _answer(connection, setup)


def _answer(connection: Connection, setup: PlanningSetup) -> None:
    from kmn_skill.planning.check import PlanRejected
    from kmn_skill.planning.robot_chain import chain_of
    from kmn_skill.planning.solver import Solver

    try:
        solver, chain = Solver(setup), chain_of(setup.robot)
    except ConfigurationError as error:  # of the robot's file, against its model
        connection.send(str(error))
        return
    connection.send(Ready(chain))
    while True:
        try:
            request, guess = connection.recv()
        except (EOFError, OSError):
            return
        try:
            connection.send(solver.plan(request, guess.solution, guess.name))
        except (PlanRejected, ConfigurationError) as error:
            connection.send(str(error))
        except Exception as error:  # whatever robotic and toppra raise: the next request is served
            first, *_ = str(error).splitlines() or [""]
            connection.send(f"the solver failed: {type(error).__name__}: {first}")


def _silence() -> None:
    """Discard what the solver writes to the terminal."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    os.close(nowhere)
