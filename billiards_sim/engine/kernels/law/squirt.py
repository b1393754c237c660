# SPDX-License-Identifier: Apache-2.0
"""Squirt: a cue that hits beside the middle sends the ball off its line (Alciatore, TP A.31).

While the tip is on the ball, the spinning ball pushes the end of the cue aside, and is pushed away by as much itself.
Of the cue only what is near the tip takes part, its end mass m_e. With a the distance from the middle over the radius,
the ball leaves the line of the cue, away from the side that is hit, by

    tan alpha = 5/2 a sqrt(1 - a^2) / (1 + m/m_e + 5/2 (1 - a^2)).
"""

from __future__ import annotations

import math

from ..kernel import kernel
from ..state import Ball, Constants


@kernel
def squirt(ball: Ball, side: float, constants: Constants) -> None:
    """Turn the velocity that a cue gives a ball by its tip `side` m to the left of the middle."""
    a = side / constants.radius
    rest = max(1.0 - a * a, 0.0)
    tangent = 2.5 * a * math.sqrt(rest) / (1.0 + constants.mass / constants.cue_end_mass + 2.5 * rest)
    cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
    vx, vy = ball.vx, ball.vy
    ball.vx = cosine * (vx + tangent * vy)
    ball.vy = cosine * (vy - tangent * vx)
