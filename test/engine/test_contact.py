# SPDX-License-Identifier: Apache-2.0
"""Sustained contact: the limit of ever finer bounces, against closed forms and against fine bounces themselves."""

from __future__ import annotations

import math

import numpy as np
import pytest
from checks import AT_X_MAX, AT_Y_MAX, COMPILED, RADIUS, ROLLING, SLIDING, TABLE, depth_at_every_instant, extremes
from provoke import frozen_row

import billiards_sim as bs


def in_a_row(*velocities_and_spins, start=0.8) -> bs.Scene:
    """Touching balls along x, each given by (vx, wy)."""
    count = len(velocities_and_spins)
    return bs.Scene(
        [[start + 2.0 * RADIUS * index, 0.6] for index in range(count)],
        [[v, 0.0] for v, _ in velocities_and_spins],
        [[0.0, w, 0.0] for _, w in velocities_and_spins],
    )


@pytest.mark.parametrize("vy, wx", [(0.0, 0.0), (0.5, 0.0), (0.5, 60.0), (-0.3, -20.0)])
def test_topspin_along_a_rail_leaves_by_the_closed_form(vy: float, wx: float) -> None:
    # Pressed from the start: with s from ds = mu_s g dt/|u|, ux falls as exp(-5s/2) and uy as exp(-7s/2).
    mpmath = pytest.importorskip("mpmath")
    ux, uy = -RADIUS * 150.0, vy + RADIUS * wx
    simulation = bs.Simulation(bs.Scene([[AT_X_MAX, 0.6]], [[0.0, vy]], [[wx, 150.0, 0.0]]))
    events = simulation.run(until=1.0)

    def slip(s):
        return mpmath.sqrt(ux**2 * mpmath.exp(-5 * s) + uy**2 * mpmath.exp(-7 * s))

    def speed(s):
        return vy - 2.0 / 7.0 * uy * (1 - mpmath.exp(-3.5 * s))

    span = [0, 0.5, 1, 2, 4, 8, 16, 40]
    duration = float(mpmath.quad(slip, span)) / SLIDING
    way = float(mpmath.quad(lambda s: speed(s) * slip(s), span)) / SLIDING
    rolling = next(event for event in events if event.kind in ("rolling", "rest"))
    assert rolling.time == pytest.approx(duration, abs=1e-6)
    assert rolling.point == pytest.approx((AT_X_MAX, 0.6 + way), abs=1e-6)
    exit_speed = vy - 2.0 / 7.0 * uy
    after = 1.0 - rolling.time
    assert simulation.velocities[0, 0] == pytest.approx(0.0, abs=1e-9)
    expected = math.copysign(max(abs(exit_speed) - ROLLING * after, 0.0), exit_speed)
    assert simulation.velocities[0, 1] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("vy", [0.0, 0.5])
def test_ball_that_bounces_its_way_into_contact_with_a_rail_takes_few_events(vy: float) -> None:
    simulation = bs.Simulation(bs.Scene([[2.35, 0.6]], [[0.1, vy]], [[0.0, 150.0, 0.0]]))
    events = simulation.run()
    assert len(events) < 100
    assert simulation.at_rest
    bounces = [event for event in events if event.kind == "ball_rail" and event.rail == "x_max"]
    assert len(bounces) > 10
    assert simulation.positions[0, 0] == pytest.approx(AT_X_MAX, abs=1e-9)


def pressed_row(followers: int) -> tuple[float, float]:
    """Push per mass on a ball that slides into a row of rolling ones, and the acceleration of all along the line.

    Each follower takes the same share p of the push: a = 5/7 p - mu_r g (1 - p / (7/2 mu_s g)), and the first ball
    a = mu_s g - followers p.
    """
    share = (SLIDING + ROLLING) / (followers + 5.0 / 7.0 + ROLLING / (3.5 * SLIDING))
    return followers * share, SLIDING - followers * share


@pytest.mark.parametrize("followers", [1, 2, 3, 5])
def test_ball_that_slides_into_frozen_ones_pushes_them_along(followers: int) -> None:
    spin = 60.0
    push, acceleration = pressed_row(followers)
    simulation = bs.Simulation(in_a_row((0.0, spin), *[(0.0, 0.0)] * followers))
    start = simulation.positions
    events = simulation.run()
    duration = RADIUS * spin / (3.5 * SLIDING - push)
    rolling = next(event for event in events if event.kind == "rolling" and event.balls == ("cue",))
    assert rolling.time == pytest.approx(duration, abs=1e-6)
    way = 0.5 * acceleration * duration**2 + (acceleration * duration) ** 2 / (2.0 * ROLLING)
    assert simulation.positions - start == pytest.approx(np.array([[way, 0.0]] * (followers + 1)), abs=1e-6)


@pytest.mark.parametrize("followers", range(5))
def test_spin_against_a_blocked_row_is_used_up_in_place(followers: int) -> None:
    # Nothing can move, so only the spin slows down: slip falls at 5/2 mu_s g instead of 7/2 mu_s g.
    spin = 120.0
    start = AT_X_MAX - 2.0 * RADIUS * followers
    simulation = bs.Simulation(in_a_row((0.0, spin), *[(0.0, 0.0)] * followers, start=start))
    before = simulation.positions
    events = simulation.run()
    rest = next(event for event in events if event.kind == "rest" and event.balls == ("cue",))
    assert rest.time == pytest.approx(RADIUS * spin / (2.5 * SLIDING), abs=1e-6)
    assert simulation.positions == pytest.approx(before, abs=1e-9)
    assert len(events) <= 10


def test_spin_into_a_corner_is_used_up_in_place() -> None:
    spin = np.array([-80.0, 120.0])
    simulation = bs.Simulation(bs.Scene([[AT_X_MAX, AT_Y_MAX]], None, [[*spin, 0.0]]))
    events = simulation.run()
    assert events[-1].time == pytest.approx(RADIUS * np.hypot(*spin) / (2.5 * SLIDING), abs=1e-6)
    assert simulation.positions == pytest.approx(np.array([[AT_X_MAX, AT_Y_MAX]]), abs=1e-9)
    assert len(events) <= 10


def pushed_pair_rates(state):
    """d/dt of (p1, v1, (wx, wy)1, p2, v2) of a sliding ball that pushes a rolling one; the push per mass keeps
    their distance: n . (a1 - a2) + vt^2/2R = 0."""
    p1, v1, w1, p2, v2 = state.reshape(5, 2)
    n = (p1 - p2) / np.hypot(*(p1 - p2))
    slip = v1 + RADIUS * np.array([-w1[1], w1[0]])
    friction = -SLIDING * slip / np.hypot(*slip)
    speed = np.hypot(*v2)
    ahead = v2 / speed if speed > 0.0 else -n
    across = (v1 - v2) @ np.array([-n[1], n[0]])
    give = 1.0 + 5.0 / 7.0 - ROLLING / (3.5 * SLIDING) * (n @ ahead)
    push = -(n @ friction + ROLLING * (n @ ahead) + across**2 / (2.0 * RADIUS)) / give
    a1 = friction + push * n
    a2 = -5.0 / 7.0 * push * n - ROLLING * (1.0 - push / (3.5 * SLIDING)) * ahead
    alpha = 2.5 / RADIUS * np.array([friction[1], -friction[0]])
    return np.concatenate((v1, a1, alpha, v2, a2)), push


@pytest.mark.parametrize("angle, spin, duration", [(0.5, 60.0, 0.23), (0.1, 100.0, 0.48), (-1.1, 40.0, 0.11)])
def test_oblique_push_follows_the_equations_of_motion(angle: float, spin: float, duration: float) -> None:
    # Integrated by fourth-order Runge-Kutta, until shortly before the push ends.
    normal = np.array([math.cos(angle), math.sin(angle)])
    start = np.array([[0.8, 0.6], np.array([0.8, 0.6]) + 2.0 * RADIUS * normal])
    state = np.concatenate((start[0], [0.0, 0.0], [0.0, spin], start[1], [0.0, 0.0]))
    steps = 1000
    h = duration / steps
    for _ in range(steps):
        k1, push = pushed_pair_rates(state)
        assert push > 0.0
        k2 = pushed_pair_rates(state + 0.5 * h * k1)[0]
        k3 = pushed_pair_rates(state + 0.5 * h * k2)[0]
        state = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + pushed_pair_rates(state + h * k3)[0])
    simulation = bs.Simulation(bs.Scene(start, None, [[0.0, spin, 0.0], [0.0, 0.0, 0.0]]))
    simulation.run(until=duration)
    expected = state.reshape(5, 2)
    assert simulation.positions == pytest.approx(expected[[0, 3]], abs=2e-7)
    assert simulation.velocities == pytest.approx(expected[[1, 4]], abs=2e-6)
    assert np.abs(simulation.positions - start).max() > 0.005


def fine_bounces(spin: float, least: float) -> float:
    """Speed at which the front ball rolls off when the rear one has stopped sliding: elastic bounces on a line, one
    after the other in closed form, none smaller than `least` (m/s)."""
    rear, front, slip, gap = 0.0, least, least, 0.0  # just after the first bounce; the front ball slips by `slip`
    rear_slip = RADIUS * spin
    while rear_slip > 0.0:
        front_acceleration = -SLIDING if slip > 0.0 else -ROLLING
        closing, pull = rear - front, SLIDING - front_acceleration
        meet = (math.sqrt(closing**2 + 2.0 * pull * gap) - closing) / pull
        step = min(meet, slip / (3.5 * SLIDING) if slip > 0.0 else math.inf, rear_slip / (3.5 * SLIDING))
        gap -= (closing + 0.5 * pull * step) * step
        rear += SLIDING * step
        front += front_acceleration * step
        rear_slip -= 3.5 * SLIDING * step
        slip = max(slip - 3.5 * SLIDING * step, 0.0) if slip > 0.0 else 0.0
        if slip < 1e-15:
            slip = 0.0
        if step == meet:
            gap = 0.0
            kick = 0.5 * (rear - front + max(rear - front, least))
            rear, front = rear - kick, front + kick
            slip += kick
            rear_slip += kick
    return front


def test_sustained_contact_is_the_limit_of_ever_finer_bounces() -> None:
    spin = 20.0
    push, acceleration = pressed_row(1)
    limit = acceleration * RADIUS * spin / (3.5 * SLIDING - push)
    errors = [abs(fine_bounces(spin, least) - limit) for least in (1e-3, 1e-4, 1e-5)]
    assert errors[0] < 2e-3 and errors[1] < 2e-4 and errors[2] < 2e-5
    simulation = bs.Simulation(in_a_row((0.0, spin), (0.0, 0.0)))
    simulation.run(until=RADIUS * spin / (3.5 * SLIDING - push))
    assert simulation.velocities[:, 0] == pytest.approx([limit, limit], abs=1e-6)


PRESSED_SCENES = {
    "frozen to a rail and spun into it": bs.Scene([[AT_X_MAX, 0.6]], None, [[0.0, 99.0, 0.0]]),
    "in a corner": bs.Scene([[AT_X_MAX, AT_Y_MAX]], None, [[-80.0, 120.0, 0.0]]),
    "bouncing into a corner": bs.Scene([[2.3, 1.15]], [[0.3, 0.2]], [[-80.0, 120.0, 5.0]]),
    "between ball and rail": in_a_row((0.0, 120.0), (0.0, 0.0), start=AT_X_MAX - 2.0 * RADIUS),
    "frozen chain on a rail": in_a_row((0.0, 120.0), (0.0, 0.0), (0.0, 0.0), start=AT_X_MAX - 4.0 * RADIUS),
    "chain hit with follow": in_a_row((3.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)),
    "oblique push": bs.Scene(
        [[0.8, 0.6], [0.8 + 2.0 * RADIUS * math.cos(0.5), 0.6 + 2.0 * RADIUS * math.sin(0.5)]],
        None,
        [[0.0, 60.0, 0.0], [0.0, 0.0, 0.0]],
    ),
    "two push one": bs.Scene(
        [[0.8 - math.sqrt(3.0) * RADIUS, 0.6 - RADIUS], [0.8 - math.sqrt(3.0) * RADIUS, 0.6 + RADIUS], [0.8, 0.6]],
        None,
        [[0.0, 70.0, 0.0], [0.0, 70.0, 0.0], [0.0, 0.0, 0.0]],
    ),
}


@pytest.mark.parametrize("name", PRESSED_SCENES)
def test_pressed_balls_keep_the_laws_until_rest(name: str) -> None:
    worst = extremes(PRESSED_SCENES[name])
    assert worst.overlap <= 1e-9
    assert worst.outside <= 1e-9
    assert worst.energy_rise <= 1e-12
    assert worst.events < 1000


def test_push_through_a_chain_keeps_it_together() -> None:
    simulation = bs.Simulation(in_a_row((0.0, 120.0), (0.0, 0.0), (0.0, 0.0)))
    simulation.run(until=0.05)
    gaps = np.diff(simulation.positions[:, 0]) - 2.0 * RADIUS
    assert gaps == pytest.approx([0.0, 0.0], abs=1e-9)
    # a = mu_s g - f1, each of the two pushed balls gives way by 5/7 of its net push
    assert simulation.velocities[0, 0] > 0.05 * 0.5 * SLIDING / 3.0


def test_pieces_of_a_contact_give_the_bits_of_one_run() -> None:
    scene = PRESSED_SCENES["oblique push"]
    whole, pieces = bs.Simulation(scene), bs.Simulation(scene)
    events = whole.run(until=1.0)
    collected = [event for _ in range(1000) for event in pieces.advance(0.001)]
    assert collected == list(events)
    assert np.array_equal(pieces.positions, whole.positions)


def test_row_on_a_rail_does_not_overlap_where_one_ball_stops_beside_a_rolling_one() -> None:
    places = [[0.6 + 2.0 * RADIUS * index, TABLE.y_min + RADIUS] for index in range(6)]
    spins = [[0, 0, 0], [0, 0, 0], [294, -95, 0], [71, 1, 0], [300, -12, 0], [0, 0, 0]]
    assert depth_at_every_instant(bs.Scene(places, None, spins), until=1.2627746) <= 1e-9


@pytest.mark.parametrize("first", range(0, 20, 5))
def test_pressed_rows_do_not_overlap_at_any_instant(first: int) -> None:
    for seed in range(first, first + 5):
        assert depth_at_every_instant(frozen_row(seed)) <= 1e-9, seed


@pytest.mark.skipif(not COMPILED, reason="takes minutes")
@pytest.mark.parametrize("seed", [98, 1168, 1383, 1484, 1625, 1856, 3105])
def test_rows_in_which_little_yields_do_not_overlap_at_any_instant(seed: int) -> None:
    assert depth_at_every_instant(frozen_row(seed), until=20.0) <= 1e-9


def test_ball_that_slides_through_a_gap_between_a_rail_and_another_gets_through() -> None:
    # It touches both where the gap is narrowest, and pushes the other aside by less than 1e-12 m.
    narrow = 2e-13
    across = 2.0 * RADIUS - narrow
    start = [AT_X_MAX, 0.6 - 1e-6]
    scene = bs.Scene([start, [AT_X_MAX - across, 0.6]], [[0.0, 0.02], [0.0, 0.0]], [[-0.02 / RADIUS, 0, 0], [0, 0, 0]])
    simulation = bs.Simulation(scene)
    events = simulation.run()
    assert len(events) < 1000
    assert simulation.positions[0, 1] == pytest.approx(start[1] + 0.02**2 / (2.0 * ROLLING), abs=1e-9)
