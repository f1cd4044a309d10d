"""Open doors for hours while nodes die, floods come, clocks jump and disks are full."""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter
from collections.abc import Sequence
from random import Random
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from kmn_perception.bags.replay import positive_number
from kmn_perception.command_line.arguments import output_file, whole_number, write_json
from kmn_perception.command_line.columns import columns
from kmn_perception.ros.node_process import NoAnswerError, ProcessError
from kmn_perception.ros.program import own_arguments, ros_session
from kmn_skill.experiments.evaluate import add_control
from kmn_skill.experiments.settings import MODES, Experiment, add_robot_option
from kmn_skill.experiments.soak.settings import SoakSettings
from kmn_skill.experiments.soak.troubles import TROUBLES, TroubledSystem
from kmn_skill.experiments.soak.usage import UsageLog

OPENED, NOT_OPENED, NO_RESULT, LOST = "opened", "not opened", "no result", "its node was killed"
STAMPS = ("flood", "clock")  # troubles whose stamps look as if frames were lost
NOT_SHOWN = "no door was seen"
ENDS = (OPENED, NOT_OPENED, NO_RESULT, LOST, NOT_SHOWN)


class Pursued(NamedTuple):
    """A goal: what went wrong meanwhile, and to what; how it ended, and why so."""

    hours: float
    trouble: str
    victim: str
    end: str
    reason: str


class Soak:
    """An endurance test, and what has come of it so far."""

    def __init__(self, options: argparse.Namespace, experiment: Experiment) -> None:
        self._options, self._experiment = options, experiment
        self._settings, self._log = SoakSettings.load(), UsageLog()
        self._random, self._start = Random(options.seed), time.monotonic()
        self._pursued: list[Pursued] = []
        self._fallen: list[str] = []
        self._frames_lost = 0

    @property
    def hours(self) -> float:
        """Since the start."""
        return (time.monotonic() - self._start) / 3600.0

    def run(self) -> None:
        """Pursue goals until the time is over."""
        model = self._experiment.kinematic_model()
        generator = np.random.default_rng(self._options.seed)
        system = TroubledSystem(self._options, self._experiment, self._settings, self._log)
        with system, tqdm(unit="goal") as bar:
            while self.hours < self._options.hours:
                self._pursue_next(system, model.sample(generator, 1)[0])
                bar.set_postfix_str(self._in_short())
                bar.update()

    def _pursue_next(self, system: TroubledSystem, door: NDArray[np.float64]) -> None:
        """Show a door, pursue a goal at it while something happens or nothing, and note the end."""
        system.watch(self.hours)
        random, settings = self._random, self._settings
        trouble = "" if random.random() < settings.calm else random.choice(TROUBLES)
        lost_before = system.frames_lost
        moment, victim, end = random.uniform(0.0, settings.progress), "", NOT_SHOWN
        model, mode = self._experiment.kinematic_model(), self._options.mode
        try:
            system.show(door, mode)
            end = NO_RESULT
            pursuit = system.pursue(self._experiment.goal(model.actions[0], mode))
            if trouble:
                pursuit.wait(moment)
                victim = self._let_happen(system, trouble)
            if victim == "skill_node" and trouble == "kill" and not pursuit.is_over():
                end, reason = LOST, ""
            else:
                result = pursuit.result()
                end, reason = OPENED if result.success else NOT_OPENED, result.reason
        except NoAnswerError as error:
            reason = str(error)
            tqdm.write(f"{reason}; the nodes' threads are at:\n{system.where()}")
        except ProcessError as error:  # a node has ended by itself
            reason = str(error)
            self._fallen += [f"{name} during '{trouble}': {reason}" for name in system.revive()]
        system.watch(self.hours)
        if trouble not in STAMPS:
            self._frames_lost += system.frames_lost - lost_before
        self._pursued.append(Pursued(self.hours, trouble, victim, end, reason))

    def _let_happen(self, system: TroubledSystem, trouble: str) -> str:
        """Let something happen; a node that does not answer meanwhile is no end of the goal."""
        try:
            return system.happen(trouble, self._random)
        except NoAnswerError as error:
            tqdm.write(f"{error}; the nodes' threads are at:\n{system.where()}")
            self._fallen.append(f"during '{trouble}': {error}")
            return str(error)

    def _in_short(self) -> str:
        ends = Counter(each.end for each in self._pursued)
        return f"{ends[OPENED]} opened, {ends[NO_RESULT]} without a result"

    def failed(self) -> bool:
        """Tell whether a goal had no result, a node ended by itself, or memory grows."""
        return (
            bool(self._fallen)
            or any(each.end == NO_RESULT for each in self._pursued)
            or any(growth > self._settings.growth for growth in self._growths().values())
        )

    def _warm_up(self) -> float:
        """Return the hours after which memory shall be flat; all of them in a run that is short."""
        warm_up = self._settings.warm_up
        return warm_up if self.hours >= 3.0 * warm_up else self.hours

    def _growths(self) -> dict[str, float]:
        return {name: self._log.growth(name, self._warm_up()) for name in self._log.nodes}

    def report(self) -> str:
        """Return what has come of it for people to read."""
        troubles = ("", *TROUBLES)
        rows = [["meanwhile", *ENDS]]
        for trouble in troubles:
            ends = Counter(each.end for each in self._pursued if each.trouble == trouble)
            rows.append([trouble or "nothing", *(str(ends[end]) for end in ENDS)])
        ends = Counter(each.end for each in self._pursued)
        rows.append(["all", *(str(ends[end]) for end in ENDS)])
        reasons = Counter(each.reason for each in self._pursued if each.reason)
        listed = [f"{count} x {reason}" for reason, count in reasons.most_common()]
        lost = f"{self._frames_lost} frames lost but for floods and clock jumps"
        return "\n".join([
            f"{60.0 * self.hours:.0f} minutes", columns(rows), "", *listed, "",
            self._usage_table(), "", lost, *(f"FELL {text}" for text in self._fallen),
        ])  # fmt: skip

    def _usage_table(self) -> str:
        rows = [["node", "starts", "MiB first", "last", "most", "growth", "files", "threads"]]
        for name, growth in self._growths().items():
            noted = self._log.all_of(name)
            memory = [usage.memory for usage in noted]
            shown = (memory[0], memory[-1], max(memory))
            rows.append([
                name, str(self._log.lives(name)), *(f"{value:.0f}" for value in shown),
                "-" if math.isnan(growth) else f"{100 * growth:+.1f} %",
                f"{noted[0].files} to {max(usage.files for usage in noted)}",
                f"{noted[0].threads} to {max(usage.threads for usage in noted)}",
            ])  # fmt: skip
        return columns(rows)

    def plain(self) -> dict[str, object]:
        """Return all of it for JSON."""
        return {
            "hours": self.hours,
            "goals": [each._asdict() for each in self._pursued],
            "fallen": self._fallen,
            "frames_lost": self._frames_lost,
            "usage": {
                name: [usage._asdict() for usage in self._log.all_of(name)]
                for name in self._log.nodes
            },
        }


def arguments(argv: Sequence[str]) -> argparse.Namespace:
    """Parse the command line without its ROS arguments."""
    parser = argparse.ArgumentParser(prog="soak", description=__doc__)
    parser.add_argument("--hours", type=positive_number, default=8.0, help="default 8")
    parser.add_argument("--mode", choices=tuple(MODES), default="pull")
    parser.add_argument("--seed", type=whole_number(0), default=0, help="of doors and troubles")
    parser.add_argument("--json", type=output_file, help="file to write all measurements to")
    parser.add_argument("--no-view", action="store_true", help="leave out the viewer")
    add_control(parser)
    add_robot_option(parser)
    options = parser.parse_args(
        argv, argparse.Namespace(parameters="perceived", room=False, object="")
    )
    options.viewer = None if options.no_view else {"port": 0}
    return options


def main() -> int:
    """Run the executable ``soak``, which can be interrupted; 1 if something fell."""
    options = arguments(own_arguments())
    with ros_session("soak"):
        soak = Soak(options, Experiment.load())
        try:
            soak.run()
        except KeyboardInterrupt:
            print("interrupted")
        finally:
            print(soak.report(), flush=True)
            if options.json:
                write_json(options.json, soak.plain())
    return 1 if soak.failed() else 0
