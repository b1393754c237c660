# SPDX-License-Identifier: Apache-2.0
"""Impacts at the same instant: every contact of a cluster of touching balls solved together.

Generalized reflections (Smith, Kaufman, Vouga, Tamstorf and Grinspun, "Reflections on Simultaneous Impact", 2012): all
contacts that close are stopped together by the smallest impulses that do it, and the same impulses, times the
restitution, are given once more. That reflects the velocity at the face of what is allowed, so momentum and, among
balls, energy are kept, and their symmetry too. Contacts that close after that are reflected in turn, which carries a
shock through a row of balls, until none closes. After each reflection its contacts rub together. The result does not
depend on the order of the balls.
"""

from __future__ import annotations

import math

from .feature import normal_of
from .impact import normal_between
from .kernel import kernel
from .law.cushion import rub_at_cushion, slip_at_cushion
from .law.throw import friction_at, rub_pair, rubs, slip_of_pair
from .shock import advance_to
from .state import Constants, Impact, State

CLOSING_ROUNDING = 1e-14
"""Relative to the fastest approach in the cluster: contacts that close more slowly have been stopped."""

STOPPING_ROUNDING = 4e-16
"""Relative to the same: accuracy of the impulses that are solved together."""

SLIP_ROUNDING = 1e-15
"""Relative to the fastest slip in the cluster: accuracy of the tangential impulses that are solved together."""

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
        if rubs(constants) or constants.rail_friction > 0.0:
            _rub(state, constants, count)


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
            row.stopping += part * bounce
            row.impulse += constants.mass * row.stopping


@kernel
def _restitution(row: Impact, constants: Constants) -> float:
    # Along the horizontal normal. Of what comes back from a tilted nose the vertical part is dropped.
    if row.second >= 0:
        return constants.ball_restitution
    if constants.nose_sine == 0.0:
        return constants.rail_restitution
    return (1.0 + constants.rail_restitution) * constants.nose_cosine * constants.nose_cosine - 1.0


@kernel
def _rub(state: State, constants: Constants, count: int) -> None:
    # Friction of all contacts of a reflection at once: the tangential impulses within Coulomb's bounds that leave the
    # least kinetic energy, by sweeps over them (projected Gauss-Seidel). There is one such motion whatever the order,
    # and as it begins at none, none gains.
    most = 0.0
    for c in range(count):
        row = state.impacts[c]
        row.along = 0.0
        row.over = 0.0
        row.grip = 0.0
        if row.stopping > 0.0:
            along, over = _slip(state, row, constants)
            slip = math.sqrt(along * along + over * over)
            row.grip = row.stopping * _friction(row, slip, constants)
            most = max(most, slip)
    for _ in range(MAX_SWEEPS):
        state.clock[0].work += count
        worst = 0.0
        for c in range(count):
            row = state.impacts[c]
            if row.grip > 0.0:
                worst = max(worst, _rub_contact(state, row, constants))
        if worst <= SLIP_ROUNDING * most:
            break
    for c in range(count):
        row = state.impacts[c]
        state.balls[row.first].vz = 0.0
        if row.second >= 0:
            state.balls[row.second].vz = 0.0


@kernel
def _rub_contact(state: State, row: Impact, constants: Constants) -> float:
    # Give one contact the tangential impulse that ends its slip, or as much as it can take; returns the change, m/s.
    along, over = _slip(state, row, constants)
    share = 1.0 / 7.0 if row.second >= 0 else 2.0 / 7.0
    new_along = row.along - share * along
    new_over = row.over - share * over
    size = math.sqrt(new_along * new_along + new_over * new_over)
    if size > row.grip:
        new_along *= row.grip / size
        new_over *= row.grip / size
    change_along = new_along - row.along
    change_over = new_over - row.over
    row.along = new_along
    row.over = new_over
    first = state.balls[row.first]
    nx, ny = row.normal_x, row.normal_y
    if row.second >= 0:
        rub_pair(first, state.balls[row.second], nx, ny, change_along, change_over, constants.radius)
    else:
        rub_at_cushion(first, nx, ny, change_along, change_over, constants)
    return max(abs(change_along), abs(change_over))


@kernel
def _slip(state: State, row: Impact, constants: Constants) -> tuple[float, float]:
    first = state.balls[row.first]
    if row.second >= 0:
        return slip_of_pair(first, state.balls[row.second], row.normal_x, row.normal_y, constants.radius)
    return slip_at_cushion(first, row.normal_x, row.normal_y, constants)


@kernel
def _friction(row: Impact, slip: float, constants: Constants) -> float:
    # Over the impulse along the horizontal normal.
    return friction_at(slip, constants) if row.second >= 0 else constants.rail_friction / constants.nose_cosine
