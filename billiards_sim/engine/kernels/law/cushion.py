# SPDX-License-Identifier: Apache-2.0
"""Cushions: friction, and a nose above the centre of the ball (Han, "Dynamics in carom and three cushion billiards",
J. Mech. Sci. Tech. 19, 2005, with his slip corrected).

The nose touches the ball at a height h, so the normal N at the contact is tilted down by theta, sin theta = (h - R)/R:
with the horizontal normal n into the table, N = cos theta n - sin theta z, and the contact is at r = -R N. One Coulomb
impulse acts: J = -(1 + e) m v.N along N, and across it T against the slip

    s = v - (v.N) N + w x r,

whose parts are s_t along the horizontal tangent t = z x n, and s_b along b = sin theta n + cos theta z. T changes the
slip by T (1/m + R^2/I) = 7 T/(2 m), so 2/7 m s ends it, and mu J bounds it. The spin changes by
(r x T)/I = -(5/2)/(m R) N x T, with N x t = b and N x b = -t. The vertical velocity is dropped: the ball stays on the
cloth, which takes the impulse without friction. Where that leaves some of the approach, as at a high nose that gives
little back, it ends there too.

With h = R and mu = 0 this is the wall of `restitution`.
"""

from __future__ import annotations

import math

from ..kernel import kernel
from ..state import Ball, Constants


@kernel
def tilts_or_rubs(constants: Constants) -> bool:
    """Whether cushions are more than walls."""
    return constants.rail_friction > 0.0 or constants.nose_sine != 0.0


@kernel
def slip_at_cushion(ball: Ball, nx: float, ny: float, constants: Constants) -> tuple[float, float]:
    """Slip of a ball's surface over the nose, m/s, along t = (-ny, nx) and along b."""
    sine, cosine, radius = constants.nose_sine, constants.nose_cosine, constants.radius
    spin_n = ball.wx * nx + ball.wy * ny
    spin_t = ball.wy * nx - ball.wx * ny
    # w x r = -R w x N; its part along t is -R w.(N x t) = -R w.b, along b -R w.(N x b) = R w.t
    along = ball.vy * nx - ball.vx * ny - radius * (sine * spin_n + cosine * ball.wz)
    over = sine * (ball.vx * nx + ball.vy * ny) + cosine * ball.vz + radius * spin_t
    return along, over


@kernel
def rub_at_cushion(ball: Ball, nx: float, ny: float, along: float, over: float, constants: Constants) -> None:
    """Give a ball a tangential impulse per mass, m/s, along t = (-ny, nx) and along b."""
    sine, cosine = constants.nose_sine, constants.nose_cosine
    ball.vx += sine * over * nx - along * ny
    ball.vy += sine * over * ny + along * nx
    ball.vz += cosine * over
    turn = 2.5 / constants.radius
    ball.wx -= turn * (sine * along * nx + over * ny)
    ball.wy -= turn * (sine * along * ny - over * nx)
    ball.wz -= turn * cosine * along


@kernel
def bounce_off_cushion(ball: Ball, nx: float, ny: float, constants: Constants) -> float:
    """Give a ball its velocity and spin after an impact on a nose; returns the impulse along n, N s."""
    approach = -(nx * ball.vx + ny * ball.vy)
    impulse = (1.0 + constants.rail_restitution) * constants.nose_cosine * approach  # per mass, along N
    along, over = slip_at_cushion(ball, nx, ny, constants)
    slip = math.sqrt(along * along + over * over)
    ball.vx += impulse * constants.nose_cosine * nx
    ball.vy += impulse * constants.nose_cosine * ny
    if slip > 0.0:
        part = min(2.0 / 7.0, constants.rail_friction * impulse / slip)
        rub_at_cushion(ball, nx, ny, -part * along, -part * over, constants)
        ball.vz = 0.0
    rebound = nx * ball.vx + ny * ball.vy
    if rebound < 0.0:
        ball.vx -= rebound * nx
        ball.vy -= rebound * ny
    return constants.mass * (approach + nx * ball.vx + ny * ball.vy)
