"""The table of killed nodes tells which goal after a kill did not open the door, and why."""

from __future__ import annotations

from kmn_skill.experiments.kill_nodes import NODES, Kill, arguments, table

OPENED = Kill("skill_node", "press", 0.754, True, "")
REFUSED = Kill("morph_node", "wait", 0.0, False, "no morphing parameters came yet")
SHUT = Kill("sim_node", "open", 0.9, False, "")


def test_each_kill_is_told_with_its_moment_and_what_followed() -> None:
    lines = table([OPENED, REFUSED, SHUT]).splitlines()
    assert lines[1].split() == ["skill_node", "press", "75", "%", "opened"]
    assert lines[2].split(maxsplit=4)[4] == REFUSED.reason
    assert lines[3].endswith("not open in the physics")
    assert lines[-1] == "1 of 3 opened"


def test_without_arguments_all_nodes_are_killed_several_times() -> None:
    options = arguments([])
    assert options.kills == 20 >= 2 * len(NODES)
    assert (options.parameters, options.room) == ("perceived", False)
