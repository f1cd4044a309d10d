"""Subscriptions to a camera, each as reliable as what it is published with."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from kmn_perception.ros.overridable_node import overridden

PERIOD = 0.5  # seconds between two looks at who publishes
DEPTH = 5  # messages that wait: those that are sent again come in bursts


@dataclass(eq=False)
class CameraSubscription:
    """A subscription, and how it is made anew."""

    kind: Any
    topic: str
    callback: Callable[..., None]
    profile: QoSProfile
    made: Subscription


class CameraSubscriptions:
    """Makes subscriptions that lose nothing of what comes, if they can.

    A cloud that fits no buffer on its way arrives where both sides are reliable, and who asks for
    more than is offered receives nothing: ``best_available`` is reliable where all publishers of
    the topic are, and best effort else. DDS decides so when a subscription is made; here it is made
    anew when other publishers come.

    Parameters
    ----------
    node, reliability
        Who subscribes, and how; ``qos_overrides`` of a topic go before it.
    """

    def __init__(self, node: Node, reliability: ReliabilityPolicy) -> None:
        self._node, self._wanted = node, QoSProfile(depth=DEPTH, reliability=reliability)
        self._subscribed: list[CameraSubscription] = []  # perhaps several to one topic
        # A steady clock: a simulated time may not have begun.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        node.create_timer(PERIOD, self._adapt, clock=steady)

    def declare(self, topic: str) -> QoSProfile:
        """Return how a topic is subscribed to; declare the parameters by which users choose it."""
        return overridden(self._node, Subscription, topic, self._wanted)

    def subscribe(self, kind: Any, topic: str, callback: Callable[..., None]) -> CameraSubscription:
        """Subscribe to a topic, until `end`."""
        name, profile = self._node.resolve_topic_name(topic), self.declare(topic)
        made = self._make(kind, name, callback, self._available(name, profile))
        self._subscribed.append(CameraSubscription(kind, name, callback, profile, made))
        return self._subscribed[-1]

    def end(self, subscription: CameraSubscription) -> None:
        """End a subscription."""
        self._subscribed.remove(subscription)
        self._node.destroy_subscription(subscription.made)

    def _adapt(self) -> None:
        """Make those anew whose publishers offer something else than they did."""
        for each in self._subscribed:
            before = each.made.qos_profile
            profile = self._available(each.topic, each.profile, before.reliability)
            if profile.reliability != before.reliability:
                self._node.destroy_subscription(each.made)
                each.made = self._make(each.kind, each.topic, each.callback, profile)

    def _make(
        self, kind: Any, name: str, callback: Callable[..., None], profile: QoSProfile
    ) -> Subscription:
        # Not as OverridableNode has it: parameters of the topic are declared already.
        return Node.create_subscription(self._node, kind, name, callback, profile)

    def _available(
        self,
        name: str,
        profile: QoSProfile,
        before: ReliabilityPolicy = ReliabilityPolicy.BEST_EFFORT,
    ) -> QoSProfile:
        """Return the most reliable profile with which all publishers of a topic are heard.

        Parameters
        ----------
        before
            What it is where nobody publishes.
        """
        if profile.reliability is not ReliabilityPolicy.BEST_AVAILABLE:
            return profile
        offered = {
            info.qos_profile.reliability for info in self._node.get_publishers_info_by_topic(name)
        }
        is_reliable = offered == {ReliabilityPolicy.RELIABLE}
        chosen = ReliabilityPolicy.RELIABLE if is_reliable else ReliabilityPolicy.BEST_EFFORT
        available = copy(profile)
        available.reliability = chosen if offered else before
        return available
