# SPDX-License-Identifier: Apache-2.0
"""The built-in scenes: the paper's three, a rack on its table, and games on tables of their own."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from billiards_sim.engine.aim import Aim
from billiards_sim.engine.markings import D_RADIUS, START_SPOT, snooker_spots
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.scene import PAPER_PHYSICS, PAPER_TABLE, Scene
from billiards_sim.engine.table import Table

POOL_TABLE = Table.pool_9ft()
POOL_PHYSICS = Physics.pool()
SNOOKER_TABLE = Table.snooker_12ft()
SNOOKER_PHYSICS = Physics.snooker()
CAROM_TABLE = Table.carom_10ft()
CAROM_PHYSICS = Physics.carom()

EIGHT_BALL_BREAK = TEN_BALL_BREAK = Aim(8.5, math.radians(1.2))
NINE_BALL_BREAK = Aim(10.75, math.radians(0.764))
"""19 and 24 mph. The shots that the scenes of games bring; where they point is chosen so that a ball falls, and in
nine-ball another one rattles in a corner and stays out."""

RACK_GAP = 1e-4
"""m. Default distance between neighbours in a rack: what a well set wooden triangle leaves."""

GRID = 2.0**-50
"""m. Offsets from the long axis are whole multiples of it, so that racks are mirror-symmetric to the last bit."""

Rows = tuple[tuple[int, ...], ...]

EIGHT_BALL_ROWS: Rows = ((1,), (9, 2), (10, 8, 3), (11, 4, 12, 5), (6, 13, 7, 14, 15))
NINE_BALL_ROWS: Rows = ((1,), (2, 3), (4, 9, 5), (6, 7), (8,))
TEN_BALL_ROWS: Rows = ((1,), (4, 5), (6, 10, 7), (2, 8, 9, 3))
STRAIGHT_POOL_ROWS: Rows = ((1,), (2, 3), (4, 5, 6), (7, 8, 9, 10), (11, 12, 13, 14, 15))
SNOOKER_ROWS: Rows = STRAIGHT_POOL_ROWS
"""Ball numbers from the apex back, low y first."""


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
    balls = _racked(EIGHT_BALL_ROWS, table.foot_spot, gap, 0.0, 0, physics)
    positions = [table.head_spot] + [balls[number] for number in sorted(balls)]
    return Scene(positions, table=table, physics=physics, name="rack")


def eight_ball(
    gap: float = RACK_GAP,
    looseness: float = 0.0,
    seed: int = 1,
    *,
    table: Table = POOL_TABLE,
    physics: Physics = POOL_PHYSICS,
) -> Scene:
    """Eight-ball: 15 balls in a triangle on the foot spot, and the cue ball behind the head string.

    Args:
        gap: m between neighbouring balls of the rack, >= 0; 0 racks them touching.
        looseness: m, how much wider gaps are on the average; each ball lies anywhere within half of it around its
            place, so that no gap is narrower than `gap`.
        seed: of the random numbers for that.
        table, physics: default to a 9 ft pool table and pool.

    The shot of the scene is a break, as that of every game.

    WPA, "Rules of play", eight ball: the 8 in the middle, a solid and a stripe in the back corners. The rest is as
    people like it.

    Raises:
        ValueError: `gap` or `looseness` is negative, not finite, or so large that the rack does not fit.
    """
    return _pool("eight_ball", EIGHT_BALL_ROWS, EIGHT_BALL_BREAK, gap, looseness, seed, table, physics)


def nine_ball(
    gap: float = RACK_GAP,
    looseness: float = 0.0,
    seed: int = 1,
    *,
    table: Table = POOL_TABLE,
    physics: Physics = POOL_PHYSICS,
) -> Scene:
    """Nine-ball: 9 balls in a diamond, the 1 on the foot spot, the 9 in the middle (WPA), else as `eight_ball`."""
    return _pool("nine_ball", NINE_BALL_ROWS, NINE_BALL_BREAK, gap, looseness, seed, table, physics)


def ten_ball(
    gap: float = RACK_GAP,
    looseness: float = 0.0,
    seed: int = 1,
    *,
    table: Table = POOL_TABLE,
    physics: Physics = POOL_PHYSICS,
) -> Scene:
    """Ten-ball: 10 balls in a triangle, the 1 on the foot spot, the 10 in the middle (WPA), else as `eight_ball`."""
    return _pool("ten_ball", TEN_BALL_ROWS, TEN_BALL_BREAK, gap, looseness, seed, table, physics)


def straight_pool(
    gap: float = RACK_GAP,
    looseness: float = 0.0,
    seed: int = 1,
    *,
    table: Table = POOL_TABLE,
    physics: Physics = POOL_PHYSICS,
) -> Scene:
    """14.1: 15 balls in a triangle on the foot spot, as they come (WPA), else as `eight_ball`."""
    return _pool("straight_pool", STRAIGHT_POOL_ROWS, EIGHT_BALL_BREAK, gap, looseness, seed, table, physics)


def snooker(
    gap: float = RACK_GAP,
    looseness: float = 0.0,
    seed: int = 1,
    *,
    table: Table = SNOOKER_TABLE,
    physics: Physics = SNOOKER_PHYSICS,
) -> Scene:
    """Snooker: 15 reds in a triangle behind the pink, the colours on their spots, the cue ball in the D.

    Args:
        gap: m between neighbouring reds, and between the first of them and the pink, > 0.
        looseness, seed: of the reds, as in `eight_ball`.
        table, physics: default to a 12 ft snooker table and snooker.

    WPBSA, "Official rules": baulk line 29 in from the bottom cushion, here at low x; D of radius 11 1/2 in; black
    12 3/4 in from the top cushion; blue in the middle, pink between it and the top cushion. Seen from the bottom,
    yellow is on the right.

    Raises:
        ValueError: `gap` is not > 0, `looseness` is negative, or either is so large that the rack does not fit.
    """
    _check_length("gap", gap)
    _check_length("looseness", looseness)
    if gap == 0.0:
        raise ValueError("gap must be > 0: the pink does not touch the reds")
    colours = snooker_spots(table)
    (baulk_x, middle_y), (pink_x, _) = colours["brown"], colours["pink"]
    places = {"cue": (baulk_x, middle_y - 0.5 * D_RADIUS), **colours}
    apex = (pink_x + 2.0 * physics.radius + gap + 0.5 * looseness, middle_y)
    reds = _racked(SNOOKER_ROWS, apex, gap, looseness, seed, physics)
    places |= {f"red{number}": place for number, place in sorted(reds.items())}
    shot = Aim(3.0, math.radians(-1.25), side=-0.2).shot(physics)  # off the last red, and back to baulk
    return Scene(list(places.values()), names=list(places), table=table, physics=physics, name="snooker", shot=shot)


def three_cushion(*, table: Table = CAROM_TABLE, physics: Physics = CAROM_PHYSICS) -> Scene:
    """Three-cushion billiards: `cue` (white), `yellow` and `red` as a game begins.

    UMB, "World rules of carom billiard": the red on the foot spot, the opponent's ball on the head spot, one's own on
    one of the two spots 18.25 cm beside it.

    Raises:
        ValueError: the table is too small.
    """
    head_x, middle_y = table.head_spot
    places = [(head_x, middle_y - START_SPOT), table.head_spot, table.foot_spot]
    names = ("cue", "yellow", "red")
    shot = Aim(4.5, math.radians(4.75), side=-0.4, up=0.2).shot(physics)  # red, three rails and more, yellow: it scores
    return Scene(places, names=names, table=table, physics=physics, name="three_cushion", shot=shot)


def _pool(
    name: str, rows: Rows, aim: Aim, gap: float, looseness: float, seed: int, table: Table, physics: Physics
) -> Scene:
    # A rack on the foot spot, and the cue ball a diameter behind the head string; a break.
    balls = _racked(rows, table.foot_spot, gap, looseness, seed, physics)
    head_x, middle_y = table.head_spot
    positions = [(head_x - 2.0 * physics.radius, middle_y)] + [balls[number] for number in sorted(balls)]
    shot = aim.shot(physics)
    return Scene(positions, table=table, physics=physics, name=name, shot=shot)


def _racked(
    rows: Rows, apex: tuple[float, float], gap: float, looseness: float, seed: int, physics: Physics
) -> dict[int, tuple[float, float]]:
    # (x, y) m of the balls of a rack, which points to lower x. Offsets from the long axis are whole multiples of a
    # power of two: without looseness it is mirror-symmetric to the last bit.
    _check_length("gap", gap)
    _check_length("looseness", looseness)
    random = np.random.default_rng(seed)
    pitch = 2.0 * physics.radius + gap + looseness
    found = {}
    for row, numbers in enumerate(rows):
        for place, number in enumerate(numbers):
            aside = round((place - 0.5 * (len(numbers) - 1)) * pitch / GRID) * GRID
            reach, turn = 0.5 * looseness * math.sqrt(random.random()), 2.0 * math.pi * random.random()
            found[number] = (
                apex[0] + row * math.sqrt(0.75) * pitch + reach * math.cos(turn),
                apex[1] + aside + reach * math.sin(turn),
            )
    return found


def _check_length(name: str, given: float) -> None:
    if not (isinstance(given, (int, float)) and 0.0 <= given < math.inf):
        raise ValueError(f"{name} must be a finite number >= 0 (m), got {given!r}")


def _two_balls(name: str, cue_y: float, table: Table, physics: Physics) -> Scene:
    velocities = [[5.0, 0.0], [0.0, 0.0]]
    return Scene([[0.3, cue_y], [1.0, 0.5]], velocities, table=table, physics=physics, name=name)


BUILT_IN: dict[str, Callable[..., Scene]] = {
    "head_on": head_on,
    "glancing": glancing,
    "random_balls": random_balls,
    "rack": rack,
    "eight_ball": eight_ball,
    "nine_ball": nine_ball,
    "ten_ball": ten_ball,
    "straight_pool": straight_pool,
    "snooker": snooker,
    "three_cushion": three_cushion,
}
"""The built-in scenes by name; each takes `table` and `physics`."""
