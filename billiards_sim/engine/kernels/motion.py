# SPDX-License-Identifier: Apache-2.0
"""Closed-form motion of one ball: sliding, rolling, rest (paper equations 13 to 25, put right).

With the contact point at r = (0, 0, -R), the slip is u = v + w x r = (vx - R wy, vy + R wx).

Sliding, u != 0: friction -mu_s m g u/|u| gives a = -mu_s g u/|u| and, with I = 2/5 m R^2,
dw/dt = (r x F)/I = 5/2 mu_s g/R (-uy, ux)/|u|. Both change u along itself, so its direction stays and |u| falls at
7/2 mu_s g: the path is a parabola, slip ends after 2|u|/(7 mu_s g) with v - 2/7 u.
Rolling, u = 0: a = -mu_r g v/|v| with w = (-vy, vx)/R, until v = 0.
Rest. The spin wz about the vertical does not enter: `law.spin`.
"""

from __future__ import annotations

import math

from .kernel import kernel
from .law.spin import spin_after
from .state import AT_REST, INF, ROLLING, SLIDING, Ball, Constants, State

SLIP_SHARE = 2.0 / 7.0
"""Of a slip: what friction takes from the velocity until it has ended. With I = 2/5 m R^2, m R^2/(I + m R^2) is 5/7."""

ROLLING_SHARE = 5.0 / 7.0
"""Of a kick: what is left of it once the ball rolls again."""

GRIP = 3.5
"""Times the acceleration of sliding friction: how fast friction ends a slip, and the push that a ball can roll with."""

SLIP_ROUNDING = 1e-12
"""Relative to |v| + R|w|: a slip this small is rounding of v = R w, the ball rolls."""


@kernel
def mark(state: State, i: int) -> None:
    """Note that the motion of ball i has changed: it is to be set going, and predicted again."""
    if not state.balls[i].changed:
        state.balls[i].changed = True
        state.changed[state.clock[0].changed].ball = i
        state.clock[0].changed += 1


@kernel
def unmark(state: State, i: int) -> None:
    """Note that ball i, which is marked, is not to be set going."""
    clock = state.clock[0]
    state.balls[i].changed = False
    clock.changed -= 1
    k = 0
    while state.changed[k].ball != i:
        k += 1
    for later in range(k, clock.changed):
        state.changed[later].ball = state.changed[later + 1].ball


@kernel
def mobility(phase: int) -> float:
    """Change of velocity by a unit impulse per mass, on the average over fine bounces.

    A sliding ball takes it whole. A rolling one is kicked into a slip that friction ends again, a resting one stays.
    """
    if phase == SLIDING:
        return 1.0
    return ROLLING_SHARE if phase == ROLLING else 0.0


@kernel
def slip(ball: Ball, radius: float) -> tuple[float, float]:
    """Velocity of the contact point over the cloth, m/s (equations 13 and 14)."""
    return ball.vx - radius * ball.wy, ball.vy + radius * ball.wx


@kernel
def place_at(ball: Ball, time: float) -> tuple[float, float]:
    """Centre of a ball at a time in its present motion, m."""
    dt = time - ball.time
    return ball.x + (ball.vx + 0.5 * ball.ax * dt) * dt, ball.y + (ball.vy + 0.5 * ball.ay * dt) * dt


@kernel
def velocity_at(ball: Ball, time: float) -> tuple[float, float]:
    """Velocity of a ball at a time in its present motion, m/s."""
    dt = time - ball.time
    return ball.vx + ball.ax * dt, ball.vy + ball.ay * dt


@kernel
def anchor(ball: Ball, time: float) -> None:
    """Move the anchor of a ball along its motion to a later time."""
    dt = time - ball.time
    ball.x, ball.y = place_at(ball, time)
    ball.vx, ball.vy = velocity_at(ball, time)
    ball.wx += ball.alpha_x * dt
    ball.wy += ball.alpha_y * dt
    if ball.alpha_z != 0.0:
        ball.wz = spin_after(ball.wz, ball.alpha_z, dt)
    ball.time = time


@kernel
def roll_off(ball: Ball, radius: float) -> None:
    """End the slip of a ball: what friction makes of v and w by the time that u = 0."""
    ux, uy = slip(ball, radius)
    ball.vx -= SLIP_SHARE * ux
    ball.vy -= SLIP_SHARE * uy
    ball.wx = -ball.vy / radius
    ball.wy = ball.vx / radius


@kernel
def phase_of(ball: Ball, constants: Constants) -> int:
    """The phase that velocity and spin of a ball stand for."""
    ux, uy = slip(ball, constants.radius)
    speed = math.sqrt(ball.vx * ball.vx + ball.vy * ball.vy)
    spin = constants.radius * math.sqrt(ball.wx * ball.wx + ball.wy * ball.wy)
    if math.sqrt(ux * ux + uy * uy) > max(SLIP_ROUNDING * (speed + spin), constants.rest_speed):
        return SLIDING
    return ROLLING if speed > constants.rest_speed else AT_REST


@kernel
def begin_motion(ball: Ball, phase: int, constants: Constants) -> None:
    """Set accelerations and end of a phase that begins at the anchor (equations 15 to 25)."""
    ball.phase = phase
    ball.ax = 0.0
    ball.ay = 0.0
    ball.alpha_x = 0.0
    ball.alpha_y = 0.0
    ball.phase_end = INF
    if phase == AT_REST:
        ball.vx = 0.0
        ball.vy = 0.0
        ball.wx = 0.0
        ball.wy = 0.0
    elif phase == SLIDING and constants.sliding > 0.0:
        ux, uy = slip(ball, constants.radius)
        speed = math.sqrt(ux * ux + uy * uy)
        ball.ax = -constants.sliding * (ux / speed)
        ball.ay = -constants.sliding * (uy / speed)
        ball.alpha_x = 2.5 * ball.ay / constants.radius
        ball.alpha_y = -2.5 * ball.ax / constants.radius
        ball.phase_end = ball.time + SLIP_SHARE * speed / constants.sliding
    elif phase == ROLLING and constants.rolling > 0.0:
        speed = math.sqrt(ball.vx * ball.vx + ball.vy * ball.vy)
        ball.ax = -constants.rolling * (ball.vx / speed)
        ball.ay = -constants.rolling * (ball.vy / speed)
        ball.alpha_x = -ball.ay / constants.radius
        ball.alpha_y = ball.ax / constants.radius
        ball.phase_end = ball.time + speed / constants.rolling


@kernel
def end_phase(ball: Ball, constants: Constants) -> None:
    """Move a ball to the end of its phase: from sliding it rolls, from rolling it rests."""
    if ball.phase == SLIDING:
        vx, vy, wx, wy = ball.vx, ball.vy, ball.wx, ball.wy
        anchor(ball, ball.phase_end)
        # From the state before the slide rather than at its end: exact, where the end of the slide is rounded.
        ball.vx, ball.vy, ball.wx, ball.wy = vx, vy, wx, wy
        roll_off(ball, constants.radius)
    else:
        anchor(ball, ball.phase_end)
        ball.vx, ball.vy, ball.wx, ball.wy = 0.0, 0.0, 0.0, 0.0
