"""Impacts at the same instant: every contact of a cluster of touching balls solved together.

Generalized reflections (Smith, Kaufman, Vouga, Tamstorf and Grinspun, "Reflections on Simultaneous Impact", 2012): all
contacts that close are stopped together by the smallest impulses that do it, and the same impulses, times the
restitution, are given once more. That reflects the velocity at the face of what is allowed, so momentum and energy are
kept and the symmetry of the balls too. Contacts that close after that are reflected in turn, which carries a shock
through a row of balls, until none closes. The result does not depend on the order of the balls.
"""

from __future__ import annotations

import math

from billiards_sim.engine.detection import TOUCH
from billiards_sim.engine.impact import normal_between, normal_of_rail
from billiards_sim.engine.jit import Rows, kernel
from billiards_sim.engine.motion import anchor
from billiards_sim.engine.state import (
    AX,
    AY,
    CHANGED,
    I_APPROACH,
    I_FIRST,
    I_IMPULSE,
    I_NORMAL_X,
    I_NORMAL_Y,
    I_SECOND,
    I_SHARE,
    MEMBER,
    TIME,
    VX,
    VY,
    Constants,
    State,
    X,
    Y,
)

CLOSING_ROUNDING = 1e-14
"""Relative to the fastest approach in the cluster: contacts that close more slowly have been stopped."""

SHARE_ROUNDING = 4e-16
"""Relative to the same: accuracy of the impulses that are solved together."""

MAX_SWEEPS = 1000
"""Bound on the sweeps of one reflection and on the number of reflections; a rack needs about a hundred and ten."""


@kernel
def in_touch(ball: Rows, other: Rows, now: float, diameter: float) -> bool:
    """Whether a ball, whose anchor is now, touches another."""
    reach = diameter + TOUCH
    dt = now - other[TIME]
    dx = ball[X] - (other[X] + (other[VX] + 0.5 * other[AX] * dt) * dt)
    if abs(dx) > reach:
        return False
    dy = ball[Y] - (other[Y] + (other[VY] + 0.5 * other[AY] * dt) * dt)
    return abs(dy) <= reach and math.sqrt(dx * dx + dy * dy) <= reach


@kernel
def touches_more(state: State, constants: Constants, i: int, j: int, now: float) -> bool:
    """Whether anything else touches ball i or ball j, which are in contact and anchored now."""
    first, second = state.balls[i], state.balls[j]
    if _at_rail(first, constants) or _at_rail(second, constants):
        return True
    diameter = 2.0 * constants.radius
    for k in range(len(state.balls)):
        if k not in (i, j):
            other = state.balls[k]
            if in_touch(first, other, now, diameter) or in_touch(second, other, now, diameter):
                return True
    return False


@kernel
def _at_rail(ball: Rows, constants: Constants) -> bool:
    return abs(ball[X]) >= constants.limit_x - TOUCH or abs(ball[Y]) >= constants.limit_y - TOUCH


@kernel
def gather(state: State, constants: Constants, start: int, now: float) -> int:
    """List the contacts of the cluster of a ball that is anchored now; its balls are anchored and marked as changed."""
    balls = state.balls
    diameter = 2.0 * constants.radius
    count = 0
    balls[start][MEMBER] = 1.0  # 1: found and anchored, 2: its contacts are listed
    found = True
    while found:
        found = False
        for i in range(len(balls)):
            ball = balls[i]
            if ball[MEMBER] != 1.0:
                continue
            found = True
            ball[MEMBER] = 2.0
            ball[CHANGED] = 1.0
            for j in range(len(balls)):
                other = balls[j]
                if j != i and other[MEMBER] < 2.0 and in_touch(ball, other, now, diameter):
                    other[MEMBER] = 1.0
                    anchor(other, now)
                    first, second = min(i, j), max(i, j)
                    nx, ny = normal_between(balls[first], balls[second])
                    _list(state, count, first, float(second), nx, ny)
                    count += 1
            for rail in range(4):
                nx, ny = normal_of_rail(float(rail))
                limit = constants.limit_x if rail < 2 else constants.limit_y
                if -nx * ball[X] - ny * ball[Y] >= limit - TOUCH:
                    _list(state, count, i, -1.0 - rail, nx, ny)
                    count += 1
    for i in range(len(balls)):
        balls[i][MEMBER] = 0.0
    return count


@kernel
def _list(state: State, index: int, first: int, second: float, nx: float, ny: float) -> None:
    row = state.impacts[index]
    row[I_FIRST] = first
    row[I_SECOND] = second
    row[I_NORMAL_X] = nx
    row[I_NORMAL_Y] = ny
    row[I_APPROACH] = 0.0
    row[I_IMPULSE] = 0.0


@kernel
def _closing(state: State, row: Rows) -> float:
    # Speed at which a contact closes, m/s.
    first = state.balls[int(row[I_FIRST])]
    closing = -first[VX] * row[I_NORMAL_X] - first[VY] * row[I_NORMAL_Y]
    if row[I_SECOND] >= 0.0:
        second = state.balls[int(row[I_SECOND])]
        closing += second[VX] * row[I_NORMAL_X] + second[VY] * row[I_NORMAL_Y]
    return closing


@kernel
def _kick(state: State, row: Rows, kick: float) -> None:
    first = state.balls[int(row[I_FIRST])]
    first[VX] += kick * row[I_NORMAL_X]
    first[VY] += kick * row[I_NORMAL_Y]
    if row[I_SECOND] >= 0.0:
        second = state.balls[int(row[I_SECOND])]
        second[VX] -= kick * row[I_NORMAL_X]
        second[VY] -= kick * row[I_NORMAL_Y]


@kernel
def reflect(state: State, constants: Constants, count: int) -> None:
    """Give the balls of a cluster the velocities after impact; the impulses, N s, stay in the list."""
    fastest = 0.0
    for c in range(count):
        fastest = max(fastest, _closing(state, state.impacts[c]))
    stopped = constants.least_approach + CLOSING_ROUNDING * fastest
    enough = SHARE_ROUNDING * fastest
    for _ in range(MAX_SWEEPS):
        top = 0.0
        for c in range(count):
            row = state.impacts[c]
            closing = _closing(state, row)
            row[I_SHARE] = 0.0 if closing > stopped else -1.0  # -1: not in this reflection
            top = max(top, closing)
            if closing > stopped and row[I_APPROACH] == 0.0:
                row[I_APPROACH] = closing
        if top <= stopped:
            return
        for _ in range(MAX_SWEEPS):
            worst = 0.0
            for c in range(count):
                row = state.impacts[c]
                if row[I_SHARE] >= 0.0:
                    give = 2.0 if row[I_SECOND] >= 0.0 else 1.0
                    share = max(row[I_SHARE] + _closing(state, row) / give, 0.0)
                    change = share - row[I_SHARE]
                    row[I_SHARE] = share
                    _kick(state, row, change)
                    worst = max(worst, abs(change))
            if worst <= enough:
                break
        for c in range(count):
            row = state.impacts[c]
            if row[I_SHARE] > 0.0:
                bounce = 1.0 if row[I_SECOND] >= 0.0 else constants.restitution
                _kick(state, row, bounce * row[I_SHARE])
                row[I_IMPULSE] += constants.mass * (1.0 + bounce) * row[I_SHARE]
