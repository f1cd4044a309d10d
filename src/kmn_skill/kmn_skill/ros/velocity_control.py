"""Drives a base along its share of a plan by velocities."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
from geometry_msgs.msg import Twist, TwistStamped
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import Header

from kmn_perception.configuration.robot_parts import ControllerSettings
from kmn_perception.ros.stamps import stamp_of
from kmn_skill.execution.base_motion import BaseOdometry, BaseTracking, TrackingSettings
from kmn_skill.execution.plan_execution import Part
from kmn_skill.ros import messages

QUEUE_DEPTH = 10


class VelocityControl:
    """Tracks a plan at a steady rate of the node's clock; what it stops, it stops by zeros.

    Parameters
    ----------
    controller
        Topic and kind of its messages.
    speeds
        (3,) largest velocities, m/s and rad/s.
    odometry
        Tells where the base is.
    rate
        Velocities a second.
    settings
        Returns how closely it follows.
    now
        Returns the time of the node's clock, seconds.
    """

    def __init__(
        self,
        node: Node,
        controller: ControllerSettings,
        speeds: NDArray[np.float64],
        odometry: BaseOdometry,
        rate: float,
        settings: Callable[[], TrackingSettings],
        now: Callable[[], float],
    ) -> None:
        self._topic, self._stamped = controller.name, controller.stamped
        self._speeds, self._odometry = speeds, odometry
        self._settings, self._now = settings, now
        kind = TwistStamped if self._stamped else Twist
        self._publisher = node.create_publisher(kind, self._topic, QUEUE_DEPTH)
        self._lock = threading.Lock()  # nothing may be published after what stops the base
        self._tracking: BaseTracking | None = None
        self._end, self._failure = 0.0, ""
        node.create_timer(1.0 / rate, self._drive)

    def is_ready(self) -> bool:
        """Tell whether somebody listens."""
        return bool(self._publisher.get_subscription_count())

    def send(self, share: Part) -> None:
        """Follow the base's share of a plan from now on."""
        with self._lock:
            self._tracking = BaseTracking(share, self._speeds, self._settings())
            self._end, self._failure = self._tracking.end, ""

    def hold(self) -> None:
        """Stop the base."""
        with self._lock:
            self._stop()
            self._failure = ""

    def fault(self, timeout: float) -> str:
        """Return why it is not waited for any more; empty if it is.

        Parameters
        ----------
        timeout
            By how many seconds it may be late.
        """
        if self._failure or self._tracking is None:
            return self._failure
        if not self.is_ready():
            return f"is not there: nobody listens to '{self._topic}'"
        late = self._now() - self._end
        return f"is not through {late:.1f} s after it should be" if late > timeout else ""

    def is_through(self) -> bool:
        """Tell whether the base is where it was sent."""
        return self._tracking is None

    def _drive(self) -> None:
        with self._lock:
            tracking = self._tracking
            if tracking is None:
                return
            now, motion = self._now(), self._odometry.newest
            self._failure = self._odometry.fault(now, self._settings().odometry_timeout)
            if self._failure:
                self._failure = f"was stopped: {self._failure}"
            if self._failure or motion is None or tracking.is_through(now, motion):
                self._stop()
            else:
                self._publish(tracking.velocity(now, motion))

    def _stop(self) -> None:
        self._tracking = None
        self._publish(np.zeros(3))

    def _publish(self, velocity: NDArray[np.float64]) -> None:
        twist = messages.twist(velocity)
        if not self._stamped:
            self._publisher.publish(twist)
            return
        motion = self._odometry.newest
        header = Header(stamp=stamp_of(self._now()), frame_id=motion.frame if motion else "")
        self._publisher.publish(TwistStamped(header=header, twist=twist))
