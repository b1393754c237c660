# SPDX-License-Identifier: Apache-2.0
"""What of the normal velocity comes back: frictionless impulses along the normal (paper equations 43 to 49).

Two balls of equal mass exchange the normal components of their velocities, or keep (1 - e)/2 of them where they are not
elastic; a rail gives back the normal component times its restitution. Spin is untouched, so a ball usually slides
afterwards.
"""

from __future__ import annotations

from ..kernel import kernel
from ..state import Ball, Constants


@kernel
def reflect_pair(first: Ball, second: Ball, nx: float, ny: float, approach: float, constants: Constants) -> float:
    """Give two balls what an impulse along the normal does; returns it, N s.

    Of two equal masses that approach at a speed s, v1' = v1 + (1 + e)/2 s n and v2' = v2 - (1 + e)/2 s n: with e = 1
    the components along n are exchanged (equations 44 to 49). Momentum is kept to the last bit of the sum.
    """
    change = 0.5 * (1.0 + constants.ball_restitution) * approach
    first.vx += change * nx
    first.vy += change * ny
    second.vx -= change * nx
    second.vy -= change * ny
    return constants.mass * change


@kernel
def reflect_ball(ball: Ball, nx: float, ny: float, constants: Constants) -> float:
    """Turn back the velocity of a ball along a normal, times the restitution of rails; returns the impulse, N s.

    Written for its components along normal and tangent, so that along the axes nothing is rounded.
    """
    approach = -(nx * ball.vx + ny * ball.vy)
    along = nx * ball.vy - ny * ball.vx
    back = constants.rail_restitution * approach
    ball.vx = back * nx - along * ny
    ball.vy = back * ny + along * nx
    return constants.mass * (1.0 + constants.rail_restitution) * approach
