# SPDX-License-Identifier: Apache-2.0
"""When the next contact is: the earliest root of the distance between two balls, or of a ball and a rail.

A contact is the earliest time at which the gap is closed and closing. Stated so, touching, overlapping and separating
bodies are defined (after Bannerman, Strobl, Formella and Poeschel, "Stable algorithm for event detection in
event-driven particle dynamics", 2014): what touches and approaches is a contact now; what touches and separates is
one when it comes back; what touches and does neither is one when it has come closer by TOUCH, so that every contact has
something to change and the clock goes on.

With q(t) = p + v t + a t^2/2 the separation of two centres, the gap |q|^2 - D^2 is a quartic and half its
derivative, q . q', a cubic. The extrema of the cubic split the time into at most three stretches on which it is
monotone and has at most one root; its roots split the time into stretches on which the gap is monotone and has at most
one root. So the first root is found, or its absence shown, by signs alone, and then polished in its bracket. Gap and
derivative are evaluated from q itself: near contact |q| is small, and what cancels in the coefficients of the quartic
does not cancel there.
"""

from __future__ import annotations

import math

from .kernel import kernel
from .state import INF

TOUCH = 1e-13
"""m. A gap this small is contact: an event time is rounded by up to 2e-15 s (at 16 s), which a ball at 10 m/s turns
into 2e-14 m."""

REJECT_ROUNDING = 1e-13
"""Relative. Margin of the cheap tests, above the 1e-14 that they round by when balls are 40 diameters apart."""

APPROACH_ROUNDING = 1e-14
"""Relative to the relative speed: an approach this slow at a touch is rounding of a tangential motion."""

GAP_ROUNDING = 1e-15
"""m. Two touching balls that come apart by no more than this have not come apart."""

MAX_ITERATIONS = 100
"""Bound on root polishing; bisection alone reaches adjacent floats in about 60."""


@kernel
def gap(px: float, py: float, vx: float, vy: float, ax: float, ay: float, t: float, diameter: float) -> float:
    """Distance of the surfaces at t, m, for relative position p, velocity v and acceleration a."""
    qx = px + (vx + 0.5 * ax * t) * t
    qy = py + (vy + 0.5 * ay * t) * t
    return math.sqrt(qx * qx + qy * qy) - diameter


@kernel
def separation_rate(px: float, py: float, vx: float, vy: float, ax: float, ay: float, t: float) -> float:
    """q . q' at t, m^2/s: negative while the balls approach."""
    qx = px + (vx + 0.5 * ax * t) * t
    qy = py + (vy + 0.5 * ay * t) * t
    return qx * (vx + ax * t) + qy * (vy + ay * t)


@kernel
def _turning_time(px: float, py: float, vx: float, vy: float, ax: float, ay: float, low: float, high: float) -> float:
    # The root of q . q' in [low, high], on which it is monotone and changes sign: Newton inside the bracket, else
    # bisection.
    rising = separation_rate(px, py, vx, vy, ax, ay, low) < 0.0
    t = 0.5 * (low + high)
    for _ in range(MAX_ITERATIONS):
        qx = px + (vx + 0.5 * ax * t) * t
        qy = py + (vy + 0.5 * ay * t) * t
        wx = vx + ax * t
        wy = vy + ay * t
        value = qx * wx + qy * wy
        if value == 0.0:
            return t
        if (value < 0.0) == rising:
            low = t
        else:
            high = t
        slope = wx * wx + wy * wy + qx * ax + qy * ay
        new = t - value / slope if slope != 0.0 else low
        if not low < new < high:
            new = 0.5 * (low + high)
        if new == t or not low < new < high:
            return t
        t = new
    return t


@kernel
def _closing_time(
    px: float, py: float, vx: float, vy: float, ax: float, ay: float, low: float, high: float, diameter: float
) -> float:
    # The root of the gap in [low, high], on which it falls from > 0 to <= 0: Newton from the left on the distance,
    # which is nearly straight, inside the bracket, else bisection.
    t = low
    for _ in range(MAX_ITERATIONS):
        qx = px + (vx + 0.5 * ax * t) * t
        qy = py + (vy + 0.5 * ay * t) * t
        distance = math.sqrt(qx * qx + qy * qy)
        value = distance - diameter
        if value > 0.0:
            low = t
        else:
            high = t
        slope = qx * (vx + ax * t) + qy * (vy + ay * t)
        new = t - value * distance / slope if slope < 0.0 else high
        if new == t:
            return t
        if not low < new < high:
            new = 0.5 * (low + high)
            if not low < new < high:
                return high
        t = new
    return high


@kernel
def contact_time(
    px: float,
    py: float,
    vx: float,
    vy: float,
    ax: float,
    ay: float,
    duration: float,
    diameter: float,
    least: float,
) -> float:
    """Earliest time in [0, duration] at which two balls touch and approach, s; INF if there is none.

    Args:
        px, py, vx, vy, ax, ay: relative position m, velocity m/s and acceleration m/s^2, constant over the duration.
        duration: s, finite.
        diameter: m.
        least: m/s; a touching pair that approaches no faster does not approach.
    """
    square = px * px + py * py
    along = px * vx + py * vy
    along_acceleration = px * ax + py * ay
    # The projection on the line of centres, p . q(t), must fall to |p| D.
    if along_acceleration >= 0.0:
        if along >= 0.0:
            lowest = square
        elif -along < along_acceleration * duration:
            lowest = square - 0.5 * along * along / along_acceleration
        else:
            lowest = square + (along + 0.5 * along_acceleration * duration) * duration
    else:
        lowest = min(square, square + (along + 0.5 * along_acceleration * duration) * duration)
    reach = diameter * diameter * (1.0 + REJECT_ROUNDING)
    if lowest > 0.0 and lowest * lowest > square * reach:
        return INF
    # The distance from the line through p along v must fall to D.
    speed2 = vx * vx + vy * vy
    miss = abs(vx * py - vy * px) - 0.5 * abs(vx * ay - vy * ax) * duration * duration
    if miss > 0.0 and miss * miss > speed2 * reach:
        return INF

    start = 0.0  # where the present stretch of approach began
    approach = along
    first_gap = math.sqrt(square) - diameter
    if first_gap <= TOUCH:
        if along >= -diameter * (APPROACH_ROUNDING * math.sqrt(speed2) + least):
            approach = along if along > diameter * least else 0.0
        elif first_gap <= 0.0:
            return 0.0

    # Extrema of q . q': roots of (v^2 + p.a) + 3 v.a t + 3/2 a^2 t^2.
    accel2 = ax * ax + ay * ay
    middle = 3.0 * (vx * ax + vy * ay)
    constant = speed2 + along_acceleration
    first = duration
    second = duration
    discriminant = middle * middle - 6.0 * accel2 * constant
    if accel2 > 0.0 and discriminant > 0.0:
        root = math.sqrt(discriminant)
        large = -(middle + root) if middle >= 0.0 else -(middle - root)
        one = large / (3.0 * accel2)
        other = 2.0 * constant / large if large != 0.0 else one
        first = min(max(min(one, other), 0.0), duration)
        second = min(max(max(one, other), 0.0), duration)

    low = 0.0
    for stretch in range(3):
        high = first if stretch == 0 else (second if stretch == 1 else duration)
        if high <= low:
            continue
        at_high = separation_rate(px, py, vx, vy, ax, ay, high)
        if approach < 0.0 and at_high >= 0.0:  # a closest point within
            turn = _turning_time(px, py, vx, vy, ax, ay, low, high)
            if gap(px, py, vx, vy, ax, ay, turn, diameter) <= 0.0:
                return _closing_time(px, py, vx, vy, ax, ay, start, turn, diameter)
        elif approach >= 0.0 and at_high < 0.0:  # a furthest point within: approach begins
            start = low if approach == 0.0 else _turning_time(px, py, vx, vy, ax, ay, low, high)
            furthest = gap(px, py, vx, vy, ax, ay, start, diameter)
            if furthest <= GAP_ROUNDING:
                diameter += min(furthest, 0.0) - TOUCH  # they have not come apart: in contact when closer for certain
        if at_high < 0.0 and gap(px, py, vx, vy, ax, ay, high, diameter) <= 0.0:
            return _closing_time(px, py, vx, vy, ax, ay, start, high, diameter)
        low = high
        approach = at_high
    return INF


@kernel
def rail_contact_time(distance: float, speed: float, acceleration: float, least: float) -> float:
    """Earliest time at which a ball reaches a rail and approaches it, s; INF if it never does.

    Args:
        distance: m to the rail; rounding below 0 counts as touching.
        speed: m/s towards the rail.
        acceleration: m/s^2 towards the rail.
        least: m/s; a touching ball that approaches no faster does not approach.

    Root of a t^2/2 + v t - d = 0, in the form that does not cancel.
    """
    room = max(distance, 0.0)
    if room == 0.0 and abs(speed) <= least:
        speed = 0.0
    discriminant = speed * speed + 2.0 * acceleration * room
    if speed > 0.0:
        return 2.0 * room / (speed + math.sqrt(discriminant)) if discriminant >= 0.0 else INF
    if acceleration > 0.0:
        if room == 0.0 and speed == 0.0:  # it has not come off: in contact when closer for certain
            discriminant += 2.0 * acceleration * TOUCH
        return (math.sqrt(discriminant) - speed) / acceleration
    return INF
