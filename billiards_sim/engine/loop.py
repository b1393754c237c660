"""The event loop: take the earliest event, let it happen, predict again what it changed."""

from __future__ import annotations

from billiards_sim.engine.cluster import gather, reflect, touches_more
from billiards_sim.engine.contact import (
    hold,
    presses_ball,
    presses_rail,
    release_ball,
    settle_contacts,
    update_contacts,
)
from billiards_sim.engine.events import BALL_BALL, BALL_RAIL, RESTED, ROLLED
from billiards_sim.engine.impact import approach_speed, collide_balls, collide_rail, normal_between, normal_of_rail
from billiards_sim.engine.jit import Rows, entry, kernel
from billiards_sim.engine.motion import anchor, begin_motion, end_phase, phase_of
from billiards_sim.engine.schedule import NOBODY, next_event, predict_pairs, predict_rail
from billiards_sim.engine.state import (
    AT_REST,
    CHANGED,
    E_APPROACH,
    E_FIRST,
    E_IMPULSE,
    E_KIND,
    E_NORMAL_X,
    E_NORMAL_Y,
    E_POINT_X,
    E_POINT_Y,
    E_SECOND,
    E_TIME,
    EVENTS,
    HELD,
    HIT,
    HIT_TIME,
    I_APPROACH,
    I_FIRST,
    I_IMPULSE,
    I_NORMAL_X,
    I_NORMAL_Y,
    I_SECOND,
    INF,
    NOW,
    PHASE,
    RAIL,
    RAIL_TIME,
    REPORTED,
    ROLLING,
    SLIDING,
    UPDATE_TIME,
    VX,
    Constants,
    State,
    X,
    Y,
)

DONE = 0
"""No event is left before the time asked for."""

PAUSED = 1
"""The batch is full; there is more to do."""

CONTACTS_PER_BALL = 5
"""At most: equal discs have at most three contacts with others each, counted once, and two rails."""


@entry
def run_until(state: State, constants: Constants, until: float, batch: int) -> int:
    """Let every event up to and including a time happen, at most `batch` of them; returns DONE or PAUSED."""
    clock = state.clock[0]
    room = len(state.log) - (CONTACTS_PER_BALL + 1) * len(state.balls)  # the most that happens at one instant
    for _ in range(batch):
        now, i = next_event(state)
        if now > until or now == INF:
            return DONE
        if clock[EVENTS] > room:
            return PAUSED
        clock[NOW] = now
        if i < 0:
            settle_contacts(state, constants, now)
        else:
            ball = state.balls[i]
            if ball[HIT_TIME] == now:
                j = int(ball[HIT])
                _meet_ball(state, constants, min(i, j), max(i, j), now)
            elif ball[RAIL_TIME] == now:
                _meet_rail(state, constants, i, ball[RAIL], now)
            else:
                end_phase(ball, constants)
        _resume(state, constants, now)
    return PAUSED


@kernel
def _meet_ball(state: State, constants: Constants, i: int, j: int, now: float) -> None:
    first, second = state.balls[i], state.balls[j]
    held = first[HELD] + second[HELD] > 0.0
    if held:
        settle_contacts(state, constants, now)
    anchor(first, now)
    anchor(second, now)
    first[CHANGED] = 1.0
    second[CHANGED] = 1.0
    nx, ny = normal_between(first, second)
    approach = approach_speed(first, second, nx, ny)
    if approach <= constants.least_approach:
        approach = 0.0
    pressed = presses_ball(first, second, nx, ny, approach, constants)
    if not pressed and approach > 0.0 and touches_more(state, constants, i, j, now):
        _meet_all(state, constants, i, now)
        return
    if not pressed:
        collide_balls(first, second, nx, ny, approach)
    if approach > 0.0:
        _log_impact(state, constants, now, i, float(j), nx, ny, approach, constants.mass * approach)
    if pressed:
        hold(state, i, float(j))
        settle_contacts(state, constants, now)
    elif held and approach > 0.0:
        release_ball(state, i)
        release_ball(state, j)


@kernel
def _meet_all(state: State, constants: Constants, start: int, now: float) -> None:
    # Everything that touches the ball `start`, and what touches that, at the same instant.
    settle_contacts(state, constants, now)
    count = gather(state, constants, start, now)
    reflect(state, constants, count)
    for c in range(count):
        impact = state.impacts[c]
        if impact[I_IMPULSE] == 0.0:
            continue
        i, j = int(impact[I_FIRST]), impact[I_SECOND]
        nx, ny = impact[I_NORMAL_X], impact[I_NORMAL_Y]
        _log_impact(state, constants, now, i, j, nx, ny, impact[I_APPROACH], impact[I_IMPULSE])
        release_ball(state, i)
        if j >= 0.0:
            release_ball(state, int(j))


@kernel
def _meet_rail(state: State, constants: Constants, i: int, rail: float, now: float) -> None:
    ball = state.balls[i]
    held = ball[HELD] > 0.0
    if held:
        settle_contacts(state, constants, now)
    anchor(ball, now)
    ball[CHANGED] = 1.0
    axis = int(rail) // 2
    nx, ny = normal_of_rail(rail)
    limit = constants.limit_x if axis == 0 else constants.limit_y
    ball[X + axis] = -(nx + ny) * limit  # where it is but for rounding
    approach = -(nx + ny) * ball[VX + axis]
    if approach <= constants.least_approach:
        approach = 0.0
    pressed = presses_rail(ball, nx, ny, approach, constants)
    if not pressed and approach > 0.0:
        collide_rail(ball, axis, constants)
    if approach > 0.0:
        impulse = constants.mass * (1.0 + constants.restitution) * approach
        _log_impact(state, constants, now, i, -1.0 - rail, nx, ny, approach, impulse)
    if pressed:
        hold(state, i, -1.0 - rail)
        settle_contacts(state, constants, now)
    elif held and approach > 0.0:
        release_ball(state, i)


@kernel
def _resume(state: State, constants: Constants, now: float) -> None:
    # Set going every ball that is marked as changed, in sustained contact or free, and predict it again.
    if state.clock[0][UPDATE_TIME] <= now:
        update_contacts(state, constants, now)
    for i in range(len(state.balls)):
        ball = state.balls[i]
        if ball[CHANGED] > 0.0:
            if ball[HELD] == 0.0:
                begin_motion(ball, phase_of(ball, constants), constants)
            _report_phase(state, i, now)
            predict_rail(ball, constants)
    for i in range(len(state.balls)):
        if state.balls[i][CHANGED] > 0.0:
            state.balls[i][CHANGED] = 0.0
            predict_pairs(state, constants, i, now)


@kernel
def _log_impact(
    state: State,
    constants: Constants,
    now: float,
    i: int,
    j: float,
    nx: float,
    ny: float,
    approach: float,
    impulse: float,
) -> None:
    # Of ball i with ball j, or with rail -1 - j; the normal points to ball i.
    ball = state.balls[i]
    event = _log_event(state, now, BALL_BALL if j >= 0.0 else BALL_RAIL, i, j if j >= 0.0 else -1.0 - j)
    event[E_POINT_X] = ball[X] - constants.radius * nx
    event[E_POINT_Y] = ball[Y] - constants.radius * ny
    event[E_NORMAL_X] = nx
    event[E_NORMAL_Y] = ny
    event[E_APPROACH] = approach
    event[E_IMPULSE] = impulse


@kernel
def _log_event(state: State, now: float, kind: float, first: int, second: float) -> Rows:
    # Append an event to the log and return its row, with no place and no impact yet.
    event = state.log[int(state.clock[0][EVENTS])]
    state.clock[0][EVENTS] += 1.0
    for column in range(len(event)):
        event[column] = 0.0
    event[E_TIME] = now
    event[E_KIND] = kind
    event[E_FIRST] = first
    event[E_SECOND] = second
    return event


@kernel
def _report_phase(state: State, i: int, now: float) -> None:
    # Log the end of a slip or of a motion.
    ball = state.balls[i]
    phase = ball[PHASE]
    before = ball[REPORTED]
    ball[REPORTED] = phase
    if (phase == ROLLING and before == SLIDING) or (phase == AT_REST and before != AT_REST):
        event = _log_event(state, now, ROLLED if phase == ROLLING else RESTED, i, NOBODY)
        event[E_POINT_X] = ball[X]
        event[E_POINT_Y] = ball[Y]
