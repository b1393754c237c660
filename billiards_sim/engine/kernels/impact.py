# SPDX-License-Identifier: Apache-2.0
"""What a contact does: frictionless impulses along the normal (paper equations 43 to 49).

Two balls of equal mass exchange the normal components of their velocities; a rail gives back the normal component
times its restitution. Spin is untouched, so a ball usually slides afterwards.

Bounces that never end. What friction presses together and restitution 1 keeps apart would bounce for as long as the
push lasts, up to millions of times. So the slow impacts of a ball are counted, and a fast one sets the count to 0.
After `PATIENCE` slow ones in a row a bounce may be the higher to count as sustained contact, and what meets more slowly
stays together, the more there were: after n of them, up to the speed

    v_n = 2^((n - PATIENCE) / (2 DOUBLING)) low_speed,  low_speed^2 = 4 (mu_s + mu_r) g PRESS_HEIGHT.

What this costs: the height of such a bounce, and its speed. Under a push that changes slowly, with closing acceleration
c, a bounce keeps v^3/c: it takes 2v/c, in which time c' changes its speed by 2v c'/(3c). So where the push fades the
bounce vanishes with it, and nothing is lost. Where the push ends at once the bodies would come apart with at most v_n,
which is lost: a ball rolls no further with it than v_n^2/(2 mu_r g), on the paper's cloth 4e-11 m after 48 slow impacts
and 2^((n - 48)/5) times as far after n.
"""

from __future__ import annotations

import math

from .kernel import kernel
from .state import Ball, Constants

PATIENCE = 48
"""Slow impacts of a ball in a row until which each is what it is. A ball that comes to rest on a rail of restitution
0.7 makes 40."""

DOUBLING = 5
"""Further slow impacts that double the height of what counts as a low bounce."""

MOST_DOUBLINGS = 27
"""Of `PRESS_HEIGHT`: up to 0.13 mm, 0.03 m/s on the paper's cloth; what is faster is not slow."""


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
def is_low(speed: float, lenient: float, constants: Constants) -> bool:
    """Whether bodies that come apart at a speed may be back before they rise by PRESS_HEIGHT, times a leniency.

    Without a look at the motion: free balls close at no more than twice the friction of both kinds.
    """
    return speed * speed <= lenient * constants.low_speed * constants.low_speed


@kernel
def leniency(bounces: int) -> float:
    """How much higher than PRESS_HEIGHT a low bounce may be, after so many slow impacts."""
    if bounces <= PATIENCE:
        return 1.0
    return float(1 << min((bounces - PATIENCE) // DOUBLING, MOST_DOUBLINGS))


@kernel
def count_impact(ball: Ball, approach: float, constants: Constants) -> None:
    """Count an impact of a ball: one more slow one in a row, or none."""
    ball.bounces = ball.bounces + 1 if is_low(approach, float(1 << MOST_DOUBLINGS), constants) else 0


@kernel
def subsides(bounces: int, approach: float, constants: Constants) -> bool:
    """Whether bodies stay together that meet at a speed after so many slow impacts."""
    lenient = leniency(bounces)
    return lenient > 1.0 and is_low(approach, lenient, constants)


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
