"""Which of an object's actions a program is for."""

from __future__ import annotations

import argparse

from kmn_perception.configuration.section import ConfigurationError
from kmn_perception.model.kinematic_model import KinematicModel


def add_action_option(parser: argparse.ArgumentParser) -> None:
    """Let a program be told the action."""
    parser.add_argument(
        "--action", default="", help="name of one of the object's actions; default the first"
    )


def chosen_action(model: KinematicModel, name: str) -> KinematicModel:
    """Return the object with one action alone, or as it is where none is named.

    Raises
    ------
    ConfigurationError
        If it has no such action.
    """
    names = [action.name for action in model.actions]
    if not name:
        return model
    if name not in names:
        raise ConfigurationError(
            f"model '{model.name}' has no action '{name}', expected {' or '.join(names)}"
        )
    return model.doing(names.index(name))
