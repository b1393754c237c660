# SPDX-License-Identifier: Apache-2.0
"""What happened: one record for each collision, each end of slip or motion, each shot."""

from __future__ import annotations

from dataclasses import dataclass

KINDS = ("ball_ball", "ball_rail", "rolling", "rest", "shot")
"""Event kinds by the kernels' code."""


@dataclass(frozen=True)
class Event:
    """One event, with its exact time.

    Attributes:
        time: s.
        kind: "ball_ball", "ball_rail", "rolling" (slip ended), "rest" or "shot".
        balls: names; two for "ball_ball", else one.
        rail: "x_min", "x_max", "y_min" or "y_max" for "ball_rail", else None.
        point: (x, y) m, frame `table`: the contact; for "rolling" and "rest" the ball's centre.
        normal: unit (x, y) from the second ball to the first, from the rail into the table, or along the force of a
            shot; (0, 0) for "rolling" and "rest".
        approach_speed: m/s before the impact, along the normal; 0 where nothing collides.
        impulse: N s along the normal; 0 where nothing collides.
    """

    time: float
    kind: str
    balls: tuple[str, ...]
    rail: str | None
    point: tuple[float, float]
    normal: tuple[float, float]
    approach_speed: float
    impulse: float
