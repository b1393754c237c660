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

A lone pair that meets obliquely turns about its middle while it presses, as v_t, the relative velocity across the line
of centres, carries it on. What is kept tells most of where it parts: its middle goes straight; its angular momentum,
m' 2R v_t about the middle, is the same at the first and at the last touch, both at a distance of 2R, so v_t is the same
across both lines of centres; and for e = 1 so is its energy, hence v_n. Three figures remain, functions of e and of

    k = v_t^2 t_c/(2R v_n),

the centrifugal acceleration in units of v_n/t_c: the turn drives balls apart, so the contact is shorter, and shallow:

    duration  t_c/sqrt(1 + a k + k^2/4 - .143 k^2 (1 + .2331 k)/(1 + .2531 k + .1247 k^2)),  a = .2548 e^-.85
    turn      v_t t/(2R) (1 + d/R),  d = .625 e^.38 d_max (1 + .3723 k + .1944 k^2)^-.5824 a mean depth
    parting   v_n (e + q)/(1 + q),  q = .4616 k (1 + .3304 k)/(1 + .06211 k)

t -> 2 v_n 2R/v_t^2 for k -> infinity is the chord of a ball that passes through; the parting speed is never above v_n,
so no energy arises. The coefficients are fitted to the integrated law, for e from 0.8 to 1, 0.02 to 10 m/s and all
angles, k up to 20: velocities within 2e-5 of the speed (6e-4 for e = 0.5). For e = 1 head on, k = 0, all is exact.

Friction acts as in `throw`, once, with the whole normal impulse m/2 (v_n + v_n' - v_t turn), along the tangent in the
middle of the turn. That itself is changed by T/m t/(2R) (2 - x): the velocity across changes by 2T/m over the share x
of the contact in which the balls slip, the less than all of it the sooner they stick. Within 5e-4 of the speed, 1e-5 in
the median; what angular momentum differs by is turn^2/8 of what friction gives.
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


@kernel
def lone_pair(approach: float, across: float, constants: Constants) -> tuple[float, float, float]:
    """How long a lone pair presses, s, by what angle its line of centres turns, rad, and how fast it parts, m/s.

    `approach` and `across` are v_n and v_t, m/s.
    """
    straight = contact_duration(approach, 2.0, constants.duration_factor, constants)
    k = across * across * straight / (2.0 * constants.radius * approach)
    bent = k * k * (0.25 - 0.143 * (1.0 + 0.2331 * k) / (1.0 + (0.2531 + 0.1247 * k) * k))
    duration = straight / math.sqrt(1.0 + constants.shortening * k + bent)
    depth = constants.pressing * approach * straight * math.pow(1.0 + (0.3723 + 0.1944 * k) * k, -0.5824)
    turn = 0.5 * across * duration / constants.radius * (1.0 + depth / constants.radius)
    q = 0.4616 * k * (1.0 + 0.3304 * k) / (1.0 + 0.06211 * k)
    return duration, turn, approach * (constants.ball_restitution + q) / (1.0 + q)
