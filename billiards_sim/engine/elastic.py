# SPDX-License-Identifier: Apache-2.0
"""Coefficients of elastic contacts: what the kernels need of Hertz' law and of Tsuji's damping."""

from __future__ import annotations

import math
from functools import cache

from billiards_sim.engine.physics import Physics

CONTACT_STEPS = 36.0
"""Steps in the duration of a contact: energy is then kept to 5e-6, velocities to 2e-5 m/s in a rack at 8 m/s."""

LEAST_FITTED = 0.1
"""Restitution below which the fits of a lone pair's turn are those of this one."""

DURATION_STEPS = 4000
"""Steps of the integration of a contact: its duration is then good to 1e-7."""

LONGEST_DURATION = 8.0
"""t_c v/d_max. With a restitution below 0.01 the end of a contact is a creep; it is over when it has lasted so long."""


def stiffness_of(physics: Physics) -> float:
    """K/m, m^-1/2 s^-2: K = 4/3 E* sqrt(R/2), E* = E/(2 (1 - nu^2))."""
    modulus = physics.youngs_modulus / (2.0 * (1.0 - physics.poisson_ratio**2))
    return 4.0 / 3.0 * modulus * math.sqrt(0.5 * physics.radius) / physics.mass


def damping(restitution: float) -> float:
    """alpha of Tsuji's damping, which gives back this share of the speed of approach."""
    if restitution == 0.0:
        return math.sqrt(5.0)
    log = math.log(restitution)
    return 0.0 - math.sqrt(5.0) * log / math.hypot(log, math.pi)


@cache
def duration_factor(restitution: float) -> float:
    """t_c v/d_max of a contact, with d_max of one without damping, by Runge-Kutta's method of fourth order.

    In units in which x'' = -x^(3/2) - alpha x^(1/4) x', x = 0 and x' = 1 at first, d_max is (5/4)^(2/5).
    """
    alpha = damping(restitution)

    def acceleration(x: float, v: float) -> float:
        depth = max(x, 0.0)
        return -(depth**1.5) - alpha * depth**0.25 * v

    deepest = 1.25**0.4
    step = 2.9432675 * deepest / DURATION_STEPS
    time, x, v = 0.0, 0.0, 1.0
    while True:
        a1 = acceleration(x, v)
        a2 = acceleration(x + 0.5 * step * v, v + 0.5 * step * a1)
        a3 = acceleration(x + 0.5 * step * v + 0.25 * step * step * a1, v + 0.5 * step * a2)
        a4 = acceleration(x + step * v + 0.5 * step * step * a2, v + step * a3)
        new = x + step * v + step * step / 6.0 * (a1 + a2 + a3)
        if new <= 0.0:
            return (time + step * x / (x - new)) / deepest
        if time >= LONGEST_DURATION * deepest:
            return LONGEST_DURATION
        x, v = new, v + step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        time += step


def shortening(restitution: float) -> float:
    """How much the turn of a lone pair's line of centres shortens its contact: a of `kernels.law.hertz`."""
    return 0.2548 * max(restitution, LEAST_FITTED) ** -0.85


def mean_depth(restitution: float) -> float:
    """Depth by which a lone pair presses that does not turn, averaged as its turn needs it, over v_n t_c."""
    return 0.625 * max(restitution, LEAST_FITTED) ** 0.38 / duration_factor(restitution)
