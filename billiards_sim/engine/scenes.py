# SPDX-License-Identifier: Apache-2.0
"""The built-in scenes: the paper's three and an eight-ball rack."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from billiards_sim.engine.physics import Physics
from billiards_sim.engine.scene import PAPER_PHYSICS, PAPER_TABLE, Scene
from billiards_sim.engine.table import Table

RACK_GAP = 1e-4
"""m. Default distance between neighbours in a rack: what a well set wooden triangle leaves."""

EIGHT_BALL_ROWS = ((1,), (9, 2), (10, 8, 3), (11, 4, 12, 5), (6, 13, 7, 14, 15))
"""Ball numbers from the apex back, low y first: the 8 in the middle, a solid and a stripe in the back corners."""


def head_on(*, table: Table = PAPER_TABLE, physics: Physics = PAPER_PHYSICS) -> Scene:
    """The paper's scene 1: `cue` (its red ball) at 5 m/s into `1` (its blue ball), dead centre, without spin.

    The coordinates are the paper's on every table.

    Raises:
        ValueError: the table is too small for them.
    """
    return _two_balls("head_on", 0.5, table, physics)


def glancing(*, table: Table = PAPER_TABLE, physics: Physics = PAPER_PHYSICS) -> Scene:
    """The paper's scene 2: as scene 1, the cue ball 10 mm off the line of centres.

    Raises:
        ValueError: the table is too small.
    """
    return _two_balls("glancing", 0.49, table, physics)


def random_balls(
    count: int = 20, seed: int = 1, *, table: Table = PAPER_TABLE, physics: Physics = PAPER_PHYSICS
) -> Scene:
    """The paper's scene 3 with legal positions: no overlap, inside the rails.

    Args:
        count: number of balls.
        seed: of the random numbers; the same seed gives the same scene on the same table.
        table, physics: default to the paper's.

    Positions are uniform over what is left by the balls placed before. Velocities are uniform in -7 to 7 m/s on each
    axis, without spin.

    Raises:
        ValueError: `count` is not a positive whole number, or so many balls find no room.
    """
    if isinstance(count, bool) or not isinstance(count, (int, np.integer)) or count < 1:
        raise ValueError(f"count must be a whole number >= 1, got {count!r}")
    low = np.array([table.x_min, table.y_min]) + physics.radius
    high = np.array([table.x_max, table.y_max]) - physics.radius
    if (low > high).any():
        width = min(table.length, table.width)
        raise ValueError(f"balls of radius {physics.radius:g} m do not fit on a table {width:g} m wide")
    random = np.random.default_rng(seed)
    positions = np.empty((count, 2))
    attempts_for_one_ball = 10_000
    for placed in range(count):
        for _ in range(attempts_for_one_ball):
            position = random.uniform(low, high)
            if np.all(np.hypot(*(positions[:placed] - position).T) > 2.0 * physics.radius):
                positions[placed] = position
                break
        else:
            raise ValueError(f"no room for {count} balls at random: ball {placed} found none free of the others")
    velocities = random.uniform(-7.0, 7.0, (count, 2))
    return Scene(positions, velocities, table=table, physics=physics, name="random_balls")


def rack(gap: float = RACK_GAP, *, table: Table = PAPER_TABLE, physics: Physics = PAPER_PHYSICS) -> Scene:
    """15 balls racked for eight-ball on the paper's table, and the cue ball on the head spot, all at rest.

    Args:
        gap: m between neighbouring balls of the rack, >= 0; 0 racks them touching.
        table, physics: default to the paper's.

    The triangle has its apex on the foot spot and points to the cue ball; the 8 is in the middle. Offsets from the
    long axis are whole multiples of a power of two, so the rack is mirror-symmetric to the last bit.

    Raises:
        ValueError: `gap` is negative, not finite, or so large that the rack does not fit.
    """
    if not (isinstance(gap, (int, float)) and 0.0 <= gap < math.inf):
        raise ValueError(f"gap must be a finite number >= 0 (m), got {gap!r}")
    grid = 2.0**-50
    pitch = 2.0 * physics.radius + gap
    foot_x, axis_y = table.foot_spot
    positions = [table.head_spot] + [(0.0, 0.0)] * 15
    for row, numbers in enumerate(EIGHT_BALL_ROWS):
        for place, number in enumerate(numbers):
            aside = round((place - 0.5 * row) * pitch / grid)
            positions[number] = (foot_x + row * math.sqrt(0.75) * pitch, axis_y + aside * grid)
    return Scene(positions, table=table, physics=physics, name="rack")


def _two_balls(name: str, cue_y: float, table: Table, physics: Physics) -> Scene:
    velocities = [[5.0, 0.0], [0.0, 0.0]]
    return Scene([[0.3, cue_y], [1.0, 0.5]], velocities, table=table, physics=physics, name=name)


BUILT_IN: dict[str, Callable[..., Scene]] = {
    "head_on": head_on,
    "glancing": glancing,
    "random_balls": random_balls,
    "rack": rack,
}
"""The built-in scenes by name; each takes `table` and `physics`."""
