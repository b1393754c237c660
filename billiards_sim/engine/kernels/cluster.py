# SPDX-License-Identifier: Apache-2.0
"""Impacts at the same instant: every contact of a cluster of touching balls solved together.

Generalized reflections (Smith, Kaufman, Vouga, Tamstorf and Grinspun, "Reflections on Simultaneous Impact", 2012): all
contacts that close are stopped together by the smallest impulses that do it, and the same impulses, times the
restitution, are given once more. That reflects the velocity at the face of what is allowed, so momentum and, among
balls, energy are kept, and their symmetry too. Contacts that close after that are reflected in turn, which carries a
shock through a row of balls, until none closes. After each reflection its contacts rub together. What is left of a
vertical velocity is then dropped, as after an impact of two. The result does not depend on the order of the balls.
"""

from __future__ import annotations

import math

from .feature import normal_of
from .impact import normal_between
from .kernel import kernel
from .law.cushion import rub_at_cushion, slip_at_cushion, tilts_or_rubs
from .law.throw import friction_at, rub_pair, rubs, slip_of_pair
from .shock.phase import advance_to
from .state import Ball, Constants, Impact, State

CLOSING_ROUNDING = 1e-14
"""Relative to the fastest approach in the cluster: contacts that close more slowly have been stopped."""

STOPPING_ROUNDING = 4e-16
"""Relative to the same: accuracy of the impulses that are solved together."""

SLIP_ROUNDING = 4e-16
"""Relative to the fastest surface in the cluster: accuracy of the tangential impulses that are solved together."""

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
            first = state.balls[row.first]
            row.normal_x, row.normal_y = normal_of(state, -1 - row.second, first.x, first.y)


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
def _closing_at_contact(state: State, row: Impact, constants: Constants) -> float:
    # The same along the normal at the contact, which a high nose tilts down (`law.cushion`).
    closing = closing_speed(state, row)
    if row.second < 0 and constants.nose_sine != 0.0:
        return constants.nose_cosine * closing + constants.nose_sine * state.balls[row.first].vz
    return closing


@kernel
def _kick(state: State, row: Impact, kick: float, constants: Constants) -> None:
    first = state.balls[row.first]
    level = kick
    if row.second < 0 and constants.nose_sine != 0.0:
        level = constants.nose_cosine * kick
        first.vz -= constants.nose_sine * kick
    first.vx += level * row.normal_x
    first.vy += level * row.normal_y
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
            row.closing = _closing_at_contact(state, row, constants)
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
                    stopping = max(row.stopping + _closing_at_contact(state, row, constants) / bodies, 0.0)
                    change = stopping - row.stopping
                    row.stopping = stopping
                    _kick(state, row, change, constants)
                    worst = max(worst, abs(change))
            if worst <= enough:
                break
        _bounce(state, constants, count)
        if rubs(constants) or constants.rail_friction > 0.0:
            _rub(state, constants, count)
        if rubs(constants) or tilts_or_rubs(constants):
            _drop(state, count)


@kernel
def _bounce(state: State, constants: Constants, count: int) -> None:
    # Give the impulses that stopped the contacts once more, times the restitution.
    spent = 0.0  # twice the energy per mass that stopping took
    gained = 0.0  # and that the bounce gives
    for c in range(count):
        row = state.impacts[c]
        if row.stopping > 0.0:
            spent += row.stopping * row.closing
            _kick(state, row, _restitution(row, constants) * row.stopping, constants)
    for c in range(count):
        row = state.impacts[c]
        if row.stopping > 0.0:
            gained -= _restitution(row, constants) * row.stopping * _closing_at_contact(state, row, constants)
    # Less of it where rails and balls together would give more than was there, as different restitutions can.
    part = math.sqrt(spent / gained) if gained > spent * (1.0 + GAIN_ROUNDING) else 1.0
    for c in range(count):
        row = state.impacts[c]
        if row.stopping > 0.0:
            bounce = _restitution(row, constants) * row.stopping
            if part < 1.0:
                _kick(state, row, (part - 1.0) * bounce, constants)
            row.stopping += part * bounce
            level = row.stopping
            if row.second < 0 and constants.nose_sine != 0.0:
                level = constants.nose_cosine * row.stopping
            row.impulse += constants.mass * level


@kernel
def _restitution(row: Impact, constants: Constants) -> float:
    return constants.ball_restitution if row.second >= 0 else constants.rail_restitution


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
            most = max(most, slip, _surface_speed(state.balls[row.first], constants))
            if row.second >= 0:
                most = max(most, _surface_speed(state.balls[row.second], constants))
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
        if row.second < 0 and constants.nose_sine != 0.0:
            row.impulse += constants.mass * constants.nose_sine * row.over


@kernel
def _surface_speed(ball: Ball, constants: Constants) -> float:
    # A bound, m/s.
    return abs(ball.vx) + abs(ball.vy) + constants.radius * (abs(ball.wx) + abs(ball.wy) + abs(ball.wz))


@kernel
def _drop(state: State, count: int) -> None:
    # The balls stay on the cloth.
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
    return friction_at(slip, constants) if row.second >= 0 else constants.rail_friction
