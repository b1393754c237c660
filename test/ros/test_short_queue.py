# SPDX-License-Identifier: Apache-2.0
"""A subscriber with the habitual queue of 10 that looks every third tick, as one at 30 Hz does, misses no event."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from conftest import Site
from watcher import DEPTH, Watcher

import billiards_sim as bs
from billiards_sim.ros.wrench import wrench_from_shot

TICKS_A_LOOK = 3
FORCE, OFFSET = (125.0, 6.0, 0.0), (0.004, -0.002)


@pytest.fixture
def watcher(site: Site) -> Iterator[Watcher]:
    """At a table that is paused: time goes on by steps alone."""
    site.table("scene:=rack", "real_time_factor:=10.0")
    watcher = Watcher(site.domain)
    watcher.connect()
    yield watcher
    watcher.close()


def test_no_event_of_a_break_is_missed_and_each_state_is_whole(site: Site, watcher: Watcher) -> None:
    client = site.client()
    client.pause(True)
    watcher.look_until(lambda: watcher.states)
    time = client.shoot(wrench_from_shot(FORCE, OFFSET))["time"]
    watcher.look()
    steps = 0
    while len(client.at_rest) < 3:  # at rest, in motion, at rest
        for _ in range(TICKS_A_LOOK):
            client.step()
        watcher.look()
        steps += 1
        assert steps < 200

    simulation = bs.Simulation(bs.scenes.rack())
    simulation.advance(time)
    simulation.strike(FORCE, OFFSET)
    events = simulation.run()
    watcher.look_until(lambda: len(watcher.events) >= len(events))
    assert [(event["kind"], event["balls"]) for event in watcher.events] == [(e.kind, list(e.balls)) for e in events]
    assert watcher.sequence == list(range(1, 1 + len(watcher.collisions)))
    assert max(len(message["events"]) for message in watcher.collisions) > DEPTH  # of one tick
    names = list(bs.scenes.rack().names)
    assert all(message.joint_names == names and len(message.twist) == 16 for message in watcher.states)
    assert any(twist.linear.x != 0.0 for message in watcher.states for twist in message.twist)
