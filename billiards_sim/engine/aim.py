# SPDX-License-Identifier: Apache-2.0
"""A shot in people's words: the speed of the cue ball, angles, and where the tip hits in shares of the radius."""

from __future__ import annotations

import math
from dataclasses import dataclass

from billiards_sim.engine.physics import SPEED_LIMIT, Physics
from billiards_sim.engine.quantity import number
from billiards_sim.engine.scene import Shot


@dataclass(frozen=True)
class Aim:
    """What is wanted of a ball.

    Attributes:
        speed: of the ball after the shot, along the table, m/s.
        azimuth: where the cue points along the table, rad, counter-clockwise from the x axis. With squirt the ball
            leaves this line.
        side, up: where the tip hits, to the left and up in shares of the radius, seen along the cue.
        elevation: of the butt over the tip, rad; the cue then also presses the ball onto the cloth.

    Raises:
        ValueError: not a finite number, a speed that is not > 0 or above `SPEED_LIMIT`, a tip off the ball, an
            elevation outside of 0 to pi/2.
    """

    speed: float
    azimuth: float
    side: float = 0.0
    up: float = 0.0
    elevation: float = 0.0

    def __post_init__(self) -> None:
        for name in ("speed", "azimuth", "side", "up", "elevation"):
            object.__setattr__(self, name, number(name, getattr(self, name)))
        if not 0.0 < self.speed <= SPEED_LIMIT:
            raise ValueError(f"speed must be > 0 and <= {SPEED_LIMIT:g} m/s, got {self.speed:.9g}")
        size = math.hypot(self.side, self.up)
        if not size < 1.0:
            raise ValueError(f"side and up must lie on the ball: together < 1 radius, got {size:.9g}")
        if not 0.0 <= self.elevation < 0.5 * math.pi:
            raise ValueError(f"elevation must be >= 0 and < pi/2 rad, got {self.elevation:.9g}")

    def shot(self, physics: Physics, ball: str = "cue") -> Shot:
        """The force and offset that do it: m v = F t for the force along the table (paper equation 6)."""
        force = physics.mass * self.speed / physics.cue_contact_time
        along, across = force * math.cos(self.azimuth), force * math.sin(self.azimuth)
        down = -force * math.tan(self.elevation) if self.elevation else 0.0
        return Shot((along, across, down), (self.side * physics.radius, self.up * physics.radius), ball)
