# SPDX-License-Identifier: Apache-2.0
"""Off the table and back: balls that fall into a pocket, and balls that are laid down again."""

from __future__ import annotations

import math

from .cells import enter_cell, leave_cell
from .island import release_ball
from .kernel import kernel
from .log import log_event
from .motion import mark, unmark
from .schedule import reschedule
from .shock.phase import advance_to
from .shock.touch import forget_touches
from .state import AT_REST, INF, MOUTH, NOBODY, OFF_TABLE, POCKETED, Ball, Constants, State


@kernel
def falls(state: State, ball: Ball, now: float) -> bool:
    """Whether what happens to a ball now is that it falls into a pocket."""
    return ball.feature_time == now and ball.hit_time != now and state.features[ball.feature].kind == MOUTH


@kernel
def first_due(state: State, i: int, now: float) -> int:
    """Of the balls to which something happens now, the one whose turn it is: ball i, unless it falls and another does
    not. Whatever else happens at the same instant comes before."""
    if not falls(state, state.balls[i], now):
        return i
    for j in range(len(state.balls)):
        if state.balls[j].event_time == now and not falls(state, state.balls[j], now):
            return j
    return i


@kernel
def pocket(state: State, constants: Constants, i: int, k: int, now: float) -> None:
    """Ball i, which is at `now`, falls into the mouth k: it lies in the middle of it, where nothing meets it."""
    ball = state.balls[i]
    speed = math.sqrt(ball.vx * ball.vx + ball.vy * ball.vy)
    log_event(state, now, POCKETED, i, k, ball.x, ball.y, 0.0, 0.0, speed, 0.0)
    release_ball(state, i)
    unmark(state, i)
    _take_off(state, constants, i)
    _lay_to_rest(ball, state.features[k].x, state.features[k].y, now)
    ball.phase = OFF_TABLE
    ball.feature = k


@kernel
def lay_down(state: State, i: int, now: float, x: float, y: float) -> None:
    """Put ball i at rest where there is room for it, from wherever it is."""
    constants = state.constants[0]
    clock = state.clock[0]
    clock.now = now
    clock.events = 0
    ball = state.balls[i]
    if clock.begun and ball.phase != OFF_TABLE:
        advance_to(state, constants, i, now)
        release_ball(state, i)
        forget_touches(state, constants, i, now)
        _take_off(state, constants, i)
    _lay_to_rest(ball, x - constants.centre_x, y - constants.centre_y, now)
    ball.phase = AT_REST
    ball.feature = 0
    if clock.begun:
        enter_cell(state, constants, i)
        mark(state, i)


@kernel
def _take_off(state: State, constants: Constants, i: int) -> None:
    # From its cell, the tree and the predictions of others, who have to look again when they were to meet it.
    leave_cell(state, constants, i)
    for j in range(len(state.balls)):
        if state.balls[j].hit == i:
            state.balls[j].hit = NOBODY
    ball = state.balls[i]
    ball.horizon = INF
    ball.hit_time = INF
    reschedule(state, i)


@kernel
def _lay_to_rest(ball: Ball, x: float, y: float, now: float) -> None:
    ball.time = now
    ball.x = x
    ball.y = y
    ball.vx = 0.0
    ball.vy = 0.0
    ball.ax = 0.0
    ball.ay = 0.0
    ball.wx = 0.0
    ball.wy = 0.0
    ball.wz = 0.0
    ball.alpha_x = 0.0
    ball.alpha_y = 0.0
    ball.alpha_z = 0.0
    ball.phase_end = INF
    ball.bounces = 0
    ball.reported = AT_REST
