# SPDX-License-Identifier: Apache-2.0
"""Cells against one cell that holds every ball: what happens must not depend on them."""

from __future__ import annotations

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.engine import moment


def crowd(count: int, seed: int) -> bs.Scene:
    """Balls all over a large table, most of them moving."""
    table = bs.Table(length=4.0, width=3.0)
    random = np.random.default_rng(seed)
    columns = 10
    spots = np.array([(index % columns, index // columns) for index in range(count)])
    positions = np.array([0.3, 0.3]) + spots * [0.4, 2.6 / (count // columns)] + random.uniform(-0.05, 0.05, (count, 2))
    velocities = random.uniform(-4.0, 4.0, (count, 2)) * (random.random((count, 1)) < 0.8)
    return bs.Scene(positions, velocities, random.uniform(-50.0, 50.0, (count, 3)), table=table)


def runs_with_and_without_cells(monkeypatch: pytest.MonkeyPatch, scene: bs.Scene) -> list[bs.Simulation]:
    simulations = []
    for one_cell in (0, 1000):
        monkeypatch.setattr(moment, "ONE_CELL", one_cell)
        simulations.append(bs.Simulation(scene))
    return simulations


@pytest.mark.parametrize("seed", range(5))
def test_cells_change_nothing_that_happens(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    celled, plain = runs_with_and_without_cells(monkeypatch, crowd(60, seed))
    events, expected = celled.run(until=0.4), plain.run(until=0.4)
    assert sum(event.kind == "ball_ball" for event in expected) >= 5
    assert [(event.kind, event.balls, event.rail) for event in events] == [
        (event.kind, event.balls, event.rail) for event in expected
    ]
    assert [event.time for event in events] == pytest.approx([event.time for event in expected], abs=1e-9)
    assert celled.positions == pytest.approx(plain.positions, abs=1e-8)


def test_lone_ball_crosses_many_cells_without_a_change_of_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    positions = [[0.2, 0.2], *[[0.1 + 0.1 * index, 1.1] for index in range(20)]]
    velocities = [[6.0, 0.9], *[[0.0, 0.0]] * 20]
    celled, plain = runs_with_and_without_cells(monkeypatch, bs.Scene(positions, velocities))
    assert list(celled.run(until=0.5)) == list(plain.run(until=0.5))
    assert np.array_equal(celled.positions, plain.positions)


def test_shot_that_moves_the_ball_into_the_next_cell_is_seen_there(monkeypatch: pytest.MonkeyPatch) -> None:
    # The cue pushes the ball 25 cm along, over the borders of several cells.
    target = [[1.6, 0.6], *[[0.1 + 0.06 * index, 1.18] for index in range(38)]]
    celled, plain = runs_with_and_without_cells(monkeypatch, bs.Scene([[0.5, 0.6], *target]))
    for simulation in (celled, plain):
        simulation.strike((800.0, 0.0, 0.0))
    events, expected = celled.run(until=0.1), plain.run(until=0.1)
    assert [event.balls for event in events if event.kind == "ball_ball"] == [("cue", "1")] * 2  # and back off the rail
    assert [event.time for event in events] == pytest.approx([event.time for event in expected], abs=1e-12)


def test_thousand_balls_keep_apart_and_lose_no_energy_on_ice() -> None:
    count = 1000
    physics = bs.Physics(sliding_friction=0.0, rolling_friction=0.0, rail_restitution=1.0)
    random = np.random.default_rng(2)
    spots = np.array([(index % 40, index // 40) for index in range(count)])
    positions = np.array([0.2, 0.2]) + 0.2 * spots + random.uniform(-0.05, 0.05, (count, 2))
    table = bs.Table(length=8.2, width=5.2)
    velocities = random.normal(0.0, 1.0, (count, 2))
    simulation = bs.Simulation(bs.Scene(positions, velocities, table=table, physics=physics))
    energy = simulation.kinetic_energy
    events = simulation.run(until=1.0)
    assert sum(event.kind == "ball_ball" for event in events) > 200
    assert simulation.kinetic_energy == pytest.approx(energy, rel=1e-12)
    apart = simulation.positions[:, np.newaxis] - simulation.positions
    distances = np.hypot(*np.moveaxis(apart, 2, 0)) + np.diag(np.full(count, np.inf))
    assert distances.min() >= 2.0 * physics.radius - 1e-12
