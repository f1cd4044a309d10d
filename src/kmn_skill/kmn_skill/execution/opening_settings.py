"""The settings of an opening, of which each is a parameter of skill_node."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class OpeningSettings:
    """How long and how often it is tried, and what counts as reached.

    Attributes
    ----------
    door_timeout
        Seconds that a goal waits for parameters to rely on.
    look_distance
        Metres from which the robot looks at a door whose handle it did not see, does not know well
        enough, or has lost; 0 where its camera stands elsewhere and sees no more from there.
    looks, look_nearer
        From how many places it looks at most before each grasp, and at which part of the distance
        of the one before each further one is.
    look_patience
        Seconds for which it looks from a place before it looks from a nearer one.
    look_first
        Whether it looks from there before each grasp.
    memory_age
        Seconds for which a door is remembered beyond the end of the program.
    retreat_distance
        Metres from the door to which a robot draws back that is found at a door it knows nothing
        of, where its camera stands elsewhere.
    look_clearance
        By which all links of the robot keep before the door on the way, metres; who comes nearer is
        at the door.
    retries
        Further attempts after the robot or the door did not follow.
    handle_tolerance, door_tolerance
        By which what unlatches the object, and the object, may miss the goal, m or rad.
    hidden_distance, door_distance
        Metres after which the robot hides the door, so that where it was before is relied upon; and
        by which the hinge of another door that is seen then is further away.
    surroundings, recess
        Whether a ``wall`` stands around the door, and how deep (m) the panel's front lies in it
        where perception does not tell.
    """

    door_timeout: float
    look_distance: float
    looks: int
    look_nearer: float
    look_patience: float
    look_first: bool
    retreat_distance: float
    memory_age: float
    look_clearance: float
    retries: int
    handle_tolerance: float
    door_tolerance: float
    hidden_distance: float
    door_distance: float
    surroundings: str
    recess: float
