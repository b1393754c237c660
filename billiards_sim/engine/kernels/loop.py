# SPDX-License-Identifier: Apache-2.0
"""The event loop: take the earliest event, let it happen, predict again what it changed."""

from __future__ import annotations

from .cluster import bring_all, closing_speed, gather, reflect
from .contact import bring, hold, is_held, presses_ball, presses_rail, release_ball, update_contacts
from .impact import (
    approach_speed,
    collide_balls,
    collide_rail,
    normal_between,
    normal_of_rail,
    subsides,
)
from .kernel import kernel
from .log import log_event, log_impact
from .motion import begin_motion, end_phase, phase_of
from .schedule import change_cell, enter_all, mark, predict_border, predict_pairs, predict_rail
from .state import (
    AT_REST,
    INF,
    NOBODY,
    RESTED,
    ROLLED,
    ROLLING,
    SLIDING,
    Constants,
    State,
)

DONE = 0
"""No event is left before the time asked for."""

PAUSED = 1
"""The work allowed is done, or the log is full; there may be more to do."""

CONTACTS_PER_BALL = 5
"""At most: equal discs have at most three contacts with others each, counted once, and two rails."""


@kernel
def run_until(state: State, until: float, taken: int, work: int) -> int:
    """Let every event up to and including a time happen, until so much work is done; returns DONE or PAUSED.

    `taken` is the number of events since the clock was at 0 that have been copied from the log: once all of them are,
    the log begins again.
    """
    clock = state.clock[0]
    constants = state.constants[0]
    if taken == clock.logged:
        clock.events = 0
    room = len(state.log) - (CONTACTS_PER_BALL + 1) * len(state.balls)  # the most that happens at one instant
    if not clock.begun:
        clock.begun = True
        enter_all(state, constants)
    _resume(state, constants, clock.now)
    enough = clock.work + work
    while clock.work < enough:
        i = state.nodes[1].ball
        ball = state.balls[i]
        now = ball.event_time
        if now > until or now == INF:
            return DONE
        if clock.events > room:
            return PAUSED
        clock.now = now
        clock.passes += 1
        clock.work += 1
        if ball.hit_time == now and ball.hit == NOBODY:
            predict_pairs(state, constants, i, now)
        elif ball.hit_time == now:
            _meet_ball(state, constants, min(i, ball.hit), max(i, ball.hit), now)
        elif ball.rail_time == now:
            _meet_rail(state, constants, i, ball.rail, now)
        elif ball.phase_end != now:
            change_cell(state, constants, i)
            predict_border(ball, constants, now)
            predict_pairs(state, constants, i, now)
        elif ball.held > 0:
            bring(state, constants, i, now)
        else:
            end_phase(ball, constants)
            mark(state, i)
        _resume(state, constants, now)
    return PAUSED


@kernel
def _meet_ball(state: State, constants: Constants, i: int, j: int, now: float) -> None:
    bring(state, constants, i, now)
    bring(state, constants, j, now)
    first, second = state.balls[i], state.balls[j]
    nx, ny = normal_between(first, second)
    approach = approach_speed(first, second, nx, ny)
    if approach <= constants.least_approach:
        approach = 0.0
    if presses_ball(first, second, nx, ny, approach, constants):
        if approach > 0.0:
            log_impact(state, constants, now, i, j, nx, ny, approach, constants.mass * approach)
        hold(state, i, j)
        bring(state, constants, i, now)
    elif approach > 0.0 and subsides(min(first.bounces, second.bounces), approach, constants):
        _join_all(state, constants, i, now)
    elif approach > 0.0:
        count = gather(state, constants, i, now)
        if count > 1:
            _meet_all(state, constants, count, now)
            return
        collide_balls(first, second, nx, ny, approach)
        log_impact(state, constants, now, i, j, nx, ny, approach, constants.mass * approach)
        _let_go(state, i)
        _let_go(state, j)


@kernel
def _meet_all(state: State, constants: Constants, count: int, now: float) -> None:
    # The contacts of a cluster at the same instant.
    bring_all(state, constants, count, now)
    reflect(state, constants, count)
    for c in range(count):
        impact = state.impacts[c]
        if impact.impulse == 0.0:
            continue
        i, j = impact.first, impact.second
        log_impact(state, constants, now, i, j, impact.normal_x, impact.normal_y, impact.approach, impact.impulse)
        _let_go(state, i)
        if j >= 0:
            _let_go(state, j)


@kernel
def _join_all(state: State, constants: Constants, i: int, now: float) -> None:
    # Everything that touches ball i, and what touches that, stays together. All of it at once: a ball that slides
    # through a gap between two others would hit one and the other in turn.
    count = gather(state, constants, i, now)
    bring_all(state, constants, count, now)
    for c in range(count):
        impact = state.impacts[c]
        first, second = impact.first, impact.second
        closing = closing_speed(state, impact)
        if closing > constants.least_approach:
            impulse = constants.mass * closing
            log_impact(state, constants, now, first, second, impact.normal_x, impact.normal_y, closing, impulse)
        if not is_held(state, first, second):
            hold(state, first, second)
    bring(state, constants, i, now)


@kernel
def _let_go(state: State, i: int) -> None:
    # After an impact what pushed a ball is no longer what decides.
    if state.balls[i].held > 0:
        release_ball(state, i)


@kernel
def _meet_rail(state: State, constants: Constants, i: int, rail: int, now: float) -> None:
    bring(state, constants, i, now)
    ball = state.balls[i]
    nx, ny = normal_of_rail(rail)
    # Where it is but for rounding.
    if nx != 0.0:
        ball.x = -nx * constants.limit_x
    else:
        ball.y = -ny * constants.limit_y
    approach = -(nx * ball.vx + ny * ball.vy)
    if approach <= constants.least_approach:
        approach = 0.0
    if approach > 0.0:
        impulse = constants.mass * (1.0 + constants.restitution) * approach
        log_impact(state, constants, now, i, -1 - rail, nx, ny, approach, impulse)
    if presses_rail(ball, nx, ny, approach, constants):
        hold(state, i, -1 - rail)
        bring(state, constants, i, now)
    elif approach > 0.0 and subsides(ball.bounces, approach, constants):
        _join_all(state, constants, i, now)
    elif approach > 0.0:
        collide_rail(ball, nx, constants)
        _let_go(state, i)


@kernel
def _resume(state: State, constants: Constants, now: float) -> None:
    # Set going every ball that is marked as changed, in sustained contact or free, and predict it again.
    clock = state.clock[0]
    for k in range(clock.changed):
        i = state.changed[k].ball
        ball = state.balls[i]
        if ball.held > 0 and ball.phase_end <= now:
            update_contacts(state, constants, i, now)
    for k in range(clock.changed):
        i = state.changed[k].ball
        ball = state.balls[i]
        ball.changed = False
        if ball.held == 0:
            begin_motion(ball, phase_of(ball, constants), constants)
        _report_phase(state, i, now)
        predict_rail(ball, constants)
        predict_border(ball, constants, now)
    for k in range(clock.changed):
        predict_pairs(state, constants, state.changed[k].ball, now)
    clock.changed = 0


@kernel
def _report_phase(state: State, i: int, now: float) -> None:
    # Log the end of a slip or of a motion.
    ball = state.balls[i]
    phase = ball.phase
    before = ball.reported
    ball.reported = phase
    if (phase == ROLLING and before == SLIDING) or (phase == AT_REST and before != AT_REST):
        kind = ROLLED if phase == ROLLING else RESTED
        log_event(state, now, kind, i, NOBODY, ball.x, ball.y, 0.0, 0.0, 0.0, 0.0)
