# SPDX-License-Identifier: Apache-2.0
"""The cue shot against equations 1 to 12, in every direction."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import billiards_sim as bs

PHYSICS = bs.Physics()
RADIUS, MASS, TIME = PHYSICS.radius, PHYSICS.mass, PHYSICS.cue_contact_time
START = (1.0, 0.6)


def lone_ball(position=START, **physics: float) -> bs.Simulation:
    return bs.Simulation(bs.Scene([position], physics=bs.Physics(**physics)))


def struck(force, offset=(0.0, 0.0)) -> bs.Simulation:
    simulation = lone_ball()
    simulation.strike(force, offset)
    return simulation


def test_centre_hit_gives_the_papers_velocity_and_displacement() -> None:
    simulation = struck((80.0, 0.0, 0.0))
    assert simulation.time == 0.0
    assert simulation.velocities[0] == pytest.approx([5.0, 0.0], rel=1e-15)
    assert simulation.positions[0] == pytest.approx([START[0] + 0.5 * 80.0 / MASS * TIME**2, START[1]], rel=1e-15)
    assert not simulation.angular_velocities.any()


@given(st.floats(-math.pi, math.pi), st.floats(1.0, 200.0), st.floats(-0.7, 0.7), st.floats(-0.7, 0.7))
def test_spin_is_torque_times_time_over_inertia(angle, size, side, up) -> None:
    side, up = side * RADIUS, up * RADIUS
    force = np.array([size * math.cos(angle), size * math.sin(angle), 0.0])
    ahead, left = force / size, np.array([-math.sin(angle), math.cos(angle), 0.0])
    # r as in equation 8; its part along the force does not change the torque.
    r = -math.sqrt(RADIUS**2 - side**2 - up**2) * ahead + side * left + up * np.array([0.0, 0.0, 1.0])
    expected = np.cross(r, force) * TIME / (0.4 * MASS * RADIUS**2)
    simulation = struck(force, (side, up))
    assert simulation.angular_velocities[0] == pytest.approx(expected, rel=1e-12, abs=1e-9)
    assert simulation.velocities[0] == pytest.approx(force[:2] / MASS * TIME, rel=1e-12, abs=1e-12)


def test_hit_at_seven_fifths_of_the_radius_rolls_at_once() -> None:
    simulation = struck((20.0, 0.0, 0.0), (0.0, 0.4 * RADIUS))
    assert [event.kind for event in simulation.advance(0.5)] == ["shot"]


def test_hit_on_the_left_turns_the_ball_clockwise() -> None:
    assert struck((0.0, 10.0, 0.0), (0.3 * RADIUS, 0.0)).angular_velocities[0, 2] < 0.0


def test_shot_event_comes_first() -> None:
    simulation = struck((0.0, 40.0, 0.0), (0.3 * RADIUS, 0.4 * RADIUS))
    shot = simulation.run()[0]
    assert shot.kind == "shot"
    assert shot.balls == ("cue",)
    assert shot.time == 0.0
    assert shot.normal == (0.0, 1.0)
    assert shot.impulse == pytest.approx(40.0 * TIME, rel=1e-15)
    behind = RADIUS * math.sqrt(1.0 - 0.09 - 0.16)
    assert shot.point == pytest.approx((START[0] - 0.3 * RADIUS, START[1] - behind), rel=1e-14)


def test_displacement_stops_at_a_ball_and_the_impulse_is_whole() -> None:
    scene = bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS + 0.01, 0.6]])
    simulation = bs.Simulation(scene)
    simulation.strike((80.0, 0.0, 0.0))
    assert simulation.positions[0, 0] == pytest.approx(1.01, abs=1e-15)
    assert simulation.velocities[0] == pytest.approx([5.0, 0.0], rel=1e-15)
    hit = simulation.advance(1e-3)[1]
    assert (hit.kind, hit.time, hit.approach_speed) == ("ball_ball", pytest.approx(0.0, abs=1e-15), pytest.approx(5.0))


def test_displacement_stops_at_a_rail() -> None:
    table = bs.Table()
    simulation = lone_ball((table.x_max - RADIUS - 0.01, 0.6))
    simulation.strike((80.0, 0.0, 0.0))
    assert simulation.positions[0, 0] == pytest.approx(table.x_max - RADIUS, abs=1e-15)
    assert [event.rail for event in simulation.advance(1e-3)] == [None, "x_max"]


def test_frozen_ball_is_hit_without_any_displacement() -> None:
    simulation = bs.Simulation(bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS, 0.6]]))
    simulation.strike((80.0, 0.0, 0.0))
    simulation.advance(1e-6)
    assert simulation.velocities == pytest.approx(np.array([[0.0, 0.0], [5.0, 0.0]]), abs=1e-4)


@pytest.mark.parametrize(
    "force, offset, ball, complaint",
    [
        ((1.0, 0.0, 0.1), (0.0, 0.0), "cue", "force z must be <= 0.*0.1"),
        ((0.0, 0.0, -1.0), (0.0, 0.0), "cue", "force must not be zero along the table"),
        ((1.0, 0.0, -1e300), (0.0, 0.0), "cue", "force must give the ball a speed <= 2.9979.* m/s"),
        ((0.0, 0.0, 0.0), (0.0, 0.0), "cue", "force must not be zero"),
        ((math.nan, 0.0, 0.0), (0.0, 0.0), "cue", "force must be finite.*nan"),
        ((1.0, math.inf, 0.0), (0.0, 0.0), "cue", "force must be finite.*inf"),
        ((1.0, 0.0), (0.0, 0.0), "cue", "force must be 3 numbers"),
        ((1e300, 0.0, 0.0), (0.0, 0.0), "cue", "force must give the ball a speed <= 2.9979.* m/s"),
        ((1.0, 0.0, 0.0), (0.0, math.nan), "cue", "offset must be finite"),
        ((1.0, 0.0, 0.0), (0.03, 0.0), "cue", "offset must lie on the ball: 0.03 m.*0.028575"),
        ((1.0, 0.0, 0.0), (0.0, 0.0), "eight", "no ball is named 'eight'"),
    ],
)
def test_bad_shot_is_refused_and_changes_nothing(force, offset, ball, complaint) -> None:
    simulation = lone_ball()
    with pytest.raises(ValueError, match=complaint):
        simulation.strike(force, offset, ball)
    assert simulation.at_rest
    assert simulation.positions.tolist() == lone_ball().positions.tolist()
    assert list(simulation.advance(1.0)) == []


def test_moving_ball_is_not_struck() -> None:
    simulation = struck((10.0, 0.0, 0.0))
    simulation.advance(0.1)
    before = simulation.velocities
    with pytest.raises(ValueError, match=r"'cue' must rest.*m/s"):
        simulation.strike((10.0, 0.0, 0.0))
    assert np.array_equal(simulation.velocities, before)


def test_resting_ball_is_struck_while_another_moves() -> None:
    simulation = bs.Simulation(bs.Scene([[0.5, 0.3], [0.5, 0.9]], [[0.0, 0.0], [1.0, 0.0]]))
    simulation.advance(0.2)
    simulation.strike((16.0, 0.0, 0.0))
    assert simulation.velocities[0] == pytest.approx([1.0, 0.0])
    assert simulation.velocities[1, 0] < 1.0
