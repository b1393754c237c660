# SPDX-License-Identifier: Apache-2.0
"""Friction of two balls: throw, and spin that passes from one to the other (Alciatore, TP A.14, A.28).

With the unit normal n from the second ball to the first, their surfaces slip at the contact by

    s = v1 - v2 - R (w1 + w2) x n,  without its part along n,

whose parts are s_t = (v1 - v2).t - R (w1z + w2z) along the horizontal tangent t = z x n, and
s_z = -R ((w1x + w2x) ny - (w1y + w2y) nx). A tangential impulse T on the first ball and -T on the second changes the
slip by T (2/m + 2 R^2/I) = 7 T/m, so m s/7 ends it. Coulomb's law bounds it by mu J, J the normal impulse; mu falls
with the slip at the first touch, mu(s) = a + b exp(-c s). Both balls take the same turn, dw = -(5/2)/(m R) n x T. What
T does along the vertical is dropped, the balls stay on the cloth.

So what is thrown leaves within atan(mu) of the line of centres, and no kinetic energy arises: T acts against the slip
and does not reverse it.
"""

from __future__ import annotations

import math

from ..kernel import kernel
from ..state import Ball, Constants


@kernel
def rubs(constants: Constants) -> bool:
    """Whether there is friction between balls."""
    return constants.ball_friction + constants.ball_friction_slow > 0.0


@kernel
def friction_at(slip: float, constants: Constants) -> float:
    """Coefficient of friction of two balls that slip by so much, m/s."""
    return constants.ball_friction + constants.ball_friction_slow * math.exp(-constants.ball_friction_decay * slip)


@kernel
def slip_of_pair(first: Ball, second: Ball, nx: float, ny: float, radius: float) -> tuple[float, float]:
    """Slip of the first ball's surface over the second's, m/s, along t = (-ny, nx) and up."""
    wx, wy, wz = first.wx + second.wx, first.wy + second.wy, first.wz + second.wz
    along = (first.vy - second.vy) * nx - (first.vx - second.vx) * ny - radius * wz
    return along, first.vz - second.vz - radius * (wx * ny - wy * nx)


@kernel
def rub_pair(first: Ball, second: Ball, nx: float, ny: float, along: float, up: float, radius: float) -> None:
    """Give two balls a tangential impulse per mass, m/s, on the first along t = (-ny, nx) and up."""
    first.vx -= along * ny
    first.vy += along * nx
    first.vz += up
    second.vx += along * ny
    second.vy -= along * nx
    second.vz -= up
    turn = 2.5 / radius
    first.wx -= turn * up * ny
    first.wy += turn * up * nx
    first.wz -= turn * along
    second.wx -= turn * up * ny
    second.wy += turn * up * nx
    second.wz -= turn * along


@kernel
def throw(first: Ball, second: Ball, nx: float, ny: float, impulse: float, constants: Constants) -> None:
    """Let two balls rub that have met with a normal impulse per mass, m/s, which their slip does not know of."""
    along, up = slip_of_pair(first, second, nx, ny, constants.radius)
    slip = math.sqrt(along * along + up * up)
    if slip > 0.0:
        part = min(1.0 / 7.0, friction_at(slip, constants) * impulse / slip)
        rub_pair(first, second, nx, ny, -part * along, -part * up, constants.radius)
        first.vz = 0.0
        second.vz = 0.0
