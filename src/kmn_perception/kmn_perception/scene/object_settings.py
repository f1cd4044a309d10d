"""How objects are told apart and known again, from ``config/objects.yaml``."""

from __future__ import annotations

from typing import NamedTuple

from kmn_perception.configuration import resources
from kmn_perception.configuration.section import Section


class ObjectSettings(NamedTuple):
    """What is known of sensors and objects in general.

    Attributes
    ----------
    border_run
        Pixels at the image's sides that a sensor may not measure at all.
    same_height
        By which the tops of an object's parts may differ, metres.
    top
        Quantile of the points' heights that counts as their top.
    memory
        Frames for which an object that is not seen keeps its number.
    """

    border_run: int
    same_height: float
    top: float
    memory: int

    @classmethod
    def load(cls) -> ObjectSettings:
        """Read ``config/objects.yaml``."""
        section = Section.load(resources.find("config", "objects"))
        section.allow(cls._fields)
        return cls(
            border_run=section.whole_number("border_run", 0, 1000),
            same_height=section.number("same_height", 0.0),
            top=section.number("top", 0.0, 1.0),
            memory=section.whole_number("memory", 0, 10**6),
        )
