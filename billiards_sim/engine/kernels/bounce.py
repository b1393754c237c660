# SPDX-License-Identifier: Apache-2.0
"""How low a bounce may be: then the bodies stay together.

Bounces that never end. What friction presses together and restitution 1 keeps apart would bounce for as long as the
push lasts, up to millions of times. So the slow impacts of a ball are counted, and a fast one sets the count to 0.
After `PATIENCE` slow ones in a row a bounce may be the higher to count as sustained contact, and what meets more slowly
stays together, the more there were: after n of them, up to the speed

    v_n = 2^((n - PATIENCE) / (2 DOUBLING)) low_speed,  low_speed^2 = 4 (mu_s + mu_r) g PRESS_HEIGHT.

What this costs: the height of such a bounce, and its speed. Under a push that changes slowly, with closing acceleration
c, a bounce keeps v^3/c: it takes 2v/c, in which time c' changes its speed by 2v c'/(3c). So where the push fades the
bounce vanishes with it, and nothing is lost. Where the push ends at once the bodies would come apart with at most v_n,
which is lost: a ball rolls no further with it than v_n^2/(2 mu_r g), on the paper's cloth 4e-11 m after 48 slow impacts
and 2^((n - 48)/2) times as far after n.
"""

from __future__ import annotations

import math

from .kernel import kernel
from .law.cushion import tilts_or_rubs
from .motion import phase_of, slip
from .state import PRESS_HEIGHT, SLIDING, Ball, Constants

PATIENCE = 48
"""Slow impacts of a ball in a row until which each is what it is. A ball that comes to rest on a rail of restitution
0.7 makes 40."""

DOUBLING = 2
"""Further slow impacts that double the height of what counts as a low bounce."""

MOST_DOUBLINGS = 27
"""Of `PRESS_HEIGHT`: up to 0.13 mm, 0.03 m/s on the paper's cloth; what is faster is not slow."""

PRESS_ACCELERATION = 1e-10
"""m/s^2. Bodies that close more slowly do not press: it moves them by less than 1e-10 m within a second."""

MICRO_SLIP = 10.0
"""Times the approach speed: a slip this small is left over from the last bounces, the ball rolls on average."""


@kernel
def presses_feature(ball: Ball, nx: float, ny: float, curvature: float, approach: float, constants: Constants) -> bool:
    """Whether a ball that arrives at a feature (normal into the table) has bounced low enough to stay on it.

    On a path of a curvature, 1/m, what holds it there has to turn it, too.
    """
    lenient = leniency(ball.bounces)
    speed = constants.rail_restitution * approach
    if tilts_or_rubs(constants):
        speed = approach  # what is not given back rubs
    if not is_low(speed, lenient, constants):
        return False
    ax, ay = _mean_acceleration(ball, approach, constants)
    closing = -(ax * nx + ay * ny)
    if curvature > 0.0:
        across = ball.vy * nx - ball.vx * ny
        closing -= curvature * across * across
    return _stays(closing, speed, lenient)


@kernel
def presses_pair(first: Ball, second: Ball, nx: float, ny: float, approach: float, constants: Constants) -> bool:
    """Whether two balls that meet (normal from the second to the first) bounce low enough to stay together."""
    lenient = leniency(min(first.bounces, second.bounces))
    if not is_low(approach, lenient, constants):
        return False
    ax, ay = _mean_acceleration(first, approach, constants)
    bx, by = _mean_acceleration(second, approach, constants)
    across = (first.vy - second.vy) * nx - (first.vx - second.vx) * ny
    return _stays((bx - ax) * nx + (by - ay) * ny - 0.5 * across * across / constants.radius, approach, lenient)


@kernel
def _stays(closing: float, speed: float, lenient: float) -> bool:
    return closing > PRESS_ACCELERATION and speed * speed <= 2.0 * closing * PRESS_HEIGHT * lenient


@kernel
def _mean_acceleration(ball: Ball, approach: float, constants: Constants) -> tuple[float, float]:
    # Of a ball about to bounce, on the average over fine bounces; with what already pushes it.
    if ball.held > 0:
        return ball.ax, ball.ay
    ux, uy = slip(ball, constants.radius)
    slipping = math.sqrt(ux * ux + uy * uy)
    if slipping > MICRO_SLIP * approach and phase_of(ball, constants) == SLIDING:
        return -constants.sliding * ux / slipping, -constants.sliding * uy / slipping
    speed = math.sqrt(ball.vx * ball.vx + ball.vy * ball.vy)
    if speed > MICRO_SLIP * approach:
        return -constants.rolling * ball.vx / speed, -constants.rolling * ball.vy / speed
    return 0.0, 0.0


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
