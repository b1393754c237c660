# SPDX-License-Identifier: Apache-2.0
"""Contact times of a million pairs and 100 000 grazes against solutions in exact arithmetic (test/data).

What double precision can do: the engine evaluates q = p + (v + a t/2) t and |q| - D. With u = 2^-53 a component of q is
wrong by at most u (|a| t^2/2 + 2 |q - p| + |q|), one rounding for each operation, and |q| - D by at most

    delta = u (sqrt(2) (|a| t^2/2 + 2 |q - p| + D) + 2 D),

some 1e-15 m across a table. So a closest distance within delta of D may be taken for a hit or a miss, and no other. At
the time found the true gap is within delta, and as much as the approach speed c covers in the last place of t. Around
the contact the gap is -c s + k s^2/2; as long as delta <= c^2/2k, the depth of the dip, a gap within delta needs
c |s| <= 2 delta. In a shallower dip |s| <= sqrt(2 (depth + delta)/k), half the width of one that deep.
"""

from __future__ import annotations

import importlib.util
import math
from types import ModuleType
from typing import NamedTuple

import numpy as np
import pytest
from checks import COMPILED, DATA
from numpy.typing import NDArray

import billiards_sim as bs
from billiards_sim.engine import machine
from billiards_sim.engine.kernels.detection import contact_time
from billiards_sim.engine.moment import constants_of

FILE = DATA / "contact_times.npz"
LEAST = constants_of(bs.scenes.head_on()).least_approach
ROUNDING = 2.0**-53
TANGENT = 1e-12
"""Relative to D. What comes no nearer to D than this, or goes no deeper, may be a hit or a miss."""
SLOW = 1e-3
"""m/s. An approach this fast is no tangent one."""

Array = NDArray[np.float64]


def load_script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_contact_times", DATA / "make_contact_times.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


script = load_script()
DIAMETER = script.DIAMETER


class Pairs(NamedTuple):
    inputs: Array
    """(N, 7) relative position, velocity and acceleration, and horizon."""
    exact: Array
    """(N,) s, INF for a miss."""
    margin: Array
    """(N,) relative distance from tangency, INF where it is large."""
    found: Array
    """(N,) s, by the engine."""


class Hits(NamedTuple):
    """Of the pairs that both call a hit, with what they have at the exact contact."""

    error: Array
    """s"""
    approach: Array
    """m/s"""
    curvature: Array
    """m/s^2, second derivative of the gap"""
    margin: Array
    rounding: Array
    """m, of the distance: delta of the head of this file."""
    last_place: Array
    """s, of the time."""


@pytest.fixture(scope="module", params=["random", "grazing"])
def kind(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def pairs(kind: str) -> Pairs:
    """All pairs when the engine is compiled, the first 50 000 when it is interpreted."""
    inputs = script.pairs(kind, None if COMPILED else 1)
    exact, margin = (column[: len(inputs)] for column in script.read(FILE)[kind])
    found = np.array([machine.function(contact_time)(*pair, DIAMETER, LEAST) for pair in inputs.tolist()])
    return Pairs(inputs, exact, margin, found)


def distance_rounding(inputs: Array, t: Array, moved: Array) -> Array:
    """delta of the head of this file, m, at t when q has moved this far from p."""
    bend = 0.5 * np.hypot(inputs[:, 4], inputs[:, 5]) * t * t
    return ROUNDING * (math.sqrt(2.0) * (bend + 2.0 * moved + DIAMETER) + 2.0 * DIAMETER)


@pytest.fixture(scope="module")
def hits(pairs: Pairs) -> Hits:
    both = np.isfinite(pairs.exact) & np.isfinite(pairs.found)
    inputs, t = pairs.inputs[both], pairs.exact[both]
    px, py, vx, vy, ax, ay, _ = inputs.T
    moved_x, moved_y = (vx + 0.5 * ax * t) * t, (vy + 0.5 * ay * t) * t
    qx, qy, wx, wy = px + moved_x, py + moved_y, vx + ax * t, vy + ay * t
    distance = np.hypot(qx, qy)
    approach = -(qx * wx + qy * wy) / distance
    return Hits(
        error=np.abs(pairs.found[both] - t),
        approach=approach,
        curvature=(wx * wx + wy * wy + qx * ax + qy * ay - approach * approach) / distance,
        margin=np.abs(pairs.margin[both]),
        rounding=distance_rounding(inputs, t, np.hypot(moved_x, moved_y)),
        last_place=np.spacing(t),
    )


def test_pairs_are_those_that_were_solved(pairs: Pairs, kind: str) -> None:
    with np.load(FILE) as data:
        digests = data[f"{kind}_digest"]
    assert script.digest(pairs.inputs[: script.BLOCK]) == digests[0]
    if COMPILED:
        assert script.digest(pairs.inputs) == digests[1]


def test_solutions_come_out_again(pairs: Pairs, kind: str) -> None:
    for i in range(0, script.BLOCK, 500):
        time, margin = script.solve(pairs.inputs[i].tolist(), kind == "grazing")
        assert time == pairs.exact[i]
        if kind == "grazing":
            assert np.float32(margin) == np.float32(pairs.margin[i])


def test_solutions_are_the_first_roots_that_a_polynomial_solver_finds(pairs: Pairs) -> None:
    mpmath = pytest.importorskip("mpmath")
    apart = np.hypot(pairs.inputs[:, 0], pairs.inputs[:, 1]) > 1.00001 * DIAMETER
    curved = (pairs.inputs[:, 4] != 0.0) | (pairs.inputs[:, 5] != 0.0)
    hit = np.isfinite(pairs.exact)
    for chosen in (apart & curved & hit, apart & curved & ~hit):
        for i in np.flatnonzero(chosen)[:20]:
            with mpmath.workdps(50):
                px, py, vx, vy, ax, ay, horizon = (mpmath.mpf(number) for number in pairs.inputs[i].tolist())
                quartic = [
                    px * px + py * py - mpmath.mpf(DIAMETER) ** 2,
                    2 * (px * vx + py * vy),
                    vx * vx + vy * vy + px * ax + py * ay,
                    vx * ax + vy * ay,
                    (ax * ax + ay * ay) / 4,
                ]
                roots = mpmath.polyroots(quartic, maxsteps=1000, extraprec=800, asc=True)
                real = [root.real for root in roots if abs(root.imag) < mpmath.mpf(10) ** -30]
                first = float(min((root for root in real if 0 < root <= horizon), default=mpmath.inf))
            assert pairs.exact[i] == first


def test_no_contact_is_missed_and_none_invented(pairs: Pairs, kind: str) -> None:
    wrong = np.isfinite(pairs.found) != np.isfinite(pairs.exact)
    told_apart = np.abs(pairs.margin) >= TANGENT
    assert not np.any(wrong & told_apart)
    assert np.all(told_apart) if kind == "random" else np.mean(told_apart) > 0.8
    share = np.mean(np.isfinite(pairs.exact))
    assert 0.2 < share < 0.6  # there is something to miss, and to invent


def test_only_what_rounding_hides_is_misjudged(pairs: Pairs) -> None:
    wrong = np.isfinite(pairs.found) != np.isfinite(pairs.exact)
    inputs = pairs.inputs[wrong]
    moved = np.hypot(inputs[:, 0], inputs[:, 1]) + DIAMETER
    rounding = distance_rounding(inputs, inputs[:, 6], moved)
    assert np.all(np.abs(pairs.margin[wrong]) * DIAMETER <= rounding)


def test_times_are_right_to_a_picosecond_away_from_tangency(hits: Hits) -> None:
    away = hits.approach >= SLOW
    assert np.mean(away) > 0.25
    assert np.all(hits.error[away] <= 1e-12)


def test_time_error_is_what_the_rounding_of_the_distance_makes_of_it(hits: Hits) -> None:
    deep = hits.margin * DIAMETER >= hits.rounding
    assert np.mean(deep) > 0.9
    bound = 2.0 * hits.rounding + hits.approach * hits.last_place
    assert np.all((hits.error * hits.approach <= bound)[deep])


def test_contacts_that_rounding_may_hide_are_found_within_the_dip(hits: Hits, kind: str) -> None:
    shallow = hits.margin * DIAMETER < hits.rounding
    if kind == "grazing":
        assert np.any(shallow)
    depth = hits.margin * DIAMETER + hits.rounding
    assert np.all((0.5 * hits.curvature * hits.error**2 <= depth)[shallow])
