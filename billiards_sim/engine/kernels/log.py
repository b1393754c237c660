# SPDX-License-Identifier: Apache-2.0
"""The log of events that the kernels keep until it is taken from them."""

from __future__ import annotations

from .kernel import kernel
from .state import BALL_BALL, BALL_RAIL, Constants, State


@kernel
def log_impact(
    state: State,
    constants: Constants,
    now: float,
    i: int,
    j: int,
    nx: float,
    ny: float,
    approach: float,
    impulse: float,
) -> None:
    """Log an impact of ball i with ball j, or with feature -1 - j; the normal points to ball i."""
    ball = state.balls[i]
    point_x = ball.x - constants.radius * nx
    point_y = ball.y - constants.radius * ny
    kind = BALL_BALL if j >= 0 else BALL_RAIL
    other = j if j >= 0 else -1 - j
    log_event(state, now, kind, i, other, point_x, point_y, nx, ny, approach, impulse)


@kernel
def log_event(
    state: State,
    now: float,
    kind: int,
    first: int,
    second: int,
    point_x: float,
    point_y: float,
    normal_x: float,
    normal_y: float,
    approach: float,
    impulse: float,
) -> None:
    """Log an event, with the fields of `Record`."""
    event = state.log[state.clock[0].events]
    state.clock[0].events += 1
    state.clock[0].logged += 1
    event.time = now
    event.kind = kind
    event.first = first
    event.second = second
    event.point_x = point_x
    event.point_y = point_y
    event.normal_x = normal_x
    event.normal_y = normal_y
    event.approach = approach
    event.impulse = impulse
