# SPDX-License-Identifier: Apache-2.0
"""Quality of service: how long each queue is, and what users override with parameters `qos_overrides.*`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A late subscriber gets the last message."""

EVENT_DEPTH = 1000
"""Messages kept for a reliable subscriber that falls behind: those of 10 s of ticks at 100 Hz."""

KEPT = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
"""Requests all wait, up to what the middleware has room for (5000 in Fast DDS); then their publishers keep them."""

ANSWER_DEPTH = 10_000
"""Answers kept for a subscriber that falls behind: those of 5 s of 2000 requests a second."""

SHOT_DEPTH = 10
"""Of who asks for shots."""

STATE_DEPTH = 10
"""Ticks kept for one."""

TF_DEPTH = 100
"""Of /tf, as tf2 has it."""

MOST_BALLS = 22
"""Of the games in use (snooker): twists are kept for as many, or for the first scene's if it has more."""

MOST_DEPTH = 2**31 - 1
"""What Fast DDS counts to."""

PREFIX = "qos_overrides."
"""Of the parameters; `qos_overrides./balls/states.publisher.reliability` is one."""


def own(qos: QoSProfile | int) -> QoSProfile:
    """A profile that may be changed."""
    return copy(qos) if isinstance(qos, QoSProfile) else QoSProfile(depth=qos)


@contextmanager
def overriding(node: Node, topic: str, end: str) -> Iterator[QoSOverridingOptions]:
    """Options for a new publisher or subscription: the policies that the user's parameters name.

    They become read-only parameters, as in every node that lets its quality of service be overridden.

    Args:
        node: made with `automatically_declare_parameters_from_overrides`.
        topic: as it is passed to the node.
        end: "publisher" or "subscription".

    Raises:
        ValueError: a value that the policy cannot have.
    """
    prefix = f"{PREFIX}{node.resolve_topic_name(topic)}.{end}."
    names = {kind: prefix + kind.name.lower() for kind in QoSPolicyKind if kind != QoSPolicyKind.INVALID}
    given = [kind for kind, name in names.items() if node.has_parameter(name)]
    for kind in given:
        if not node.describe_parameter(names[kind]).read_only:  # made from the override, with any type
            node.undeclare_parameter(names[kind])
    try:
        yield QoSOverridingOptions(given, callback=_check)
    except Exception as error:
        if not given:
            raise
        raise ValueError(f"parameters {prefix}*: {error}") from None


def _check(profile: QoSProfile) -> SetParametersResult:
    # What the middleware would refuse in words of its own.
    if not 0 <= profile.depth <= MOST_DEPTH:
        raise ValueError(f"depth must be from 0 to {MOST_DEPTH}, got {profile.depth}")
    for name in ("deadline", "lifespan", "liveliness_lease_duration"):
        if getattr(profile, name).nanoseconds < 0:
            raise ValueError(f"{name} must be >= 0 ns, got {getattr(profile, name).nanoseconds}")
    return SetParametersResult(successful=True)


def unknown_overrides(node: Node) -> list[str]:
    """Parameters `qos_overrides.*` that the user gave and that no publisher or subscription of the node took."""
    names = [PREFIX + name for name in node.get_parameters_by_prefix(PREFIX.rstrip("."))]
    return [name for name in names if not node.describe_parameter(name).read_only]
