# SPDX-License-Identifier: Apache-2.0
"""Stamps: the node's clock while all balls rest, simulated time from a shot on; and a table that follows /clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from conftest import Site
from geometry_msgs.msg import PoseArray
from process import NOTHING_LOST, Client, Process, positions, stamp_ns
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock

import billiards_sim as bs
from billiards_sim.ros import messages, table_node
from billiards_sim.ros.event_queue import EventQueue
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot

SECOND = 1_000_000_000
MS = 1_000_000
SOFT = wrench_from_shot((1.0, 0.0, 0.0), (0.0, 0.0))
"""A shot of half a second."""


class Wall:
    """A node's clock, moved by hand."""

    def __init__(self) -> None:
        self.now = 1_700_000_000 * SECOND


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> Wall:
    wall = Wall()
    monkeypatch.setattr(TableNode, "_now", lambda _: wall.now)
    return wall


def tick(node: TableNode, wall: Wall, passed: int = 10 * MS) -> int:
    """A tick some ns later; returns its stamp."""
    wall.now += passed
    node._on_beat()
    return node._stamp()


def test_stamps_are_the_clock_while_all_balls_rest(wall: Wall, table: TableNode) -> None:
    for passed in (10 * MS, 7 * MS, 3 * SECOND, 1):
        assert tick(table, wall, passed) == wall.now


def test_stamps_count_simulated_time_from_a_shot_on_and_return_to_the_clock(wall: Wall, table: TableNode) -> None:
    began = tick(table, wall)
    wall.now += 5 * MS
    table._on_cue_shot(SOFT)
    stamps = []
    while not table.simulation.at_rest:
        stamps.append(tick(table, wall, 13 * MS))  # the table is slower than the clock
    *moving, last = stamps
    assert np.abs(np.diff([began, *moving]) - 10 * MS).max() <= 1
    assert last == wall.now > moving[-1] + 100 * MS
    assert tick(table, wall) == wall.now


def test_a_tick_at_rest_has_the_stamp_at_which_it_was_due(
    wall: Wall, table: TableNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table.metronome, "late", lambda: 0.006)
    stamps = [tick(table, wall) for _ in range(3)]
    assert stamps[-1] == wall.now - 6 * MS
    table._on_cue_shot(SOFT)
    monkeypatch.setattr(table.metronome, "late", lambda: 0.0)
    stamps += [tick(table, wall) for _ in range(20)]
    assert np.abs(np.diff(stamps) - 10 * MS).max() <= 1
    assert stamps[-1] <= wall.now  # a shot is not ahead of the clock because the tick before it was late


@pytest.fixture
def event_stamps(table: TableNode, monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, int]]:
    """Time, s, and stamp of each event that is to go out."""
    found: list[tuple[float, int]] = []

    class Queue(EventQueue):
        def add(self, events: Sequence[bs.Event], stamps: messages.Stamps, radius: float) -> None:
            found.extend((event.time, stamps.at(event.time)) for event in events)

    monkeypatch.setattr(table._publisher, "_events", Queue())
    collisions = table._publisher._collisions_publisher
    monkeypatch.setattr("billiards_sim.ros.state_publisher._heard", lambda publisher: publisher is collisions)
    return found


def test_stamps_of_events_are_on_the_scale_of_their_shot(
    wall: Wall, table: TableNode, event_stamps: list[tuple[float, int]]
) -> None:
    began = tick(table, wall)
    at = table.simulation.time
    table._on_cue_shot(SOFT)
    while not table.simulation.at_rest:
        tick(table, wall, 13 * MS)
    assert len(event_stamps) == 3  # shot, rolling, rest
    assert [stamp for _, stamp in event_stamps] == [began + round((time - at) * SECOND) for time, _ in event_stamps]


def test_the_state_at_rest_is_not_stamped_before_the_last_event(
    wall: Wall, table: TableNode, event_stamps: list[tuple[float, int]]
) -> None:
    tick(table, wall)
    table._on_cue_shot(SOFT)
    while not table.simulation.at_rest:
        state = tick(table, wall, 0)  # the clock stands, so it is no lower bound
    _, rest = event_stamps[-1]
    assert rest < state < rest + 11 * MS


@pytest.mark.parametrize("factor", [10.0, 0.5])
def test_stamps_never_go_back(make_node: Callable[..., TableNode], wall: Wall, factor: float) -> None:
    node = make_node("scene:=rack", f"real_time_factor:={factor}")
    node.start()
    stamps = [tick(node, wall)]
    for _ in range(2):
        node._on_cue_shot(SOFT)
        stamps += [tick(node, wall) for _ in range(30)]
    node.reset()
    stamps += [tick(node, wall) for _ in range(3)]
    wall.now -= 5 * SECOND  # somebody sets the machine's clock
    stamps += [tick(node, wall) for _ in range(3)]
    assert min(np.diff(stamps)) > 0  # tf complains of a stamp that comes twice
    assert tick(node, wall, 60 * SECOND) == wall.now


def test_a_table_that_publishes_the_clock_counts_its_own_time(make_node: Callable[..., TableNode], wall: Wall) -> None:
    node = make_node("scene:=rack", "publish_clock:=true", "real_time_factor:=10.0")
    node.start()
    stamps = [tick(node, wall, 1) for _ in range(5)]
    assert set(np.diff(stamps)) == {100 * MS}


def test_a_paused_shot_keeps_its_stamp(wall: Wall, table: TableNode) -> None:
    tick(table, wall)
    table._on_cue_shot(SOFT)
    tick(table, wall)
    stamp = tick(table, wall)
    table._paused = True
    assert [tick(table, wall), tick(table, wall, SECOND)] == [stamp, stamp]
    table._paused = False
    assert tick(table, wall) == pytest.approx(stamp + 10 * MS, abs=1)


def test_a_clock_beyond_the_last_stamp_is_told_and_ends_nothing(
    wall: Wall, table: TableNode, capfd: pytest.CaptureFixture[str]
) -> None:
    wall.now = messages.LAST_STAMP - 15 * MS
    for _ in range(3):
        tick(table, wall)
    assert table._stamp() == messages.LAST_STAMP
    assert capfd.readouterr().err.count("stamps stay at 2147483647.999999999 s, the last that a message can have") == 1
    table._on_cue_shot(SOFT)
    tick(table, wall)
    table._publisher.table(table._stamp())


def test_time_that_a_shot_loses_is_told_where_it_matters(
    wall: Wall, table: TableNode, capfd: pytest.CaptureFixture[str]
) -> None:
    def lose(seconds: float) -> int:
        table.metronome.lost += seconds
        tick(table, wall)
        return capfd.readouterr().err.count("behind the clock")

    assert lose(5.0) == 0  # at rest stamps follow the clock
    table._on_cue_shot(SOFT)
    assert lose(0.6 * table_node.LOST_TIME_TOLD) == 0
    table.metronome.lost += 0.6 * table_node.LOST_TIME_TOLD
    tick(table, wall)
    assert capfd.readouterr().err.count("the table does not keep up: stamps fall 0.12 s behind the clock") == 1
    assert lose(0.6 * table_node.LOST_TIME_TOLD) == 0


def test_ticks_of_a_shot_are_the_same_time_apart(site: Site) -> None:
    site.table("scene:=rack", *NOTHING_LOST)
    client = site.client()
    client.shoot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))
    stamps = client.stamps(50)
    assert np.abs(np.diff(stamps) - 10 * MS).max() <= 1
    now = client.node.get_clock().now().nanoseconds
    assert stamps[-1] <= now  # a table that keeps up is not ahead of the clock


class Simulator:
    """Publishes /clock, as a simulator does."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._publisher = client.node.create_publisher(
            Clock, "/clock", QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
        )
        client.spin_until(lambda: self._publisher.get_subscription_count() > 0)

    def show(self, now: int) -> None:
        """One message, ns."""
        sec, nanosec = divmod(now, SECOND)
        self._publisher.publish(Clock(clock=Time(sec=sec, nanosec=nanosec)))

    def show_and_wait(self, now: int) -> PoseArray:
        """One message, until the tick that it makes due has come; returns its poses."""
        before = len(self._client.poses)
        self.show(now)
        self._client.spin_until(lambda: len(self._client.poses) > before)
        assert len(self._client.poses) == before + 1
        return self._client.poses[-1]


@pytest.fixture
def client(site: Site) -> Iterator[Client]:
    """At a table that follows a clock which is not there yet."""
    one = Client(site.domain)
    yield one
    one.close()


def follow(site: Site, client: Client, *given: str) -> tuple[Process, Simulator]:
    table = site.table("scene:=rack", "use_sim_time:=true", *given)
    simulator = Simulator(client)
    client.spin_until(lambda: client.at_rest and client.cue.get_subscription_count() == 1)
    client.spin_until(lambda: all(one.service_is_ready() for one in (client._reset, client._pause, client._step)))
    # A clock that has just been found may lose its first message.
    client.spin_until(lambda: client.poses or simulator.show(1_000 * SECOND))
    return table, simulator


def test_a_table_follows_a_clock_of_others(site: Site, client: Client) -> None:
    table, simulator = follow(site, client)
    now = 1_000 * SECOND
    assert stamp_ns(client.poses[0].header.stamp) == now  # nothing before the first reading
    for step in (10 * MS, 10 * MS, 5 * SECOND):
        now += step
        assert stamp_ns(simulator.show_and_wait(now).header.stamp) == now

    # A shot, in steps that are not the table's own: the stamps are the clock's, to the rounding of seconds.
    time = client.shoot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))["time"]
    assert time == pytest.approx(5.02, abs=1e-9)
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.advance(time)
    simulation.strike((80.0, 0.0, 0.0))
    for step in (12 * MS, 30 * MS, 118 * MS):
        now += step
        message = simulator.show_and_wait(now)
        assert stamp_ns(message.header.stamp) == pytest.approx(now, abs=2)
        simulation.advance(step / SECOND)
        assert np.abs(np.array(positions(message)) - simulation.positions).max() <= 1e-12

    # Between two multiples of its period it waits; so it does while the clock stands still.
    count = len(client.poses)
    for _ in range(3):
        simulator.show(now + 5 * MS)
    assert client.preview(SOFT)["accepted"] is False  # which is answered all the same
    assert len(client.poses) == count


def test_a_clock_that_jumps_back_puts_the_table_back(site: Site, client: Client) -> None:
    table, simulator = follow(site, client)
    now = 1_000 * SECOND
    client.shoot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))
    for _ in range(5):
        now += 100 * MS
        simulator.show_and_wait(now)
    start = [tuple(row) for row in bs.scenes.rack().positions.tolist()]
    assert positions(client.poses[-1]) != start
    message = simulator.show_and_wait(3 * SECOND)
    assert stamp_ns(message.header.stamp) == 3 * SECOND
    assert positions(message) == start
    table.wait_for("the clock went back by 997.5 s, to 3 s: 16 balls back at the start of scene rack")
    client.spin_until(lambda: client.at_rest == [True, False, True])
    assert client.shoot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))["accepted"]
    assert stamp_ns(simulator.show_and_wait(3 * SECOND + 20 * MS).header.stamp) == pytest.approx(3_020 * MS, abs=2)


def test_the_factor_counts_from_the_clock_that_is_followed(site: Site, client: Client) -> None:
    _, simulator = follow(site, client, "real_time_factor:=4.0")
    assert client.shoot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))["accepted"]
    now = 1_000 * SECOND
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.strike((80.0, 0.0, 0.0))
    for _ in range(3):
        now += 20 * MS
        message = simulator.show_and_wait(now)
        simulation.advance(0.08)
        assert np.abs(np.array(positions(message)) - simulation.positions).max() <= 1e-9


def test_a_running_table_can_be_put_on_another_clock_and_back(site: Site, client: Client) -> None:
    site.table("scene:=rack")
    client.connect()
    wall = stamp_ns(client.poses[-1].header.stamp)
    assert client.set_parameters(use_sim_time=True)[0].successful
    simulator = Simulator(client)
    client.poses.clear()

    def on_the_clock() -> bool:
        simulator.show(7 * SECOND)
        return any(stamp_ns(one.header.stamp) == 7 * SECOND for one in client.poses)

    client.spin_until(on_the_clock)
    client.preview(SOFT)  # nothing is on its way any more
    count = len(client.poses)
    assert stamp_ns(simulator.show_and_wait(8 * SECOND).header.stamp) == 8 * SECOND
    assert len(client.poses) == count + 1
    late = wall + 1_000 * SECOND  # a clock ahead of the wall's must leave no trace
    assert stamp_ns(simulator.show_and_wait(late).header.stamp) == late
    assert client.set_parameters(use_sim_time=False)[0].successful
    client.spin_until(lambda: wall < stamp_ns(client.poses[-1].header.stamp) < late)
