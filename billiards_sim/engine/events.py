# SPDX-License-Identifier: Apache-2.0
"""What happened: one record for each collision, each end of slip or motion, each shot, each ball in a pocket."""

from __future__ import annotations

from dataclasses import dataclass

KINDS = ("ball_ball", "ball_rail", "rolling", "rest", "shot", "pocketed")
"""Event kinds by the kernels' code."""


@dataclass(frozen=True)
class Event:
    """One event, with its exact time.

    Attributes:
        time: s.
        kind: "ball_ball", "ball_rail", "rolling" (slip ended), "rest", "shot" or "pocketed".
        balls: names; two for "ball_ball", else one.
        rail: for "ball_rail" the rail, "x_min", "x_max", "y_min" or "y_max", or the part of a pocket: the pocket,
            "jaw" or "point", and the side of the table towards which it lies, as "x_max_y_min_jaw_y_min". Else None.
        point: (x, y) m, frame `table`: the contact; for "rolling", "rest" and "pocketed" the ball's centre.
        normal: unit (x, y) from the second ball to the first, from the rail into the table, or along the force of a
            shot; (0, 0) for "rolling", "rest" and "pocketed".
        approach_speed: m/s before the impact, along the normal; the speed of a ball that is pocketed; else 0.
        impulse: N s along the normal; 0 where nothing collides.
        pocket: for "pocketed" its name: the rails that it lies between, as "x_max_y_min", or the rail whose middle it
            is, "y_min" or "y_max". Else None.
    """

    time: float
    kind: str
    balls: tuple[str, ...]
    rail: str | None
    point: tuple[float, float]
    normal: tuple[float, float]
    approach_speed: float
    impulse: float
    pocket: str | None = None
