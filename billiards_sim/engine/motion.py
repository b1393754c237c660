"""Closed-form motion of one ball: sliding, rolling, rest (paper equations 13 to 25, put right).

With the contact point at r = (0, 0, -R), the slip is u = v + w x r = (vx - R wy, vy + R wx).

Sliding, u != 0: friction -mu_s m g u/|u| gives a = -mu_s g u/|u| and, with I = 2/5 m R^2,
dw/dt = (r x F)/I = 5/2 mu_s g/R (-uy, ux)/|u|. Both change u along itself, so its direction stays and |u| falls at
7/2 mu_s g: the path is a parabola, slip ends after 2|u|/(7 mu_s g) with v - 2/7 u.
Rolling, u = 0: a = -mu_r g v/|v| with w = (-vy, vx)/R, until v = 0.
Rest. The spin wz about the vertical has no friction and keeps its value.
"""

from __future__ import annotations

import math

from billiards_sim.engine.jit import Rows, kernel
from billiards_sim.engine.state import (
    ALPHA_X,
    ALPHA_Y,
    AT_REST,
    AX,
    AY,
    CHANGED,
    INF,
    PHASE,
    PHASE_END,
    ROLLING,
    SLIDING,
    TIME,
    VX,
    VY,
    WX,
    WY,
    Constants,
    X,
    Y,
)

SLIP_ROUNDING = 1e-12
"""Relative to |v| + R|w|: a slip this small is rounding of v = R w, the ball rolls."""


@kernel
def slip(ball: Rows, radius: float) -> tuple[float, float]:
    """Velocity of the contact point over the cloth, m/s (equations 13 and 14)."""
    return ball[VX] - radius * ball[WY], ball[VY] + radius * ball[WX]


@kernel
def anchor(ball: Rows, time: float) -> None:
    """Move the anchor of a ball along its motion to a later time."""
    dt = time - ball[TIME]
    ball[TIME] = time
    ball[X] += (ball[VX] + 0.5 * ball[AX] * dt) * dt
    ball[Y] += (ball[VY] + 0.5 * ball[AY] * dt) * dt
    ball[VX] += ball[AX] * dt
    ball[VY] += ball[AY] * dt
    ball[WX] += ball[ALPHA_X] * dt
    ball[WY] += ball[ALPHA_Y] * dt


@kernel
def roll_off(ball: Rows, radius: float) -> None:
    """End the slip of a ball: what friction makes of v and w by the time that u = 0."""
    ux, uy = slip(ball, radius)
    ball[VX] -= 2.0 / 7.0 * ux
    ball[VY] -= 2.0 / 7.0 * uy
    ball[WX] = -ball[VY] / radius
    ball[WY] = ball[VX] / radius


@kernel
def phase_of(ball: Rows, constants: Constants) -> float:
    """The phase that velocity and spin of a ball stand for."""
    ux, uy = slip(ball, constants.radius)
    speed = math.sqrt(ball[VX] * ball[VX] + ball[VY] * ball[VY])
    spin = constants.radius * math.sqrt(ball[WX] * ball[WX] + ball[WY] * ball[WY])
    if math.sqrt(ux * ux + uy * uy) > max(SLIP_ROUNDING * (speed + spin), constants.rest_speed):
        return SLIDING
    return ROLLING if speed > constants.rest_speed else AT_REST


@kernel
def begin_motion(ball: Rows, phase: float, constants: Constants) -> None:
    """Set accelerations and end of a phase that begins at the anchor (equations 15 to 25)."""
    ball[PHASE] = phase
    ball[AX] = 0.0
    ball[AY] = 0.0
    ball[ALPHA_X] = 0.0
    ball[ALPHA_Y] = 0.0
    ball[PHASE_END] = INF
    if phase == AT_REST:
        ball[VX] = 0.0
        ball[VY] = 0.0
        ball[WX] = 0.0
        ball[WY] = 0.0
    elif phase == SLIDING and constants.sliding > 0.0:
        ux, uy = slip(ball, constants.radius)
        speed = math.sqrt(ux * ux + uy * uy)
        ball[AX] = -constants.sliding * (ux / speed)
        ball[AY] = -constants.sliding * (uy / speed)
        ball[ALPHA_X] = 2.5 * ball[AY] / constants.radius
        ball[ALPHA_Y] = -2.5 * ball[AX] / constants.radius
        ball[PHASE_END] = ball[TIME] + 2.0 / 7.0 * speed / constants.sliding
    elif phase == ROLLING and constants.rolling > 0.0:
        speed = math.sqrt(ball[VX] * ball[VX] + ball[VY] * ball[VY])
        ball[AX] = -constants.rolling * (ball[VX] / speed)
        ball[AY] = -constants.rolling * (ball[VY] / speed)
        ball[ALPHA_X] = -ball[AY] / constants.radius
        ball[ALPHA_Y] = ball[AX] / constants.radius
        ball[PHASE_END] = ball[TIME] + speed / constants.rolling


@kernel
def end_phase(ball: Rows, constants: Constants) -> None:
    """Move a ball to the end of its phase, mark it as changed: from sliding it rolls, from rolling it rests."""
    ball[CHANGED] = 1.0
    if ball[PHASE] == SLIDING:
        vx, vy, wx, wy = ball[VX], ball[VY], ball[WX], ball[WY]
        anchor(ball, ball[PHASE_END])
        # From the state before the slide rather than at its end: exact, where the end of the slide is rounded.
        ball[VX], ball[VY], ball[WX], ball[WY] = vx, vy, wx, wy
        roll_off(ball, constants.radius)
    else:
        anchor(ball, ball[PHASE_END])
        ball[VX], ball[VY], ball[WX], ball[WY] = 0.0, 0.0, 0.0, 0.0
