# SPDX-License-Identifier: Apache-2.0
"""Elastic bounces under a push, which would go on for as long as it lasts: they end, and nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest
from checks import AT_X_MAX, COMPILED, RADIUS, SLIDING
from provoke import frozen_row, provoking_scene, ring, square, topspin, towards

import billiards_sim as bs
from billiards_sim.engine.tables import get_field

MOST_EVENTS = 20_000

CENTRE = np.array([1.2, 0.6])


def inward(places: np.ndarray, spin: float, speed: float = 0.0) -> bs.Scene:
    """Balls around the centre of the table with topspin, and speed, towards their own."""
    directions = towards(places, places.mean(axis=0))
    return bs.Scene(places - places.mean(axis=0) + CENTRE, speed * directions, topspin(directions, spin))


ENDLESS = {
    "4 x 4 lattice, 1e-9 m apart": inward(square(4, 4, 2.0 * RADIUS + 1e-9), 200.0),
    "3 x 3 lattice, 1 000 rad/s": inward(square(3, 3, 2.0 * RADIUS + 1e-9), 1000.0),
    "ring of six, 1e-13 m apart": inward(ring(6, 2.0 * RADIUS + 1e-13), 450.0, 3e-6),
    "two balls, 1e-11 m apart": inward(square(2, 1, 2.0 * RADIUS + 1e-11), 450.0),
    "one ball at an elastic rail": bs.Scene(
        [[AT_X_MAX, 0.6]], [[5e-6, 0.0]], [[0.0, 1000.0, 0.0]], physics=bs.Physics(rail_restitution=1.0)
    ),
}


@pytest.mark.parametrize("name", ENDLESS)
def test_elastic_bounces_of_pressed_balls_end(name: str) -> None:
    simulation = bs.Simulation(ENDLESS[name])
    assert len(simulation.run()) <= MOST_EVENTS
    assert simulation.at_rest


@pytest.mark.parametrize("first", range(0, 200 if COMPILED else 20, 20))
def test_scenes_built_to_provoke_come_to_rest_in_few_events(first: int) -> None:
    for seed in range(first, first + 20):
        simulation = bs.Simulation(provoking_scene(seed))
        assert len(simulation.run()) <= MOST_EVENTS, seed
        assert simulation.at_rest, seed


def test_ball_pressed_to_an_elastic_rail_uses_up_its_spin_there() -> None:
    # Whether it bounces or stays, its slip ends after R w/(5/2 mu_s g) but for what the bounces carry.
    spin = 1000.0
    simulation = bs.Simulation(ENDLESS["one ball at an elastic rail"])
    events = simulation.run()
    rolling = next(event for event in events if event.kind in ("rolling", "rest"))
    assert rolling.time == pytest.approx((5e-6 + RADIUS * spin) / (2.5 * SLIDING), abs=1e-4)
    assert simulation.positions[0, 0] == pytest.approx(AT_X_MAX, abs=1e-6)


def test_result_does_not_depend_on_how_time_is_cut() -> None:
    scene = ENDLESS["one ball at an elastic rail"]
    whole, pieces = bs.Simulation(scene), bs.Simulation(scene)
    events = list(whole.run(until=6.0))
    assert [event for _ in range(60) for event in pieces.advance(0.1)] == events
    assert np.array_equal(whole.positions, pieces.positions)


@pytest.mark.parametrize("bounces", [30, 45])
def test_bounces_that_have_not_been_many_are_elastic(bounces: int) -> None:
    # A sliding ball that an elastic rail throws back rises to the same height every time.
    speed = 2e-3
    duration = 2.0 * speed / SLIDING
    spin = 3.5 * SLIDING * duration * (bounces + 10) / RADIUS
    physics = bs.Physics(rail_restitution=1.0)
    simulation = bs.Simulation(bs.Scene([[AT_X_MAX, 0.6]], [[speed, 0.0]], [[0.0, spin, 0.0]], physics=physics))
    events = [event for event in simulation.run(until=duration * (bounces + 0.5)) if event.kind == "ball_rail"]
    assert len(events) == bounces + 1
    assert [event.approach_speed for event in events] == pytest.approx([speed] * len(events), rel=1e-9)
    assert [event.time for event in events] == pytest.approx(duration * np.arange(len(events)), rel=1e-9)


def test_fast_impact_forgets_the_slow_ones() -> None:
    # A ball whose bounces would soon end is hit: from then on it does what a fresh one does.
    speed, spin = 3e-3, 400.0
    way = 0.24
    bouncing = bs.Scene(
        [[AT_X_MAX, 0.8], [AT_X_MAX, 0.8 - 2.0 * RADIUS - way]],
        [[speed, 0.0], [0.0, 1.0]],
        [[0.0, spin, 0.0], [-1.0 / RADIUS, 0.0, 0.0]],
        physics=bs.Physics(rail_restitution=1.0),
    )
    hit_time = next(event.time for event in bs.Simulation(bouncing).run(until=1.0) if event.kind == "ball_ball")
    simulation = bs.Simulation(bouncing)
    before = simulation.run(until=hit_time)
    assert 70 < len([event for event in before if event.kind == "ball_rail"]) < 88
    fresh = bs.Simulation(simulation.scene())
    later = 0.13
    expected = [event.kind for event in fresh.run(until=later) if event.balls == ("cue",)]
    assert 35 < len(expected) < 48
    assert [event.kind for event in simulation.advance(later) if event.balls == ("cue",)] == expected
    assert simulation.positions == pytest.approx(fresh.positions, abs=1e-9)


@pytest.mark.skipif(not COMPILED, reason="takes minutes")
@pytest.mark.parametrize("seed", [9591, 11179, 11913])
def test_dense_islands_take_few_steps_to_rest(seed: int) -> None:
    # Speeds left along the normals, or an overlap that nothing could end, kept such scenes going, even at rest.
    simulation = bs.Simulation(provoking_scene(seed))
    simulation.run(budget=60.0)
    assert simulation.at_rest
    assert get_field(simulation._now.state.clock, 0, "passes") < 20_000


@pytest.mark.skipif(not COMPILED, reason="takes half a minute")
def test_contact_that_closes_at_first_lasts_for_its_step() -> None:
    # Without a push over the step as a whole, as it turns: let go, it would be met again and again.
    simulation = bs.Simulation(frozen_row(183))
    events = simulation.run(budget=60.0)
    assert simulation.at_rest
    assert len(events) < MOST_EVENTS
