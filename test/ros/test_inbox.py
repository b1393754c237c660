# SPDX-License-Identifier: Apache-2.0
"""Requests that come faster than they are handled."""

import time
from collections.abc import Iterator

import pytest
import rclpy
from geometry_msgs.msg import WrenchStamped
from process import TIMEOUT
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node

from billiards_sim.ros import table_node
from billiards_sim.ros.inbox import MOST_AT_ONCE
from billiards_sim.ros.table_node import TableNode

COUNT = 3000
"""More than the queue of 1000 that drops the oldest, less than Fast DDS's room for what must not be dropped."""


@pytest.fixture
def player(table: TableNode) -> Iterator[Node]:
    context = rclpy.Context()
    rclpy.init(context=context)
    node = rclpy.create_node("player", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def test_nothing_is_dropped_and_the_executor_waits_once_for_many(
    table: TableNode, player: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    refused: list[int] = []
    monkeypatch.setattr(table_node, "answer", lambda _, request, time, why: refused.append(request.header.stamp.sec))
    cue = player.create_publisher(WrenchStamped, "cue_shot", COUNT)
    deadline = time.monotonic() + TIMEOUT
    while cue.get_subscription_count() == 0:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    for number in range(COUNT):
        message = WrenchStamped()  # without a force
        message.header.stamp.sec = number
        cue.publish(message)
    cue.wait_for_all_acked()

    executor = SingleThreadedExecutor()
    executor.add_node(table)
    turns = 0
    while len(refused) < COUNT:
        assert time.monotonic() < deadline, len(refused)
        executor.spin_once(timeout_sec=0.1)
        turns += 1
    assert refused == list(range(COUNT))
    assert turns <= 2 * COUNT / MOST_AT_ONCE  # some are for the discovery
