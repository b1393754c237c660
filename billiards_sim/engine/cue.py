# SPDX-License-Identifier: Apache-2.0
"""The cue shot (paper equations 1 to 12), in the shot's own frame: x' along the force, y' to its left, z' up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from billiards_sim.engine.physics import Physics
from billiards_sim.engine.quantity import numbers
from billiards_sim.engine.state import SPEED_LIMIT


@dataclass(frozen=True)
class Strike:
    """What a shot gives a resting ball.

    Attributes:
        displacement: (x, y) m during the contact, if nothing is in the way (equation 3).
        velocity: (x, y) m/s (equation 6).
        angular_velocity: (x, y, z) rad/s (equation 12).
        direction: unit (x, y) of the force.
        tip: (x, y) m from the ball's centre to where the tip hits.
        impulse: N s.
    """

    displacement: tuple[float, float]
    velocity: tuple[float, float]
    angular_velocity: tuple[float, float, float]
    direction: tuple[float, float]
    tip: tuple[float, float]
    impulse: float


def strike(force: Sequence[float], offset: Sequence[float], physics: Physics) -> Strike:
    """Impulse of a level cue, with a constant force for `physics.cue_contact_time`.

    Args:
        force: (x, y, z) N, z = 0.
        offset: (sideways, up) m from the centre of the ball.

    With r = (-sqrt(R^2 - side^2 - up^2), side, up) and F along x', the torque r x F is (0, up F, -side F).

    Raises:
        ValueError: wrong length, not finite, a force that is zero, not horizontal or huge, an offset further out than
            the radius.
    """
    fx, fy, fz = numbers("force", force, 3)
    side, up = numbers("offset", offset, 2)
    for name, values, unit in (("force", (fx, fy, fz), "N"), ("offset", (side, up), "m")):
        if not all(map(math.isfinite, values)):
            raise ValueError(f"{name} must be finite, got {values} {unit}")
    if fz != 0.0:
        raise ValueError(f"force z must be 0: the cue is level; got {fz:.9g} N")
    size = math.hypot(fx, fy)
    if size == 0.0:
        raise ValueError("force must not be zero")
    aside = math.hypot(side, up)
    if aside > physics.radius:
        raise ValueError(
            f"offset must lie on the ball: {aside:.9g} m from its centre, the radius is {physics.radius:.9g} m"
        )
    time = physics.cue_contact_time
    speed = size / physics.mass * time
    if not speed <= SPEED_LIMIT:
        raise ValueError(f"force must give the ball a speed <= {SPEED_LIMIT:g} m/s; {size:.9g} N gives {speed:.9g} m/s")
    dx, dy = fx / size, fy / size
    spin_per_offset = size * time / physics.moment_of_inertia
    behind = math.sqrt(max(physics.radius**2 - side * side - up * up, 0.0))
    return Strike(
        displacement=(0.5 * fx / physics.mass * time * time, 0.5 * fy / physics.mass * time * time),
        velocity=(fx / physics.mass * time, fy / physics.mass * time),
        angular_velocity=(-dy * up * spin_per_offset, dx * up * spin_per_offset, -side * spin_per_offset),
        direction=(dx, dy),
        tip=(-behind * dx - side * dy, -behind * dy + side * dx),
        impulse=size * time,
    )
