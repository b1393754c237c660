# SPDX-License-Identifier: Apache-2.0
"""Time: counted from the last shot inside, so that what happens does not depend on how long the table has stood."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import billiards_sim as bs

RADIUS = bs.Physics().radius
BREAK = ((128.0, 1.5, 0.0), (0.002, 0.004))
STARTS = [0.0, 0.1, 1e3, 1e6]
"""s, times of the table at which the same shot is made."""


def racked(time: float) -> bs.Simulation:
    """The rack after so long, about to be broken."""
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.advance(time)
    simulation.strike(*BREAK)
    return simulation


def bits(simulation: bs.Simulation) -> bytes:
    return b"".join(
        values.tobytes() for values in (simulation.positions, simulation.velocities, simulation.angular_velocities)
    )


def but_for_time(events: object) -> list[bs.Event]:
    return [replace(event, time=0.0) for event in events]  # type: ignore[attr-defined]


@pytest.mark.parametrize("start", STARTS[1:])
def test_same_shot_gives_the_same_bits_at_any_time_of_the_table(start: float) -> None:
    early, late = racked(0.0), racked(start)
    for duration in (0.0, 0.01, 0.3, 1.0 / 3.0, 2.0):
        events = early.advance(duration)
        later = late.advance(duration)
        assert but_for_time(later) == but_for_time(events)
        assert [event.time for event in later] == [start + event.time for event in events]
        assert bits(late) == bits(early)
        assert late.time == pytest.approx(start + early.time, abs=math.ulp(start + early.time))
    assert but_for_time(late.run()) == but_for_time(early.run()) != []
    assert bits(late) == bits(early)


def test_second_shot_gives_the_same_bits_however_long_the_balls_have_rested() -> None:
    simulation = racked(0.0)
    simulation.run()
    outcomes = []
    for pause in STARTS:
        twin = simulation.copy()
        twin.advance(pause)
        twin.strike((60.0, 20.0, 0.0), (-0.003, 0.001))
        outcomes.append((but_for_time(twin.run()), bits(twin)))
    assert all(outcome == outcomes[0] for outcome in outcomes)


def test_a_shot_while_others_move_is_the_same_at_any_time_of_the_table() -> None:
    outcomes = []
    for start in STARTS:
        simulation = bs.Simulation(bs.Scene([[0.5, 0.6], [2.0, 0.3], [1.2, 0.9]]))
        simulation.advance(start)
        simulation.strike((40.0, 3.0, 0.0))
        events = but_for_time(simulation.advance(0.125))
        simulation.strike((0.0, 50.0, 0.0), (0.001, 0.0), "2")
        assert not simulation.at_rest
        events += but_for_time(simulation.run())
        outcomes.append((events, bits(simulation)))
    assert all(outcome == outcomes[0] for outcome in outcomes)
    assert [event.kind for event in outcomes[0][0]].count("shot") == 2


def test_steps_after_a_late_shot_lose_nothing() -> None:
    # At 1e6 s the time of the table is rounded by 6e-11 s, a tenth of these steps.
    late, early = racked(1e6), racked(0.0)
    for _ in range(1000):
        late.advance(1e-9)
    early.advance(1e-6)
    assert bits(late) == bits(early)
    assert late.time == pytest.approx(1e6 + 1e-6, abs=math.ulp(1e6))


def test_many_steps_after_a_shot_end_where_one_does() -> None:
    steps, one = racked(0.1), racked(0.1)
    for _ in range(1000):
        steps.advance(0.001)
    one.advance(1.0)
    assert steps.time == one.time == 1.1
    assert bits(steps) == bits(one)


@pytest.mark.parametrize("start", STARTS)
def test_events_up_to_a_time_of_the_table_are_those_that_say_so(start: float) -> None:
    # Also where times of the table are rounded: an event has happened at the time that it tells.
    events = list(racked(start).run())
    simulation = racked(start)
    seen: list[bs.Event] = []
    for event in events:
        seen += simulation.run(until=event.time)
        assert simulation.time == event.time
        assert [other.time for other in seen] == [other.time for other in events if other.time <= event.time]
    assert seen == events


@pytest.mark.parametrize("start", STARTS)
def test_clock_stops_where_it_is_told_after_a_shot(start: float) -> None:
    simulation = racked(start)
    assert simulation.time == start
    for until in (start + 0.25, start + 0.7, start + 0.7):
        simulation.run(until=until)
        assert simulation.time == until
    simulation.advance(0.0)
    assert simulation.time == start + 0.7
    assert simulation.run()[-1].time == simulation.time
    end = simulation.time
    simulation.advance(1.5)
    assert simulation.time == end + 1.5


def test_times_are_plain_numbers() -> None:
    simulation = racked(0.1)
    kinds = {type(simulation.time)}
    kinds |= {type(event.time) for event in simulation.advance(0.2)}
    kinds.add(type(simulation.time))
    simulation.run(until=np.float64(0.75))  # type: ignore[arg-type]
    kinds.add(type(simulation.time))
    kinds |= {type(event.time) for event in simulation.run()}
    kinds.add(type(simulation.time))
    assert kinds == {float}


def test_shot_is_told_at_the_time_of_the_table() -> None:
    simulation = racked(0.1)
    simulation.strike((10.0, 0.0, 0.0), ball="3")
    assert [(event.kind, event.time) for event in simulation.advance(0.0)] == [("shot", 0.1)] * 2


def test_balls_that_spin_on_the_spot_turn_through_a_shot_at_another() -> None:
    scene = bs.Scene([[0.5, 0.6], [0.5, 0.9]], None, [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]], track_orientation=True)
    simulation = bs.Simulation(scene)
    simulation.advance(0.5)
    simulation.strike((20.0, 0.0, 0.0))
    simulation.advance(0.25)
    angle = 3.0 * 0.75
    expected = [0.0, 0.0, math.sin(0.5 * angle), math.cos(0.5 * angle)]
    assert simulation.orientations[1] == pytest.approx(expected, abs=1e-14)
    assert simulation.angular_velocities[1].tolist() == [0.0, 0.0, 3.0]
