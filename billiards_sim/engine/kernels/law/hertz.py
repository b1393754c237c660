# SPDX-License-Identifier: Apache-2.0
"""Contacts that take time: Hertz' law, with Tsuji's damping.

Two balls pressed together by d push each other apart with

    F = K d^(3/2) + alpha sqrt(m' K) d^(1/4) d',  K = 4/3 E* sqrt(R/2),  E* = E/(2 (1 - nu^2)),

m' = m/2 their reduced mass. With alpha = -sqrt(5) ln e/sqrt(ln^2 e + pi^2) they part with e times their speed of
approach, whatever that is (Tsuji, Tanaka, Ishida 1992); the last of it pulls, until d is 0. A rail is a plane with
the same K, m' = m and its own e.

A pair that approaches at v stays together for t_c = f d_max/v, where d_max = (5 m' v^2/(4 K))^(2/5) is how far it
would come without damping; f is 2.9433 for e = 1 and grows as e falls. While it presses by d, its energy is that of
free balls that approach at v_eq, v_eq^2 = d'^2 + 4/5 K d^(5/2)/m'.
"""

from __future__ import annotations

import math

from ..kernel import kernel
from ..state import Constants


@kernel
def push_of(depth: float, rate: float, damping: float, constants: Constants) -> float:
    """Acceleration, m/s^2, that bodies pressed together by a depth, m, which grows at a rate, m/s, give each other."""
    root = math.sqrt(depth)
    return constants.stiffness * depth * root + damping * math.sqrt(root) * rate


@kernel
def free_speed(depth: float, rate: float, share: float, constants: Constants) -> float:
    """v_eq, m/s; `share` is m/m': 2 for two balls, 1 at a rail."""
    return math.sqrt(rate * rate + 0.8 * share * constants.stiffness * depth * depth * math.sqrt(depth))


@kernel
def contact_duration(speed: float, share: float, factor: float, constants: Constants) -> float:
    """t_c, s, of bodies that approach at a speed, m/s, for the factor f."""
    return factor * math.pow(1.25 / (share * constants.stiffness), 0.4) * math.pow(speed, -0.2)
