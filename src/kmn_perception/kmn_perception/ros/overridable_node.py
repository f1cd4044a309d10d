"""Nodes whose users choose the quality of service of each topic, by ``qos_overrides``."""

from __future__ import annotations

from copy import copy
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import (
    InvalidQosOverridesError,
    QoSOverridingOptions,
    _declare_qos_parameters,  # what the options do, for topics that are made later
)
from rclpy.subscription import Subscription

from kmn_perception.configuration.node_parameters import ParameterError


class OverridableNode(Node):
    """A node, all of whose publishers and subscriptions can be overridden, but rclpy's own."""

    def __init__(self, name: str, **options: Any) -> None:
        self._is_made = False
        super().__init__(name, **options)
        self._is_made = True

    def create_publisher(
        self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, **options: Any
    ) -> Publisher:
        """Create a publisher as the user has it, see `overridden`."""
        if self._is_made:
            qos_profile = overridden(self, Publisher, topic, qos_profile)
        return super().create_publisher(msg_type, topic, qos_profile, **options)

    def create_subscription(
        self,
        msg_type: Any,
        topic: str,
        callback: Any,
        qos_profile: QoSProfile | int,
        **options: Any,
    ) -> Subscription:
        """Create a subscription as the user has it, see `overridden`."""
        if self._is_made:
            qos_profile = overridden(self, Subscription, topic, qos_profile)
        return super().create_subscription(msg_type, topic, callback, qos_profile, **options)


def overridden(
    node: Node, kind: type[Publisher] | type[Subscription], topic: str, profile: QoSProfile | int
) -> QoSProfile:
    """Return a quality of service as the user's parameters have it.

    These are ``qos_overrides.TOPIC.publisher.`` (or ``subscription.``) with ``history``, ``depth``
    or ``reliability``, and the topic's full name. They are declared at the first call, which is to
    be in the thread of who constructs the node.

    Parameters
    ----------
    profile
        What it is else; or its depth.

    Raises
    ------
    ParameterError, ParameterException
        If a value is wrong.
    """
    profile = QoSProfile(depth=profile) if isinstance(profile, int) else copy(profile)
    options = QoSOverridingOptions.with_default_policies(callback=_check)
    name = node.resolve_topic_name(topic)
    try:
        _declare_qos_parameters(kind, node, name, profile, options)
    except (InvalidQosOverridesError, RuntimeError) as error:
        raise ParameterError(f"qos_overrides of '{name}': {error}") from error
    return profile


def _check(profile: QoSProfile) -> SetParametersResult:
    return SetParametersResult(
        successful=profile.depth >= 0, reason=f"depth is {profile.depth}, expected 0 or more"
    )
