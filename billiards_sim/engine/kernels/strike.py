# SPDX-License-Identifier: Apache-2.0
"""The cue shot (paper equations 1 to 12), in the shot's own frame: x' along the force, y' to its left, z' up.

The cue pushes with a constant force F for its contact time T. Level, with the tip at
r = (-sqrt(R^2 - side^2 - up^2), side, up), its torque r x F is (0, up F, -side F). With the butt raised by an angle, x'
points down by it and z' leans forward: the same torque is then (-side F sin, up F, -side F cos) along the table, to the
left and up, the ball gets F T/m cos along the table, and the cloth takes the part that points down, without friction
(Coriolis 1835).
"""

from __future__ import annotations

import math

from .detection import contact_time
from .feature import first_contact
from .island import release_ball
from .kernel import kernel
from .law.squirt import squirt
from .log import log_event
from .motion import place_at
from .shock.phase import advance_to
from .state import AT_REST, NOBODY, OFF_TABLE, ROLLING, SHOT, SLIDING, State


@kernel
def begin_anew(state: State) -> None:
    """Set the clock back to 0 where all balls rest: what is on the table is as at a start, nothing is predicted."""
    for i in range(len(state.balls)):
        ball = state.balls[i]
        ball.time = 0.0
        ball.vx = 0.0
        ball.vy = 0.0
        ball.ax = 0.0
        ball.ay = 0.0
        ball.wx = 0.0
        ball.wy = 0.0
        ball.alpha_x = 0.0
        ball.alpha_y = 0.0
        if ball.alpha_z != 0.0:  # it has come to its end since
            ball.wz = 0.0
            ball.alpha_z = 0.0
        ball.held = 0
        ball.touches = 0
        ball.held_at = 0
        ball.reported = AT_REST
        ball.bounces = 0
        ball.changed = False
    clock = state.clock[0]
    clock.begun = False
    clock.now = 0.0
    clock.passes = 0
    clock.work = 0
    clock.changed = 0
    clock.contacts = 0
    clock.touches = 0
    clock.events = 0
    clock.logged = 0


@kernel
def strike(
    state: State,
    i: int,
    now: float,
    fx: float,
    fy: float,
    fz: float,
    along: float,
    side: float,
    up: float,
) -> None:
    """Hit ball i, which rests, and log it; the events before are taken from the log.

    (fx, fy, fz) N is the force and `along` the size of its part along the table; the tip hits `side` and `up` m from
    the centre, across the cue.
    """
    constants = state.constants[0]
    clock = state.clock[0]
    clock.now = now
    clock.events = 0
    if clock.begun:
        advance_to(state, constants, i, now)
        release_ball(state, i)
    ball = state.balls[i]
    # From where the ball is said to be, whose last bit may be another than that of its centred place.
    x = ball.x + constants.centre_x - constants.centre_x
    y = ball.y + constants.centre_y - constants.centre_y
    time = constants.cue_contact_time
    mass, radius = constants.mass, constants.radius
    way_x = 0.5 * fx / mass * time * time
    way_y = 0.5 * fy / mass * time * time
    way = _free_way(state, i, now, x, y, way_x, way_y)
    dx, dy = fx / along, fy / along
    inertia = 0.4 * mass * radius * radius
    force = along if fz == 0.0 else math.sqrt(along * along + fz * fz)
    spin_per_up = force * time / inertia
    spin_per_side = along * time / inertia
    ball.time = now
    ball.x = x + way * way_x
    ball.y = y + way * way_y
    ball.vx = fx / mass * time
    ball.vy = fy / mass * time
    ball.wx = ball.wx + -dy * up * spin_per_up
    ball.wy = ball.wy + dx * up * spin_per_up
    ball.wz = ball.wz + -side * spin_per_side
    if fz < 0.0:
        spin_ahead = side * fz * time / inertia
        ball.wx += dx * spin_ahead
        ball.wy += dy * spin_ahead
    if constants.cue_end_mass > 0.0:
        squirt(ball, side, constants)
    ball.phase = SLIDING
    ball.reported = ROLLING
    behind = math.sqrt(max(radius * radius - side * side - up * up, 0.0))
    if fz < 0.0:
        behind = (behind * along + up * fz) / force
    tip_x = x + (-behind * dx - side * dy)
    tip_y = y + (-behind * dy + side * dx)
    log_event(state, now, SHOT, i, NOBODY, tip_x, tip_y, dx, dy, 0.0, along * time)


@kernel
def _free_way(state: State, i: int, now: float, x: float, y: float, way_x: float, way_y: float) -> float:
    # Share of the displacement under the cue (equation 3), 0 to 1, that ends at the first ball or rail in the way.
    constants = state.constants[0]
    feature_time, _ = first_contact(state, x, y, way_x, way_y, 0.0, 0.0, 0, 1.0, 0.0)
    way = min(1.0, feature_time)
    for j in range(len(state.balls)):
        if j != i and state.balls[j].phase != OFF_TABLE:
            other_x, other_y = place_at(state.balls[j], now)
            way = min(
                way,
                contact_time(x - other_x, y - other_y, way_x, way_y, 0.0, 0.0, 1.0, 2.0 * constants.radius, 0.0),
            )
    return way
