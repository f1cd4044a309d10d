"""States of a robot whose joints several publishers tell, each of some of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from sensor_msgs.msg import JointState

from kmn_perception.ros.messages import MessageError
from kmn_perception.ros.stamps import seconds
from kmn_skill.execution.states import Sample

TOGETHER = 0.1  # seconds within which positions of several messages are one state


class SplitStates:
    """Joins what messages tell of some joints.

    Parameters
    ----------
    names
        Of all joints that a state has.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._known: dict[str, tuple[float, float]] = {}  # time and position

    def join(self, message: JointState) -> Sample:
        """Return the newest state, of which a message tells all joints or some.

        Its time is that of the oldest position in it.

        Raises
        ------
        MessageError
            If a number is not finite, or nobody told of a joint just before.
        """
        if len(message.name) != len(message.position):
            raise MessageError(
                "lengths", f"found {len(message.position)} positions of {len(message.name)} joints"
            )
        time = seconds(message.header.stamp)
        places = dict(zip(message.name, message.position, strict=True))
        told = {name: places[name] for name in self._names if name in places}
        if not np.isfinite(list(told.values())).all():
            raise MessageError("not_finite", f"positions are not finite: {told}")
        self._known |= {name: (time, position) for name, position in told.items()}
        fresh = {n: k for n, k in self._known.items() if abs(time - k[0]) <= TOGETHER}
        if missing := [name for name in self._names if name not in fresh]:
            raise MessageError("missing_joints", f"the state lacks the joints {', '.join(missing)}")
        times, positions = np.array([fresh[name] for name in self._names]).T
        return Sample(float(times.min()), positions)
