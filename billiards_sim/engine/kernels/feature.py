# SPDX-License-Identifier: Apache-2.0
"""What stands on the table, as the centre of a ball meets it.

A ball meets the nose of a rail when its centre comes to the line that lies a radius inside of it. Contacts and impacts
name feature k as -1 - k, where a ball could stand.
"""

from __future__ import annotations

from .detection import rail_contact_time
from .kernel import kernel
from .state import INF, NOBODY, Ball, Constants, State


@kernel
def normal_of(state: State, k: int) -> tuple[float, float]:
    """Unit normal from feature k into the table."""
    feature = state.features[k]
    return feature.normal_x, feature.normal_y


@kernel
def is_touched(state: State, k: int, x: float, y: float, reach: float) -> bool:
    """Whether a ball at (x, y) is within reach of feature k, m."""
    feature = state.features[k]
    return -feature.normal_x * x - feature.normal_y * y >= feature.offset - reach


@kernel
def overlap_with(state: State, k: int, x: float, y: float) -> float:
    """How far a ball at (x, y) reaches into feature k, m; negative where it does not."""
    feature = state.features[k]
    return -feature.offset - x * feature.normal_x - y * feature.normal_y


@kernel
def place_on(state: State, k: int, ball: Ball) -> None:
    """Put a ball that touches feature k where it is but for rounding."""
    feature = state.features[k]
    along = feature.normal_x * ball.y - feature.normal_y * ball.x
    ball.x = -feature.normal_x * feature.offset - along * feature.normal_y
    ball.y = -feature.normal_y * feature.offset + along * feature.normal_x


@kernel
def is_held_at(ball: Ball, k: int) -> bool:
    """Whether a ball is in sustained contact with feature k."""
    return (ball.held_at >> k) & 1 == 1


@kernel
def predict_feature(state: State, constants: Constants, ball: Ball) -> None:
    """Find the next contact of a ball with what stands on the table, from its anchor on."""
    best = INF
    first = NOBODY
    for k in range(len(state.features)):
        feature = state.features[k]
        speed = -(ball.vx * feature.normal_x + ball.vy * feature.normal_y)
        acceleration = -(ball.ax * feature.normal_x + ball.ay * feature.normal_y)
        if (speed == 0.0 and acceleration == 0.0) or is_held_at(ball, k):
            continue
        distance = feature.offset + ball.x * feature.normal_x + ball.y * feature.normal_y
        time = rail_contact_time(distance, speed, acceleration, constants.least_approach)
        if time < best:
            best = time
            first = k
    ball.feature_time = ball.time + best
    ball.feature = first
