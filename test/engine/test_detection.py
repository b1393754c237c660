# SPDX-License-Identifier: Apache-2.0
"""Contact times against roots of the quartic found by other means."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from billiards_sim.engine.kernels.detection import contact_time, rail_contact_time

DIAMETER = 0.05715
LEAST = 1e-15


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    """Micrometres and the like: no denormals, which no scene has and polynomial solvers choke on."""
    return st.integers(round(low * 1e6), round(high * 1e6)).map(lambda value: value * 1e-6)


coordinate = numbers(-1.5, 1.5)
velocity = numbers(-5.0, 5.0)
acceleration = numbers(-4.0, 4.0)


def polynomial_roots(ascending: list) -> list:
    mpmath = pytest.importorskip("mpmath")
    while ascending and abs(ascending[-1]) < mpmath.mpf(10) ** -50:
        ascending = ascending[:-1]
    return mpmath.polyroots(ascending, maxsteps=500, extraprec=400, asc=True) if len(ascending) > 1 else []


def exact_contact_time(px, py, vx, vy, ax, ay, horizon) -> float:
    """First root of |q|^2 - D^2 from above, by mpmath's polynomial roots to 40 digits."""
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(60):
        px, py, vx, vy, ax, ay = (mpmath.mpf(value) for value in (px, py, vx, vy, ax, ay))
        quartic = [
            px * px + py * py - mpmath.mpf(DIAMETER) ** 2,
            2 * (px * vx + py * vy),
            vx * vx + vy * vy + px * ax + py * ay,
            vx * ax + vy * ay,
            (ax * ax + ay * ay) / 4,
        ]
        roots = polynomial_roots(quartic)
        real = [mpmath.re(root) for root in roots if abs(mpmath.im(root)) < mpmath.mpf(10) ** -30]
        inside = [root for root in real if 0 <= root <= horizon]
        return float(min(inside)) if inside else math.inf


def miss_distance(px, py, vx, vy, ax, ay, horizon) -> float:
    """Smallest gap over the horizon, on a fine grid, m."""
    t = np.linspace(0.0, horizon, 20001)
    return float(np.hypot(px + (vx + 0.5 * ax * t) * t, py + (vy + 0.5 * ay * t) * t).min()) - DIAMETER


@settings(max_examples=300)
@given(coordinate, coordinate, velocity, velocity, acceleration, acceleration, st.floats(0.01, 2.0))
def test_first_contact_is_the_first_root(px, py, vx, vy, ax, ay, horizon) -> None:
    if math.hypot(px, py) <= 1.001 * DIAMETER:
        return
    found = contact_time(px, py, vx, vy, ax, ay, horizon, DIAMETER, LEAST)
    expected = exact_contact_time(px, py, vx, vy, ax, ay, horizon)
    if math.isinf(found) != math.isinf(expected):
        # Only a graze that nobody can tell from a miss in double precision, or a root on the horizon itself.
        end = math.hypot(px + (vx + ax * horizon / 2) * horizon, py + (vy + ay * horizon / 2) * horizon)
        assert abs(miss_distance(px, py, vx, vy, ax, ay, horizon)) < 1e-7 or abs(end - DIAMETER) < 1e-12
    elif math.isfinite(found):
        distance = math.hypot(px + (vx + ax * found / 2) * found, py + (vy + ay * found / 2) * found)
        assert distance == pytest.approx(DIAMETER, abs=1e-14)
        wx, wy = vx + ax * found, vy + ay * found
        qx, qy = px + (vx + ax * found / 2) * found, py + (vy + ay * found / 2) * found
        approach = -(qx * wx + qy * wy) / DIAMETER
        if approach > 1e-2:
            assert found == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("share", [-1e-3, -1e-6, -1e-9, -1e-11, 1e-11, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("angle", [0.0, 0.3, 1.1, 2.9])
def test_graze_and_near_miss_are_told_apart(share: float, angle: float) -> None:
    # A straight pass at distance 2R (1 + share).
    aside = DIAMETER * (1.0 + share)
    c, s = math.cos(angle), math.sin(angle)
    px, py = -0.5 * c - aside * s, -0.5 * s + aside * c
    found = contact_time(px, py, 2.0 * c, 2.0 * s, 0.0, 0.0, 1.0, DIAMETER, LEAST)
    assert math.isfinite(found) == (share < 0.0)


def test_what_touches_and_approaches_is_a_contact_now() -> None:
    assert contact_time(DIAMETER, 0.0, -1e-6, 0.0, 0.0, 0.0, 1.0, DIAMETER, LEAST) == 0.0
    assert contact_time(DIAMETER - 1e-10, 0.0, -1e-6, 0.0, 0.0, 0.0, 1.0, DIAMETER, LEAST) == 0.0


def test_what_touches_and_separates_is_no_contact() -> None:
    assert contact_time(DIAMETER, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, DIAMETER, LEAST) == math.inf
    assert contact_time(DIAMETER - 1e-10, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, DIAMETER, LEAST) == math.inf


def test_what_touches_and_passes_along_is_no_contact() -> None:
    assert contact_time(DIAMETER, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, DIAMETER, LEAST) == math.inf


def test_what_separates_and_is_pulled_back_is_a_contact_when_it_returns() -> None:
    found = contact_time(DIAMETER, 0.0, 0.5, 0.0, -2.0, 0.0, 1.0, DIAMETER, LEAST)
    assert found == pytest.approx(0.5, rel=1e-14)


def test_overlapping_pair_that_cannot_separate_is_a_contact_when_it_has_turned_back() -> None:
    # Overlap 1e-4 m, separating at 1e-3 m/s, pulled back at 1 m/s^2: turns after 1 ms and is 1e-13 m closer soon after.
    found = contact_time(DIAMETER - 1e-4, 0.0, 1e-3, 0.0, -1.0, 0.0, 1.0, DIAMETER, LEAST)
    assert found == pytest.approx(1e-3 + math.sqrt(2e-13), rel=1e-6)


def test_touching_pair_pushed_together_is_a_contact_as_soon_as_it_is_closer_for_certain() -> None:
    found = contact_time(DIAMETER, 0.0, 0.0, 0.0, -2.0, 0.0, 1.0, DIAMETER, LEAST)
    assert found == pytest.approx(math.sqrt(1e-13), rel=1e-3)
    assert rail_contact_time(0.0, 0.0, 2.0, LEAST) == pytest.approx(math.sqrt(1e-13), rel=1e-3)


def test_just_collided_pair_is_not_collided_again_by_rounding() -> None:
    assert contact_time(DIAMETER - 1e-17, 0.0, -1e-18, 1.0, 0.0, 0.0, 1.0, DIAMETER, LEAST) == math.inf


@given(numbers(0.0, 2.0), velocity, acceleration)
def test_rail_contact_is_where_the_parabola_meets_the_rail(distance, speed, pull) -> None:
    mpmath = pytest.importorskip("mpmath")
    found = rail_contact_time(distance, speed, pull, LEAST)
    with mpmath.workdps(40):
        d, v, a = mpmath.mpf(distance), mpmath.mpf(speed), mpmath.mpf(pull)
        entering = [
            t.real for t in polynomial_roots([-d, v, a / 2]) if t.imag == 0 and t.real >= 0 and v + a * t.real > 0
        ]
        first = float(min(entering)) if entering else math.inf
    grazing = speed * speed + 2.0 * pull * distance < 1e-12
    if not grazing and (distance, speed) != (0.0, 0.0):
        assert found == pytest.approx(first, rel=1e-9, abs=1e-12)
