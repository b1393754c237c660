# SPDX-License-Identifier: Apache-2.0
"""Events on their way out: in order, in messages that a tick can carry, and not without bound."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import billiards_sim as bs
from billiards_sim.ros import event_queue
from billiards_sim.ros.event_queue import EventQueue
from billiards_sim.ros.messages import Stamps

RADIUS = 0.03


def some(count: int, start: int = 0) -> list[bs.Event]:
    """Events whose impulses number them from `start` on."""
    return [
        bs.Event(0.5, "ball_rail", ("cue",), "x_max", (2.3, 0.4), (-1.0, 0.0), 1.0, float(start + index))
        for index in range(count)
    ]


@pytest.fixture
def queue(monkeypatch: pytest.MonkeyPatch) -> EventQueue:
    """At most 3 events a message and 12 that wait."""
    monkeypatch.setattr(event_queue, "EVENTS_A_TICK", 3)
    monkeypatch.setattr(event_queue, "MOST_WAITING", 12)
    return EventQueue()


def messages(queue: EventQueue) -> Iterator[tuple[int, list[float]]]:
    """Number and impulses of each message until nothing waits."""
    while len(queue):
        message = queue.take()
        assert message["version"] == 2
        yield message["sequence"], [event["impulse"] for event in message["events"]]


def test_a_message_takes_the_events_of_several_ticks_and_leaves_what_is_too_much(queue: EventQueue) -> None:
    for start, count in ((0, 2), (2, 5), (7, 1)):
        queue.add(some(count, start), Stamps(0), RADIUS)
    assert len(queue) == 8
    assert list(messages(queue)) == [(1, [0, 1, 2]), (2, [3, 4, 5]), (3, [6, 7])]


def test_each_event_has_the_stamp_of_its_own_time(queue: EventQueue) -> None:
    queue.add(some(1), Stamps(7_000_000_000), RADIUS)
    queue.add(some(1), Stamps(9_000_000_000), RADIUS)
    stamps = [event["stamp"] for event in queue.take()["events"]]
    assert stamps == [{"sec": 7, "nanosec": 500_000_000}, {"sec": 9, "nanosec": 500_000_000}]


def test_what_cannot_wait_is_dropped_from_the_front_and_counted(queue: EventQueue) -> None:
    queue.add(some(2), Stamps(0), RADIUS)
    assert list(messages(queue)) == [(1, [0, 1])]
    queue.add(some(10, 2), Stamps(0), RADIUS)
    assert (len(queue), queue.dropped) == (10, 0)
    queue.add(some(6, 12), Stamps(0), RADIUS)  # 4 too many: two messages
    assert (len(queue), queue.dropped) == (10, 6)
    assert list(messages(queue)) == [(4, [8, 9, 10]), (5, [11, 12, 13]), (6, [14, 15, 16]), (7, [17])]


def test_a_flood_in_one_tick_leaves_the_last_events(queue: EventQueue) -> None:
    queue.add(some(1_000), Stamps(0), RADIUS)
    assert queue.dropped == 990  # 330 messages
    assert [number for number, _ in messages(queue)] == [331, 332, 333, 334]


def test_events_of_the_engine_are_cut_as_lists_are() -> None:
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.strike((125.0, 6.0, 0.0))
    events = simulation.run()
    queue = EventQueue()
    queue.add(events[:7], Stamps(0), RADIUS)
    queue.add(events[7:], Stamps(0), RADIUS)
    taken = [event["time"] for event in queue.take()["events"]]
    assert taken == [event.time for event in events]
