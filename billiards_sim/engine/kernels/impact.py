# SPDX-License-Identifier: Apache-2.0
"""An impact of two bodies: where its normal lies, how fast they approach, and the laws that it follows."""

from __future__ import annotations

import math

from .kernel import kernel
from .law.cushion import bounce_off_cushion, tilts_or_rubs
from .law.restitution import reflect_ball, reflect_pair
from .law.throw import rubs, throw
from .state import Ball, Constants


@kernel
def is_ideal(constants: Constants) -> bool:
    """Whether impacts are the paper's: elastic between balls, and smooth."""
    return constants.ball_restitution == 1.0 and not rubs(constants) and not tilts_or_rubs(constants)


@kernel
def normal_between(first: Ball, second: Ball) -> tuple[float, float]:
    """Unit normal from the second ball to the first (equation 43)."""
    nx = first.x - second.x
    ny = first.y - second.y
    distance = math.sqrt(nx * nx + ny * ny)
    return nx / distance, ny / distance


@kernel
def approach_speed(first: Ball, second: Ball, nx: float, ny: float) -> float:
    """Speed at which two balls approach along the normal, m/s; negative where they part."""
    return (second.vx - first.vx) * nx + (second.vy - first.vy) * ny


@kernel
def collide_pair(first: Ball, second: Ball, nx: float, ny: float, approach: float, constants: Constants) -> float:
    """Give two balls their velocities after an impact; returns the impulse along the normal, N s."""
    impulse = reflect_pair(first, second, nx, ny, approach, constants)
    if rubs(constants):
        throw(first, second, nx, ny, impulse / constants.mass, constants)
    return impulse


@kernel
def collide_feature(ball: Ball, nx: float, ny: float, constants: Constants) -> float:
    """Give a ball its velocity after an impact on what stands on the table; returns the impulse, N s."""
    if tilts_or_rubs(constants):
        return bounce_off_cushion(ball, nx, ny, constants)
    return reflect_ball(ball, nx, ny, constants)
