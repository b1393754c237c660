# SPDX-License-Identifier: Apache-2.0
"""Motion of a single ball against the formulas of the physics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import billiards_sim as bs

PHYSICS = bs.Physics()
RADIUS = PHYSICS.radius
SLIDING = PHYSICS.sliding_friction * PHYSICS.gravity
ROLLING = PHYSICS.rolling_friction * PHYSICS.gravity
BIG_TABLE = bs.Table(length=1000.0, width=1000.0)
CENTRE = np.array(BIG_TABLE.centre)

speeds = st.floats(-5.0, 5.0)
spins = st.floats(-200.0, 200.0)


def lone_ball(velocity, spin=(0.0, 0.0, 0.0)) -> bs.Simulation:
    return bs.Simulation(bs.Scene([CENTRE], [velocity], [spin], table=BIG_TABLE))


def slip(velocity, spin) -> np.ndarray:
    return np.array([velocity[0] - RADIUS * spin[1], velocity[1] + RADIUS * spin[0]])


def test_centre_hit_ball_rolls_after_two_sevenths_of_the_slip() -> None:
    simulation = lone_ball((3.0, 0.0))
    rolling, rest = simulation.run()
    assert rolling.kind == "rolling"
    assert rolling.time == pytest.approx(2.0 * 3.0 / (7.0 * SLIDING), rel=1e-15)
    distance = 12.0 * 3.0**2 / (49.0 * SLIDING)
    assert rolling.point[0] - CENTRE[0] == pytest.approx(distance, rel=1e-13)
    rolling_speed = 5.0 / 7.0 * 3.0
    assert rest.kind == "rest"
    assert rest.time - rolling.time == pytest.approx(rolling_speed / ROLLING, rel=1e-14)
    distance += rolling_speed**2 / (2.0 * ROLLING)
    assert simulation.positions[0, 0] - CENTRE[0] == pytest.approx(distance, rel=1e-13)


def test_rolling_ball_slows_and_stays_rolling() -> None:
    simulation = lone_ball((1.0, -0.5), (0.5 / RADIUS, 1.0 / RADIUS, 0.0))
    assert [event.kind for event in simulation.advance(1.0)] == []
    speed = math.hypot(1.0, 0.5)
    assert np.hypot(*simulation.velocities[0]) == pytest.approx(speed - ROLLING, rel=1e-14)
    assert slip(simulation.velocities[0], simulation.angular_velocities[0]) == pytest.approx([0.0, 0.0], abs=1e-15)


@given(speeds, speeds, spins, spins, spins)
def test_slip_keeps_its_direction_and_falls_at_seven_halves_mu_g(vx, vy, wx, wy, wz) -> None:
    simulation = lone_ball((vx, vy), (wx, wy, wz))
    before = slip((vx, vy), (wx, wy))
    assume(np.hypot(*before) > 1e-3)
    duration = 2.0 / 7.0 * np.hypot(*before) / SLIDING
    simulation.advance(0.5 * duration)
    assert slip(simulation.velocities[0], simulation.angular_velocities[0]) == pytest.approx(0.5 * before, abs=1e-13)
    events = simulation.run(until=1.001 * duration)
    assert [event.kind for event in events][:1] == ["rolling"]
    assert events[0].time == pytest.approx(duration, rel=1e-13)


@given(speeds, speeds, spins, spins, spins)
def test_path_while_sliding_is_a_parabola_and_ends_where_friction_leaves_it(vx, vy, wx, wy, wz) -> None:
    before = slip((vx, vy), (wx, wy))
    size = np.hypot(*before)
    assume(size > 1e-3)
    simulation = lone_ball((vx, vy), (wx, wy, wz))
    end = 2.0 / 7.0 * size / SLIDING
    simulation.run(until=end)
    velocity = np.array([vx, vy])
    after = velocity - 2.0 / 7.0 * before
    assert simulation.velocities[0] == pytest.approx(after, abs=1e-13)
    assert simulation.positions[0] - CENTRE == pytest.approx(0.5 * (velocity + after) * end, abs=1e-12)
    expected_spin = [-after[1] / RADIUS, after[0] / RADIUS, wz]
    assert simulation.angular_velocities[0] == pytest.approx(expected_spin, abs=1e-10)


@given(speeds, speeds, spins, spins, spins)
def test_friction_does_the_work_that_energy_loses(vx, vy, wx, wy, wz) -> None:
    # Power of sliding friction is -mu_s m g |slip|, and the slip falls linearly.
    size = np.hypot(*slip((vx, vy), (wx, wy)))
    assume(size > 1e-3)
    simulation = lone_ball((vx, vy), (wx, wy, wz))
    energy = simulation.kinetic_energy
    end = 2.0 / 7.0 * size / SLIDING
    simulation.run(until=end)
    work = PHYSICS.mass * SLIDING * 0.5 * size * end
    assert energy - simulation.kinetic_energy == pytest.approx(work, rel=1e-9, abs=1e-12 * energy)


def test_spin_about_the_vertical_keeps_its_value_and_counts_as_rest() -> None:
    simulation = lone_ball((0.0, 0.0), (0.0, 0.0, 40.0))
    assert simulation.at_rest
    assert list(simulation.advance(10.0)) == []
    assert simulation.angular_velocities.tolist() == [[0.0, 0.0, 40.0]]


def test_draw_comes_back() -> None:
    simulation = lone_ball((1.0, 0.0), (0.0, -2.5 * 2.0 / RADIUS, 0.0))
    simulation.run()
    assert simulation.positions[0, 0] < CENTRE[0]


def test_ball_without_friction_keeps_its_velocity() -> None:
    scene = bs.Scene([CENTRE], [[1.0, 0.5]], table=BIG_TABLE, physics=bs.Physics(sliding_friction=0.0))
    simulation = bs.Simulation(scene)
    assert list(simulation.advance(100.0)) == []
    assert simulation.velocities.tolist() == [[1.0, 0.5]]
    assert simulation.positions[0] - CENTRE == pytest.approx([100.0, 50.0], rel=1e-14)
