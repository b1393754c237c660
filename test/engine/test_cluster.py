# SPDX-License-Identifier: Apache-2.0
"""Impacts at the same instant: shocks through touching balls, symmetry, independence of the order of the balls."""

from __future__ import annotations

import math

import numpy as np
import pytest
from checks import extremes
from provoke import frozen_row

import billiards_sim as bs

RADIUS = bs.Physics().radius
TABLE = bs.Table()


def on_ice(positions, velocities, **physics: float) -> bs.Scene:
    return bs.Scene(positions, velocities, physics=bs.Physics(sliding_friction=0.0, **physics))


@pytest.mark.parametrize("speed", [1e-3, 2.0, 30.0])
def test_ball_between_two_touching_ones_leaves_backwards_at_a_fifth(speed: float) -> None:
    # Energy and momentum with both impulses at 30 degrees: the cue ball keeps -v/5, the others get 2 sqrt(3)/5 v.
    scene = on_ice([[1.0, 0.6], [1.2, 0.6 + RADIUS], [1.2, 0.6 - RADIUS]], [[speed, 0.0], [0.0, 0.0], [0.0, 0.0]])
    simulation = bs.Simulation(scene)
    events = simulation.run(until=0.2 / speed)
    along = 2.0 * math.sqrt(3.0) / 5.0 * np.array([math.cos(math.pi / 6.0), math.sin(math.pi / 6.0)])
    expected = speed * np.array([[-0.2, 0.0], along, along * [1.0, -1.0]])
    assert simulation.velocities == pytest.approx(expected, abs=1e-12 * speed)
    assert [event.balls for event in events if event.kind == "ball_ball"] == [("cue", "1"), ("cue", "2")]
    for event in events[:2]:
        assert event.approach_speed == pytest.approx(speed * math.cos(math.pi / 6.0), rel=1e-9)
        assert event.impulse == pytest.approx(0.16 * np.hypot(*along) * speed, rel=1e-9)


@pytest.mark.parametrize("arriving", [1, 2, 3])
@pytest.mark.parametrize("waiting", range(1, 9))
def test_as_many_balls_leave_a_row_as_arrive(arriving: int, waiting: int) -> None:
    places = [0.3 + 2.0 * RADIUS * index + (0.1 if index >= arriving else 0.0) for index in range(arriving + waiting)]
    velocities = [[1.0 if index < arriving else 0.0, 0.0] for index in range(arriving + waiting)]
    simulation = bs.Simulation(on_ice([[x, 0.6] for x in places], velocities))
    simulation.run(until=0.15)
    expected = [0.0] * waiting + [1.0] * arriving
    assert simulation.velocities[:, 0] == pytest.approx(expected, abs=1e-12)
    assert simulation.velocities[:, 1] == pytest.approx(np.zeros(arriving + waiting), abs=1e-12)


@pytest.mark.parametrize("angle", np.linspace(0.0, math.pi, 31))
def test_two_touching_balls_hit_by_a_third_keep_momentum_and_energy(angle: float) -> None:
    pair = np.array([[1.2, 0.6], [1.2 + 2.0 * RADIUS, 0.6]])
    target = pair.mean(axis=0)
    away = np.array([math.cos(angle), math.sin(angle)])
    scene = on_ice([target - 0.3 * away, *pair], [5.0 * away, [0.0, 0.0], [0.0, 0.0]])
    simulation = bs.Simulation(scene)
    momentum, energy = simulation.velocities.sum(axis=0), simulation.kinetic_energy
    for _ in range(70):
        simulation.advance(0.001)
        positions = simulation.positions
        distances = [np.hypot(*(positions[i] - positions[j])) for i, j in ((0, 1), (0, 2), (1, 2))]
        assert min(distances) >= 2.0 * RADIUS - 1e-12
    assert np.hypot(*simulation.velocities[1:].T).max() > 1.0
    assert simulation.velocities.sum(axis=0) == pytest.approx(momentum, abs=1e-12)
    assert simulation.kinetic_energy == pytest.approx(energy, rel=1e-12)


def test_result_does_not_depend_on_the_order_of_the_balls() -> None:
    scene = bs.scenes.rack(0.0)
    order = np.random.default_rng(5).permutation(16)
    states = []
    for arrangement in (np.arange(16), order):
        names = [scene.names[index] for index in arrangement]
        simulation = bs.Simulation(bs.Scene(scene.positions[arrangement], names=names))
        simulation.strike((100.0, 3.0, 0.0), (0.004, 0.003))
        simulation.run(until=0.3)
        states.append(simulation.positions[np.argsort(arrangement)])
    assert states[0] == pytest.approx(states[1], abs=1e-9)


@pytest.mark.parametrize("gap", [0.0, 1e-4])
def test_symmetric_rack_stays_symmetric(gap: float) -> None:
    scene = bs.scenes.rack(gap)
    axis = scene.table.centre[1]
    mirror = [
        int(np.argmin(np.hypot(scene.positions[:, 0] - x, scene.positions[:, 1] - (2.0 * axis - y))))
        for x, y in scene.positions
    ]
    simulation = bs.Simulation(scene)
    simulation.strike((128.0, 0.0, 0.0))
    simulation.run()
    reflected = simulation.positions[mirror] * [1.0, -1.0] + [0.0, 2.0 * axis]
    assert np.abs(simulation.positions - scene.positions).max() > 0.3
    assert simulation.positions == pytest.approx(reflected, abs=1e-9)


def test_ball_in_a_corner_meets_both_rails_and_a_ball() -> None:
    corner = np.array([TABLE.x_max - RADIUS, TABLE.y_max - RADIUS])
    behind = corner - 2.0 * RADIUS / math.sqrt(2.0)
    scene = on_ice([behind, corner], [[1.0, 1.0], [0.0, 0.0]], rail_restitution=1.0)
    simulation = bs.Simulation(scene)
    simulation.run(until=0.01)
    assert simulation.velocities == pytest.approx(np.array([[-1.0, -1.0], [0.0, 0.0]]), abs=1e-12)


@pytest.mark.parametrize("speed", [1.0, 8.0])
def test_touching_rack_keeps_the_laws_until_rest(speed: float) -> None:
    worst = extremes(bs.scenes.rack(0.0), lambda simulation: simulation.strike((16.0 * speed, 0.7, 0.0)))
    assert worst.overlap <= 1e-9
    assert worst.outside <= 1e-9
    assert worst.energy_rise <= 1e-12


def test_balls_that_press_each_other_touch_whatever_gap_a_step_has_left_between_them() -> None:
    # Hit obliquely, a pressed row of which two are 2e-10 m apart does what the same row does with no gaps.
    row = frozen_row(95)
    count = len(row)
    first = row.positions[1] + [2.0 * RADIUS * math.sin(0.5), 0.25]
    scene = bs.Scene(
        np.vstack((row.positions, first)),
        np.vstack((row.velocities, [0.0, -2.0])),
        np.vstack((row.angular_velocities, [2.0 / RADIUS, 0.0, 0.0])),
        physics=row.physics,
    )
    events = bs.Simulation(scene).run(until=0.2)
    hit = next(event for event in events if event.kind == "ball_ball" and str(count) in event.balls)
    simulation = bs.Simulation(scene)
    simulation.run(until=hit.time - 1e-7)
    positions = simulation.positions
    gaps = np.hypot(*np.diff(positions[:count], axis=0).T) - 2.0 * RADIUS
    assert 1e-11 < gaps.max() < 1e-9
    for k in range(1, count):
        positions[k, 0] = positions[k - 1, 0] + math.sqrt(
            4.0 * RADIUS**2 - np.diff(positions[k - 1 : k + 1, 1])[0] ** 2
        )
    touching = bs.Simulation(
        bs.Scene(positions, simulation.velocities, simulation.angular_velocities, physics=row.physics)
    )
    simulation.advance(2e-7)
    touching.advance(2e-7)
    assert np.abs(simulation.velocities[:count]).max() > 0.1
    assert simulation.velocities == pytest.approx(touching.velocities, abs=1e-6)
