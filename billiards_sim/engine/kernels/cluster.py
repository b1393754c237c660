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

from .contact import bring
from .detection import TOUCH
from .impact import normal_between, normal_of_rail
from .kernel import kernel
from .motion import place_at
from .schedule import first_neighbour, hold_each_other, next_neighbour
from .state import LISTED, NOBODY, QUEUED, Constants, Impact, State

CLOSING_ROUNDING = 1e-14
"""Relative to the fastest approach in the cluster: contacts that close more slowly have been stopped."""

SHARE_ROUNDING = 4e-16
"""Relative to the same: accuracy of the impulses that are solved together."""

GAIN_ROUNDING = 1e-13
"""Relative: a bounce that gives this much more than was there is rounding."""

MAX_SWEEPS = 1000
"""Bound on the sweeps of one reflection and on the number of reflections; a rack needs about a hundred and ten."""


@kernel
def gather(state: State, constants: Constants, start: int, now: float) -> int:
    """List the contacts of everything that touches the ball `start`, and of what touches that; returns their number."""
    balls = state.balls
    members = state.members
    members[0].ball = start
    balls[start].member = QUEUED
    impacts = 0
    count = 1
    done = 0
    while done < count:
        i = members[done].ball
        done += 1
        balls[i].member = LISTED
        x, y = place_at(balls[i], now)
        for rail in range(4):
            nx, ny = normal_of_rail(rail)
            limit = constants.limit_x if nx != 0.0 else constants.limit_y
            if -nx * x - ny * y >= limit - TOUCH:
                _list(state, impacts, i, -1 - rail)
                impacts += 1
        j = first_neighbour(state, constants, i)
        while j != NOBODY:
            other = balls[j]
            if other.member != LISTED and _in_touch(state, constants, i, j, x, y, now):
                if other.member != QUEUED:
                    other.member = QUEUED
                    members[count].ball = j
                    count += 1
                _list(state, impacts, min(i, j), max(i, j))
                impacts += 1
            j = next_neighbour(state, constants, i, j)
    for k in range(count):
        balls[members[k].ball].member = 0
    return impacts


@kernel
def _in_touch(state: State, constants: Constants, i: int, j: int, x: float, y: float, now: float) -> bool:
    # Whether ball i, at (x, y), touches ball j.
    reach = 2.0 * constants.radius + TOUCH
    other_x, other_y = place_at(state.balls[j], now)
    dx = x - other_x
    dy = y - other_y
    if abs(dx) > reach or abs(dy) > reach:
        return False
    if math.sqrt(dx * dx + dy * dy) <= reach:
        return True
    return state.balls[i].held > 0 and state.balls[j].held > 0 and hold_each_other(state, i, j)


@kernel
def _list(state: State, index: int, first: int, second: int) -> None:
    row = state.impacts[index]
    row.first = first
    row.second = second
    row.approach = 0.0
    row.impulse = 0.0


@kernel
def bring_all(state: State, constants: Constants, count: int, now: float) -> None:
    """Bring the balls of a cluster to its instant and set the normals of its contacts."""
    for c in range(count):
        row = state.impacts[c]
        bring(state, constants, row.first, now)
        if row.second >= 0:
            bring(state, constants, row.second, now)
    for c in range(count):
        row = state.impacts[c]
        if row.second >= 0:
            row.normal_x, row.normal_y = normal_between(state.balls[row.first], state.balls[row.second])
        else:
            row.normal_x, row.normal_y = normal_of_rail(-1 - row.second)


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
    enough = SHARE_ROUNDING * fastest
    for _ in range(MAX_SWEEPS):
        top = 0.0
        for c in range(count):
            row = state.impacts[c]
            closing = closing_speed(state, row)
            row.share = 0.0 if closing > stopped else -1.0  # -1: not in this reflection
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
                if row.share >= 0.0:
                    give = 2.0 if row.second >= 0 else 1.0
                    share = max(row.share + closing_speed(state, row) / give, 0.0)
                    change = share - row.share
                    row.share = share
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
        if row.share > 0.0:
            spent += row.share * row.closing
            _kick(state, row, _restitution(row, constants) * row.share)
    for c in range(count):
        row = state.impacts[c]
        if row.share > 0.0:
            gained -= _restitution(row, constants) * row.share * closing_speed(state, row)
    # Less of it where rails and balls together would give more than was there, as different restitutions can.
    part = math.sqrt(spent / gained) if gained > spent * (1.0 + GAIN_ROUNDING) else 1.0
    for c in range(count):
        row = state.impacts[c]
        if row.share > 0.0:
            bounce = _restitution(row, constants) * row.share
            if part < 1.0:
                _kick(state, row, (part - 1.0) * bounce)
            row.impulse += constants.mass * (row.share + part * bounce)


@kernel
def _restitution(row: Impact, constants: Constants) -> float:
    return 1.0 if row.second >= 0 else constants.restitution
