# SPDX-License-Identifier: Apache-2.0
"""What of a cue shot can be told before it is made: whether it is one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from billiards_sim.engine.physics import SPEED_LIMIT, Physics
from billiards_sim.engine.quantity import numbers

ROUNDING = 1e-9
"""Relative: an offset that is given as the miscue limit may be rounded beyond it."""


class Blow(NamedTuple):
    """What the cue does, in the shot's own frame: x' along the force, y' to its left, z' up."""

    fx: float  # N, of the force on the ball
    fy: float
    fz: float  # <= 0: the butt is raised
    along: float  # N, its size along the table
    side: float  # m from the ball's centre, where the tip hits
    up: float


def checked(force: Sequence[float], offset: Sequence[float], physics: Physics) -> Blow:
    """A shot as numbers.

    Args:
        force: (x, y, z) N, z <= 0: below 0 the butt is raised.
        offset: (sideways, up) m from the centre of the ball.

    Raises:
        ValueError: wrong length, not finite, a force that is zero, points up or straight down or is huge, an offset
            off the ball or beyond the miscue limit.
    """
    fx, fy, fz = numbers("force", force, 3)
    side, up = numbers("offset", offset, 2)
    for name, values, unit in (("force", (fx, fy, fz), "N"), ("offset", (side, up), "m")):
        if not all(map(math.isfinite, values)):
            raise ValueError(f"{name} must be finite, got {values} {unit}")
    if fz > 0.0:
        raise ValueError(f"force z must be <= 0: a cue does not lift the ball; got {fz:.9g} N")
    along = math.hypot(fx, fy)
    if along == 0.0:
        raise ValueError("force must not be zero along the table")
    aside = math.hypot(side, up)
    if aside > physics.radius:
        raise ValueError(
            f"offset must lie on the ball: {aside:.9g} m from its centre, the radius is {physics.radius:.9g} m"
        )
    if aside > physics.miscue_limit * physics.radius * (1.0 + ROUNDING):
        raise ValueError(
            f"the tip slips off: offset {aside:.9g} m from the centre of the ball, the miscue limit is "
            f"{physics.miscue_limit:.9g} radii, {physics.miscue_limit * physics.radius:.9g} m"
        )
    size = math.hypot(along, fz)
    speed = size / physics.mass * physics.cue_contact_time
    if not speed <= SPEED_LIMIT:
        raise ValueError(f"force must give the ball a speed <= {SPEED_LIMIT:g} m/s; {size:.9g} N gives {speed:.9g} m/s")
    return Blow(fx, fy, fz, along, side, up)


def torque(force: Sequence[float], offset: Sequence[float]) -> tuple[float, float, float]:
    """Of a shot about the centre of the ball, N m: r x F in the frame `table`, r from the centre to where the tip hits.

    In the shot's own frame (x' along the force, y' to its left, z' up) r = (-behind, side, up) and F = (f, 0, 0), so
    that r x F = (0, up f, -side f). Where the butt is raised by theta, x' points down by it and z' leans forward: with
    d the direction of the force along the table, x' = cos theta d - sin theta z and z' = sin theta d + cos theta z.

    Args:
        force: (x, y, z) N.
        offset: (side, up) m from the centre of the ball, seen along the force and across it.
    """
    side, up = offset
    fx, fy, fz = force
    level = math.hypot(fx, fy)
    if fz == 0.0 or level == 0.0:
        return -fy * up, fx * up, -side * level
    steeper = math.hypot(level, fz) / level
    return -fy * up * steeper + side * fz * fx / level, fx * up * steeper + side * fz * fy / level, -side * level
