# SPDX-License-Identifier: Apache-2.0
"""What comes in: nothing is dropped, and all that has come is taken at once.

An rclpy executor takes one message, and then waits anew for each of the node's entities, which costs three times what
the table does with a shot. A queue of a fixed length drops the oldest messages without a word where that is too slow.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from rclpy.node import Node

from billiards_sim.ros.qos import KEPT

MOST_AT_ONCE = 100
"""Messages of one topic until the others have their turn: some 10 ms."""

PAUSE = 0.005
"""s. A message that comes sooner than that after the last is one of a stream: the next are waited for, this long."""


class Inbox:
    """A subscription that calls `handle` with each message, in the order of their coming."""

    def __init__(self, node: Node, kind: Any, topic: str, handle: Callable[[Any], object]) -> None:
        self._kind = kind
        self._handle = handle
        self._emptied = -PAUSE  # s of the steady clock, the last time
        self._subscription = node.create_subscription(kind, topic, self._take, KEPT)

    def _take(self, message: Any) -> None:
        if time.monotonic() - self._emptied < PAUSE:
            time.sleep(PAUSE)
        self._handle(message)
        for _ in range(MOST_AT_ONCE - 1):
            taken = self._subscription.handle.take_message(self._kind, False)  # as the executor does
            if taken is None:
                self._emptied = time.monotonic()
                return
            self._handle(taken[0])
