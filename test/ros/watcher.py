# SPDX-License-Identifier: Apache-2.0
"""A subscriber with the habitual queue of 10, which takes what its queues hold when it looks."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

DEPTH = 10

LATCHED = QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)

PERIOD = 1.0 / 30.0
"""s between two looks of one who looks 30 times a second."""

TIMEOUT = 20.0
"""s"""

IDLE = 3
"""Calls of the executor in a row that bring nothing, after which the queues are empty: it may see to other things."""


class Watcher:
    """Hears states, events, verdicts and rest, and shoots.

    Attributes:
        collisions: messages.
        longest: s from the begin of a look to that of the next, at most; whoever looks too late loses messages.
    """

    def __init__(self, domain: int | None = None) -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("watcher", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._taken = 0
        self._looked = time.monotonic()
        self.longest = 0.0
        self.collisions: list[dict[str, Any]] = []
        self.states: list[MultiDOFJointState] = []
        self.verdicts: list[dict[str, Any]] = []
        self.rests: list[bool] = []
        # What comes last is known to come where the table announces what is latched.
        self._subscribe(String, "collisions", lambda message: self.collisions.append(json.loads(message.data)))
        self._subscribe(String, "shot_result", lambda message: self.verdicts.append(json.loads(message.data)))
        self._subscribe(MultiDOFJointState, "balls/states", self.states.append)
        self._subscribe(Bool, "at_rest", lambda message: self.rests.append(message.data), LATCHED)
        self._cue = self._node.create_publisher(WrenchStamped, "cue_shot", DEPTH)
        self._reset = self._node.create_client(Trigger, "table/reset")

    @property
    def events(self) -> list[dict[str, Any]]:
        """Of all messages."""
        return [event for message in self.collisions for event in message["events"]]

    @property
    def sequence(self) -> list[int]:
        """Numbers of the messages."""
        return [message["sequence"] for message in self.collisions]

    def connect(self) -> None:
        """Wait until this hears the table and the table hears this."""
        self.look_until(lambda: self.states and self.rests and self._cue.get_subscription_count() == 1)
        self.look_until(self._reset.service_is_ready)
        self.longest = 0.0

    def shoot(self, shot: WrenchStamped) -> None:
        self._cue.publish(shot)

    def play(self, shot: WrenchStamped) -> None:
        """Shoot, and look 30 times a second until every ball rests."""
        verdicts, rests = len(self.verdicts), len(self.rests)
        self.shoot(shot)
        self.look_until(lambda: len(self.verdicts) > verdicts and len(self.rests) >= rests + 2 and self.rests[-1])

    def reset(self) -> None:
        """Back to the start of the scene."""
        future = self._reset.call_async(Trigger.Request())
        self.look_until(future.done)

    def look(self) -> None:
        """Take what is there."""
        now = time.monotonic()
        self.longest = max(self.longest, now - self._looked)
        self._looked = now
        idle = 0
        while idle < IDLE:
            before = self._taken
            self._executor.spin_once(timeout_sec=0.0)
            idle = idle + 1 if self._taken == before else 0

    def look_until(self, done: Callable[[], object], timeout: float = TIMEOUT) -> None:
        """Look 30 times a second.

        Raises:
            TimeoutError: it is not done in time.
        """
        deadline = time.monotonic() + timeout
        while not done():
            if time.monotonic() > deadline:
                raise TimeoutError(f"not within {timeout:g} s")
            time.sleep(max(self._looked + PERIOD - time.monotonic(), 0.0))
            self.look()

    def close(self) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def _subscribe(self, kind: type, topic: str, keep: Callable[[Any], object], qos: QoSProfile | int = DEPTH) -> None:
        def take(message: Any) -> None:
            self._taken += 1
            keep(message)

        self._node.create_subscription(kind, topic, take, qos)
