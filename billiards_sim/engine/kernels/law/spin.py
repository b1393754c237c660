# SPDX-License-Identifier: Apache-2.0
"""Spin about the vertical: the cloth takes it at a steady rate, whatever else the ball does (Alciatore).

A ball that spins on the patch where it touches the cloth feels a drilling torque mu_sp m g R against its spin. With
I = 2/5 m R^2 the spin falls at 5 mu_sp g/(2 R) until it is 0, where it stays. Nothing else depends on it between
impacts, so its end is no event: it is read where it matters.
"""

from __future__ import annotations

import math

from ..kernel import kernel
from ..state import INF, Ball, Constants, State

STEP = 2.3e-16
"""Relative: to the next number or the one after it."""

LEAST_TIME = 1e-300
"""s. What comes after 0."""


@kernel
def slow_spin(ball: Ball, constants: Constants) -> None:
    """Set how the spin of a ball about the vertical falls from its anchor on."""
    ball.alpha_z = -math.copysign(constants.spin_deceleration, ball.wz) if ball.wz != 0.0 else 0.0


@kernel
def spin_after(wz: float, alpha_z: float, duration: float) -> float:
    """What is left of a spin about the vertical, rad/s, after so many s."""
    change = alpha_z * duration
    return 0.0 if abs(change) >= abs(wz) else wz + change


@kernel
def last_spin_end(state: State, now: float) -> float:
    """The first time from `now` on, s, at which no ball spins about the vertical if none is met; INF if one goes on."""
    end = now
    for i in range(len(state.balls)):
        ball = state.balls[i]
        if ball.wz != 0.0:
            if ball.alpha_z == 0.0:
                return INF
            stop = max(end, ball.time - ball.wz / ball.alpha_z)
            while spin_after(ball.wz, ball.alpha_z, stop - ball.time) != 0.0:
                stop = max(stop + STEP * stop, LEAST_TIME)  # the quotient is rounded
            end = stop
    return end
