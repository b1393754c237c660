"""What comes next: the predicted contacts of every ball, and the earliest of them.

The predicted contact of each pair is kept in a symmetric matrix, its minimum along a row with the ball. An event
changes the motion of one or two balls; only their rows are predicted again. For the few dozen balls of a table a scan
of the row minima finds the next event faster than a heap would.
"""

from __future__ import annotations

from billiards_sim.engine.detection import contact_time, rail_contact_time
from billiards_sim.engine.events import X_MAX, X_MIN, Y_MAX, Y_MIN
from billiards_sim.engine.jit import Rows, kernel
from billiards_sim.engine.state import (
    AX,
    AY,
    CONTACTS,
    FIRST,
    HELD,
    HELD_X,
    HELD_Y,
    HIT,
    HIT_TIME,
    INF,
    PHASE_END,
    RAIL,
    RAIL_TIME,
    SECOND,
    TIME,
    UPDATE_TIME,
    VX,
    VY,
    Constants,
    State,
    X,
    Y,
)

NOBODY = -1.0
"""Where a ball or a rail could stand, and none does."""


@kernel
def predict_rail(ball: Rows, constants: Constants) -> None:
    """Find the next rail contact of a ball, from its anchor on."""
    best = INF
    rail = NOBODY
    least = constants.least_approach
    if ball[HELD_X] == 0.0 and (ball[VX] != 0.0 or ball[AX] != 0.0):
        low = rail_contact_time(ball[X] + constants.limit_x, -ball[VX], -ball[AX], least)
        high = rail_contact_time(constants.limit_x - ball[X], ball[VX], ball[AX], least)
        best, rail = (low, X_MIN) if low < high else (high, X_MAX)
    if ball[HELD_Y] == 0.0 and (ball[VY] != 0.0 or ball[AY] != 0.0):
        low = rail_contact_time(ball[Y] + constants.limit_y, -ball[VY], -ball[AY], least)
        high = rail_contact_time(constants.limit_y - ball[Y], ball[VY], ball[AY], least)
        if low < best:
            best, rail = low, Y_MIN
        if high < best:
            best, rail = high, Y_MAX
    ball[RAIL_TIME] = ball[TIME] + best
    ball[RAIL] = rail


@kernel
def _horizon(ball: Rows, clock: Rows) -> float:
    # Until when the motion of a ball stays what it is, as far as the ball alone decides.
    end = min(ball[PHASE_END], ball[RAIL_TIME])
    return min(end, clock[UPDATE_TIME]) if ball[HELD] > 0.0 else end


@kernel
def _hold_each_other(state: State, i: int, j: int) -> bool:
    for c in range(int(state.clock[0][CONTACTS])):
        first, second = state.contacts[c][FIRST], state.contacts[c][SECOND]
        if (first == i and second == j) or (first == j and second == i):
            return True
    return False


@kernel
def predict_pairs(state: State, constants: Constants, i: int, now: float) -> None:
    """Predict the contacts of ball i, whose anchor is now, with every other ball."""
    balls = state.balls
    clock = state.clock[0]
    mine = balls[i]
    diameter = 2.0 * constants.radius
    own_horizon = _horizon(mine, clock)
    moving = mine[VX] != 0.0 or mine[VY] != 0.0 or mine[AX] != 0.0 or mine[AY] != 0.0
    row = state.pairs[i]
    best = INF
    partner = NOBODY
    for j in range(len(balls)):
        if j == i:
            continue
        other = balls[j]
        dt = now - other[TIME]
        vx = other[VX] + other[AX] * dt
        vy = other[VY] + other[AY] * dt
        time = INF
        if moving or vx != 0.0 or vy != 0.0 or other[AX] != 0.0 or other[AY] != 0.0:
            horizon = min(own_horizon, _horizon(other, clock)) - now
            time = now + contact_time(
                mine[X] - (other[X] + (other[VX] + 0.5 * other[AX] * dt) * dt),
                mine[Y] - (other[Y] + (other[VY] + 0.5 * other[AY] * dt) * dt),
                mine[VX] - vx,
                mine[VY] - vy,
                mine[AX] - other[AX],
                mine[AY] - other[AY],
                horizon,
                diameter,
                constants.least_approach,
            )
            if time < INF and mine[HELD] > 0.0 and other[HELD] > 0.0 and _hold_each_other(state, i, j):
                time = INF
        row[j] = time
        state.pairs[j][i] = time
        if time < best:
            best = time
            partner = float(j)
        if time < other[HIT_TIME]:
            other[HIT_TIME] = time
            other[HIT] = i
        elif other[HIT] == i:
            _find_partner(state, j)
    mine[HIT_TIME] = best
    mine[HIT] = partner


@kernel
def _find_partner(state: State, i: int) -> None:
    row = state.pairs[i]
    best = INF
    partner = NOBODY
    for j in range(len(row)):
        if row[j] < best:
            best = row[j]
            partner = float(j)
    state.balls[i][HIT_TIME] = best
    state.balls[i][HIT] = partner


@kernel
def next_event(state: State) -> tuple[float, int]:
    """Time of the next event and its ball, or -1 for an update.

    The events of one instant come in the order of the balls' indices.
    """
    best = state.clock[0][UPDATE_TIME]
    who = -1
    balls = state.balls
    for i in range(len(balls)):
        ball = balls[i]
        time = min(ball[PHASE_END], ball[RAIL_TIME], ball[HIT_TIME])
        if time < best:
            best = time
            who = i
    return best, who
