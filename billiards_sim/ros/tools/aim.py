# SPDX-License-Identifier: Apache-2.0
"""A shot as people say it: the speed of the cue ball, an angle, and where the tip hits in shares of the radius."""

from __future__ import annotations

import argparse
import math
from dataclasses import dataclass

from billiards_sim.engine.scene import Shot

ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0}
"""In rad."""


@dataclass(frozen=True)
class Aim:
    """What is wanted of the cue ball.

    Attributes:
        speed: of the ball after the shot, m/s.
        angle: rad, counter-clockwise from the x axis.
        side, up: where the tip hits, to the left and up in shares of the radius, seen along the shot.
    """

    speed: float
    angle: float
    side: float = 0.0
    up: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.speed) and self.speed > 0.0):
            raise ValueError(f"speed must be a finite number > 0 (m/s), got {self.speed:g}")
        size = math.hypot(self.side, self.up)
        if not size < 1.0:
            raise ValueError(f"side and up must lie on the ball: together < 1 radius, got {size:.6g}")

    def shot(self, mass: float, radius: float, contact_time: float) -> Shot:
        """The force and offset that do it: m v = F t (paper equation 6).

        Args:
            mass: of the ball, kg.
            radius: of the ball, m.
            contact_time: of the cue, s.
        """
        force = mass * self.speed / contact_time
        direction = (math.cos(self.angle), math.sin(self.angle))
        return Shot((force * direction[0], force * direction[1], 0.0), (self.side * radius, self.up * radius))


def angle(text: str) -> float:
    """An argument type: a finite angle with its unit, `12deg` or `0.2rad`; rad."""
    number, unit = text[:-3], text[-3:]
    try:
        value = float(number) * ANGLE_UNITS[unit]
    except (KeyError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be an angle with its unit, as 12deg or 0.2rad, got {text}")
    return value
