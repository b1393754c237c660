"""What a contact does: frictionless impulses along the normal (paper equations 43 to 49).

Two balls of equal mass exchange the normal components of their velocities; a rail gives back the normal component
times its restitution. Spin is untouched, so a ball usually slides afterwards.
"""

from __future__ import annotations

import math

from billiards_sim.engine.jit import Rows, kernel
from billiards_sim.engine.state import VX, VY, Constants, X, Y


@kernel
def normal_between(first: Rows, second: Rows) -> tuple[float, float]:
    """Unit normal from the second ball to the first (equation 43)."""
    nx = first[X] - second[X]
    ny = first[Y] - second[Y]
    distance = math.sqrt(nx * nx + ny * ny)
    return nx / distance, ny / distance


@kernel
def normal_of_rail(rail: float) -> tuple[float, float]:
    """Unit normal from a rail, by its code, into the table."""
    inward = 1.0 - 2.0 * (rail % 2.0)
    return (inward, 0.0) if rail < 2.0 else (0.0, inward)


@kernel
def approach_speed(first: Rows, second: Rows, nx: float, ny: float) -> float:
    """Speed at which two balls approach along the normal, m/s; negative where they part."""
    return (second[VX] - first[VX]) * nx + (second[VY] - first[VY]) * ny


@kernel
def collide_balls(first: Rows, second: Rows, nx: float, ny: float, approach: float) -> None:
    """Exchange the normal velocities of two balls (equations 44 to 49); the impulse is mass times approach speed.

    With v1' = v1 + s n and v2' = v2 - s n, s the approach speed, the components along n are exchanged and momentum is
    kept to the last bit of the sum.
    """
    first[VX] += approach * nx
    first[VY] += approach * ny
    second[VX] -= approach * nx
    second[VY] -= approach * ny


@kernel
def collide_rail(ball: Rows, axis: int, constants: Constants) -> None:
    """Turn back the velocity along an axis (0: x, 1: y), times the restitution."""
    ball[VX + axis] *= -constants.restitution
