# SPDX-License-Identifier: Apache-2.0
"""What a contact does: frictionless impulses along the normal (paper equations 43 to 49).

Two balls of equal mass exchange the normal components of their velocities; a rail gives back the normal component
times its restitution. Spin is untouched, so a ball usually slides afterwards.
"""

from __future__ import annotations

import math

from billiards_sim.engine.jit import kernel
from billiards_sim.engine.state import Ball, Constants


@kernel
def normal_between(first: Ball, second: Ball) -> tuple[float, float]:
    """Unit normal from the second ball to the first (equation 43)."""
    nx = first.x - second.x
    ny = first.y - second.y
    distance = math.sqrt(nx * nx + ny * ny)
    return nx / distance, ny / distance


@kernel
def normal_of_rail(rail: int) -> tuple[float, float]:
    """Unit normal from a rail, by its code, into the table."""
    inward = 1.0 - 2.0 * (rail % 2)
    return (inward, 0.0) if rail < 2 else (0.0, inward)


@kernel
def approach_speed(first: Ball, second: Ball, nx: float, ny: float) -> float:
    """Speed at which two balls approach along the normal, m/s; negative where they part."""
    return (second.vx - first.vx) * nx + (second.vy - first.vy) * ny


@kernel
def collide_balls(first: Ball, second: Ball, nx: float, ny: float, approach: float) -> None:
    """Exchange the normal velocities of two balls (equations 44 to 49); the impulse is mass times approach speed.

    With v1' = v1 + s n and v2' = v2 - s n, s the approach speed, the components along n are exchanged and momentum is
    kept to the last bit of the sum.
    """
    first.vx += approach * nx
    first.vy += approach * ny
    second.vx -= approach * nx
    second.vy -= approach * ny


@kernel
def collide_rail(ball: Ball, nx: float, constants: Constants) -> None:
    """Turn back the velocity along the normal of a rail, times the restitution; `nx` is 0 for a rail along x."""
    if nx != 0.0:
        ball.vx *= -constants.restitution
    else:
        ball.vy *= -constants.restitution
