# SPDX-License-Identifier: Apache-2.0
"""Impacts at the same instant: every contact of a cluster of touching balls solved together.

Generalized reflections (Smith, Kaufman, Vouga, Tamstorf and Grinspun, "Reflections on Simultaneous Impact", 2012): all
contacts that close are stopped together by the smallest impulses that do it, and the same impulses, times the
restitution, are given once more. That reflects the velocity at the face of what is allowed, so momentum and, among
balls, energy are kept, and their symmetry too. Contacts that close after that are reflected in turn, which carries a
shock through a row of balls, until none closes. The result does not depend on the order of the balls.
"""

from __future__ import annotations

import math

from .feature import normal_of
from .impact import normal_between
from .kernel import kernel
from .settle import advance_to
from .state import Constants, Impact, State

CLOSING_ROUNDING = 1e-14
"""Relative to the fastest approach in the cluster: contacts that close more slowly have been stopped."""

STOPPING_ROUNDING = 4e-16
"""Relative to the same: accuracy of the impulses that are solved together."""

GAIN_ROUNDING = 1e-13
"""Relative: a bounce that gives this much more than was there is rounding."""

MAX_SWEEPS = 1000
"""Bound on the sweeps of one reflection and on the number of reflections; a rack needs about a hundred and ten."""


@kernel
def advance_all(state: State, constants: Constants, count: int, now: float) -> None:
    """Bring the balls of a cluster to its instant and set the normals of its contacts."""
    for c in range(count):
        row = state.impacts[c]
        advance_to(state, constants, row.first, now)
        if row.second >= 0:
            advance_to(state, constants, row.second, now)
    for c in range(count):
        row = state.impacts[c]
        if row.second >= 0:
            row.normal_x, row.normal_y = normal_between(state.balls[row.first], state.balls[row.second])
        else:
            row.normal_x, row.normal_y = normal_of(state, -1 - row.second)


@kernel
def closing_speed(state: State, row: Impact) -> float:
    """Speed at which a contact closes, m/s."""
    first = state.balls[row.first]
    closing = -first.vx * row.normal_x - first.vy * row.normal_y
    if row.second >= 0:
        second = state.balls[row.second]
        closing += second.vx * row.normal_x + second.vy * row.normal_y
    return closing


@kernel
def _kick(state: State, row: Impact, kick: float) -> None:
    first = state.balls[row.first]
    first.vx += kick * row.normal_x
    first.vy += kick * row.normal_y
    if row.second >= 0:
        second = state.balls[row.second]
        second.vx -= kick * row.normal_x
        second.vy -= kick * row.normal_y


@kernel
def reflect(state: State, constants: Constants, count: int) -> None:
    """Give the balls of a cluster the velocities after impact; the impulses, N s, stay in the list."""
    fastest = 0.0
    for c in range(count):
        fastest = max(fastest, closing_speed(state, state.impacts[c]))
    stopped = constants.least_approach + CLOSING_ROUNDING * fastest
    enough = STOPPING_ROUNDING * fastest
    for _ in range(MAX_SWEEPS):
        top = 0.0
        for c in range(count):
            row = state.impacts[c]
            closing = closing_speed(state, row)
            row.stopping = 0.0 if closing > stopped else -1.0  # -1: not in this reflection
            row.closing = closing
            top = max(top, closing)
            if closing > stopped and row.approach == 0.0:
                row.approach = closing
        if top <= stopped:
            return
        for _ in range(MAX_SWEEPS):
            state.clock[0].work += count
            worst = 0.0
            for c in range(count):
                row = state.impacts[c]
                if row.stopping >= 0.0:
                    bodies = 2.0 if row.second >= 0 else 1.0
                    stopping = max(row.stopping + closing_speed(state, row) / bodies, 0.0)
                    change = stopping - row.stopping
                    row.stopping = stopping
                    _kick(state, row, change)
                    worst = max(worst, abs(change))
            if worst <= enough:
                break
        _bounce(state, constants, count)


@kernel
def _bounce(state: State, constants: Constants, count: int) -> None:
    # Give the impulses that stopped the contacts once more, times the restitution.
    spent = 0.0  # twice the energy per mass that stopping took
    gained = 0.0  # and that the bounce gives
    for c in range(count):
        row = state.impacts[c]
        if row.stopping > 0.0:
            spent += row.stopping * row.closing
            _kick(state, row, _restitution(row, constants) * row.stopping)
    for c in range(count):
        row = state.impacts[c]
        if row.stopping > 0.0:
            gained -= _restitution(row, constants) * row.stopping * closing_speed(state, row)
    # Less of it where rails and balls together would give more than was there, as different restitutions can.
    part = math.sqrt(spent / gained) if gained > spent * (1.0 + GAIN_ROUNDING) else 1.0
    for c in range(count):
        row = state.impacts[c]
        if row.stopping > 0.0:
            bounce = _restitution(row, constants) * row.stopping
            if part < 1.0:
                _kick(state, row, (part - 1.0) * bounce)
            row.impulse += constants.mass * (row.stopping + part * bounce)


@kernel
def _restitution(row: Impact, constants: Constants) -> float:
    return 1.0 if row.second >= 0 else constants.rail_restitution
