# SPDX-License-Identifier: Apache-2.0
"""Corners, rails, tiny and huge speeds, restitution 0 and 1, and runs of a million collisions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from checks import AT_X_MAX, AT_Y_MAX, COMPILED, RADIUS, ROLLING, SLIDING, TABLE, extremes

import billiards_sim as bs

ICE = bs.Physics(sliding_friction=0.0, rolling_friction=0.0, rail_restitution=1.0)


def test_both_rails_of_a_corner_at_the_same_instant() -> None:
    physics = bs.Physics(sliding_friction=0.0)
    simulation = bs.Simulation(bs.Scene([[AT_X_MAX - 0.25, AT_Y_MAX - 0.25]], [[2.0, 2.0]], physics=physics))
    events = simulation.run(until=0.2)
    assert [event.rail for event in events] == ["x_max", "y_max"]
    assert [event.time for event in events] == pytest.approx([0.125, 0.125], abs=1e-15)
    assert simulation.velocities[0] == pytest.approx([-1.4, -1.4], rel=1e-15)


@pytest.mark.parametrize("vy", [0.5, -0.5])
def test_ball_frozen_to_a_rail_rolls_along_it(vy: float) -> None:
    simulation = bs.Simulation(bs.Scene([[AT_X_MAX, 0.6]], [[0.0, vy]], [[-vy / RADIUS, 0.0, 0.0]]))
    events = simulation.run(until=1.0)
    assert [event.kind for event in events] == []
    way = math.copysign(abs(vy) - 0.5 * ROLLING, vy)
    assert simulation.positions[0] == pytest.approx([AT_X_MAX, 0.6 + way], abs=1e-14)


def test_ball_frozen_to_a_rail_and_pushed_into_it_bounces_off() -> None:
    simulation = bs.Simulation(bs.Scene([[AT_X_MAX, 0.6]], [[1.0, 0.3]]))
    event = simulation.advance(1e-12)[0]
    assert (event.kind, event.rail, event.time) == ("ball_rail", "x_max", 0.0)
    assert simulation.velocities[0] == pytest.approx([-0.7, 0.3], abs=1e-9)


@pytest.mark.parametrize("away", [0.0, 1.0])
def test_ball_that_starts_on_a_rail_and_leaves_it_meets_it_no_more(away: float) -> None:
    simulation = bs.Simulation(bs.Scene([[TABLE.x_min + RADIUS, 0.6]], [[away, 0.2]]))
    assert all(event.kind != "ball_rail" for event in simulation.run(until=0.5))


@pytest.mark.parametrize("speed", [1e-9, 1e-6, 1e-3, 1.0, 100.0])
def test_lone_ball_stops_where_the_closed_form_says_at_any_speed(speed: float) -> None:
    # Without spin: slides 12/49 v^2/(mu_s g), then rolls from 5/7 v.
    length = 4.0 * speed * speed / ROLLING + 1.0
    table = bs.Table(length=min(length, 10_000.0), width=1.17)
    simulation = bs.Simulation(bs.Scene([[0.1, 0.6]], [[speed, 0.0]], table=table))
    events = simulation.run(until=2.0 * speed / 7.0 / SLIDING)
    slid = 12.0 / 49.0 * speed * speed / SLIDING
    assert simulation.positions[0, 0] - 0.1 == pytest.approx(slid, rel=1e-9, abs=1e-16)
    if speed < 100.0:  # at which it would come to the far rail
        simulation.run()
        way = slid + (5.0 / 7.0 * speed) ** 2 / (2.0 * ROLLING)
        assert simulation.at_rest
        assert simulation.positions[0, 0] - 0.1 == pytest.approx(way, rel=1e-9, abs=1e-16)
    assert len(events) <= 1


@pytest.mark.parametrize("speed", [1e-9, 1e-6, 1e-3, 1.0, 100.0])
def test_touching_balls_hand_on_any_speed(speed: float) -> None:
    scene = bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS, 0.6]], [[speed, 0.0], [0.0, 0.0]], physics=ICE)
    simulation = bs.Simulation(scene)
    events = simulation.run(until=1e-3)
    assert events[0].approach_speed == pytest.approx(speed, rel=1e-6)
    assert simulation.velocities == pytest.approx(np.array([[0.0, 0.0], [speed, 0.0]]), abs=1e-9 * speed)


@pytest.mark.parametrize("spin", [[0.0, 1e4, 0.0], [-1e4, 1e4, 1e4], [0.0, 0.0, 1e4]])
@pytest.mark.parametrize("speed", [0.0, 1e-9, 3.0, 100.0])
def test_laws_hold_at_any_spin_and_speed(spin: list[float], speed: float) -> None:
    worst = extremes(
        bs.Scene([[1.0, 0.6], [1.5, 0.62], [2.3, 1.1]], [[speed, 0.0], [0.0, 0.0], [0.0, -speed]], [spin] * 3)
    )
    assert worst.overlap <= 1e-9
    assert worst.outside <= 1e-9
    assert worst.energy_rise <= 1e-12


@pytest.mark.parametrize("restitution", [0.0, 1.0])
def test_laws_hold_at_any_restitution(restitution: float) -> None:
    base = bs.scenes.rack()
    scene = bs.Scene(base.positions, physics=bs.Physics(rail_restitution=restitution))
    worst = extremes(scene, lambda simulation: simulation.strike((128.0, 2.0, 0.0), (0.004, -0.006)))
    assert worst.overlap <= 1e-9
    assert worst.outside <= 1e-9
    assert worst.energy_rise <= 1e-12


def test_a_rail_that_gives_nothing_back_keeps_the_ball() -> None:
    physics = bs.Physics(rail_restitution=0.0)
    simulation = bs.Simulation(bs.Scene([[2.0, 0.6]], [[3.0, 0.4]], physics=physics))
    simulation.run()
    assert simulation.positions[0, 0] == pytest.approx(AT_X_MAX, abs=1e-9)
    assert simulation.positions[0, 1] > 0.61


@pytest.mark.parametrize("friction", ["sliding_friction", "rolling_friction"])
def test_cloth_without_one_friction_keeps_what_it_should(friction: str) -> None:
    physics = bs.Physics(**{friction: 0.0})
    simulation = bs.Simulation(bs.Scene([[1.0, 0.6]], [[0.7, 0.0]], physics=physics))
    simulation.run(until=1.0)
    expected = 0.7 if friction == "sliding_friction" else 0.5
    assert simulation.velocities[0, 0] == pytest.approx(expected, rel=1e-14)


def test_million_tiny_steps_end_on_the_bits_of_one() -> None:
    count = 1_000_000 if COMPILED else 20_000
    scene = bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS + 5e-7, 0.6]], [[5.0, 0.1], [0.0, 0.0]])
    steps, one = bs.Simulation(scene), bs.Simulation(scene)
    collected = []
    for _ in range(count):
        events = steps.advance(1e-9)
        if len(events):
            collected.extend(events)
    assert collected == list(one.advance(1e-9 * count)) != []
    assert steps.time == one.time
    assert np.array_equal(steps.positions, one.positions)
    assert np.array_equal(steps.velocities, one.velocities)


def test_million_seconds_of_rest_and_of_motion() -> None:
    resting = bs.Simulation(bs.scenes.rack())
    resting.advance(1e6)
    assert np.array_equal(resting.positions, bs.Simulation(bs.scenes.rack()).positions)
    moving = bs.Simulation(bs.Scene([[1.0, 0.6]], [[1.0, 0.3]], physics=ICE))
    seconds = 1e6 if COMPILED else 1e4
    events = moving.advance(seconds)
    crossings = (seconds * np.array([1.0, 0.3])) / (np.array([TABLE.length, TABLE.width]) - 2.0 * RADIUS)
    assert len(events) == pytest.approx(crossings.sum(), abs=2.0)
    assert moving.time == seconds
    assert np.abs(moving.velocities[0]) == pytest.approx([1.0, 0.3], rel=1e-12)


def test_million_collisions_keep_the_energy() -> None:
    base = bs.scenes.random_balls(20, seed=4)
    simulation = bs.Simulation(bs.Scene(base.positions, base.velocities, physics=ICE))
    start = simulation.kinetic_energy
    collisions = 0
    wanted = 1_000_000 if COMPILED else 3_000
    while collisions < wanted:
        collisions += len(simulation.advance(100.0 if COMPILED else 1.0))
    assert simulation.kinetic_energy == pytest.approx(start, rel=1e-10)
    positions = simulation.positions
    one, other = np.triu_indices(20, 1)
    assert np.hypot(*(positions[one] - positions[other]).T).min() >= 2.0 * RADIUS - 1e-12


def test_reversed_velocities_lead_back_to_the_start() -> None:
    # Backwards, rounding grows as it does forwards: by as much as the run spreads two starts 1e-12 m apart.
    base = bs.scenes.random_balls(20, seed=7)
    scene = bs.Scene(base.positions, base.velocities, physics=ICE)
    duration = 0.5
    there = bs.Simulation(scene)
    events = there.run(until=duration)
    assert sum(event.kind == "ball_ball" for event in events) > 20
    nudge = np.zeros((20, 2))
    nudge[:, 0] = 1e-12 * (-1.0) ** np.arange(20)
    beside = bs.Simulation(bs.Scene(base.positions + nudge, base.velocities, physics=ICE))
    beside.run(until=duration)
    growth = np.abs(beside.positions - there.positions).max() / 1e-12
    back = bs.Simulation(bs.Scene(there.positions, -there.velocities, physics=ICE))
    back.run(until=duration)
    rounding = 4e-16  # m, of a position
    assert np.abs(back.positions - base.positions).max() <= 10.0 * rounding * growth < 1e-6
    assert back.velocities == pytest.approx(-base.velocities, abs=1e-3)
