# SPDX-License-Identifier: Apache-2.0
"""Where to aim by geometry: ghost balls, banks, kicks, combinations, and what bars them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.engine.features import RAILS
from billiards_sim.engine.potting import THINNEST, Direction, pots

TABLE = bs.Table.pool_9ft(nose_height=0.5)
RADIUS = bs.Physics().radius
IDEAL = bs.Physics(sliding_friction=0.0, rolling_friction=0.0, rail_restitution=1.0)
"""Balls that only slide, and lose nothing: they leave along the line of centres, and rails as from a mirror."""


def scene(*places: tuple[float, float], physics: bs.Physics = IDEAL) -> bs.Scene:
    return bs.Scene(places, table=TABLE, physics=physics)


def mouth_middle(x: str, y: str) -> tuple[float, float]:
    # Of a corner, between the tips at m/sqrt 2 along each nose.
    tip = math.sqrt(0.5) * bs.Table.pool_9ft().corner_pocket.mouth
    inward = 0.5 * tip
    return (
        TABLE.x_max - inward if x == "max" else TABLE.x_min + inward,
        TABLE.y_max - inward if y == "max" else TABLE.y_min + inward,
    )


def of_kind(starts: list[Direction], kind: str, pocket: str) -> Direction:
    return next(start for start in starts if (start.kind, start.pocket) == (kind, pocket))


def random_places(count: int, balls: int, seed: int) -> list[bs.Scene]:
    random = np.random.default_rng(seed)
    found: list[bs.Scene] = []
    low, high = (TABLE.x_min + 0.2, TABLE.y_min + 0.2), (TABLE.x_max - 0.2, TABLE.y_max - 0.2)
    while len(found) < count:
        places = random.uniform(low, high, (balls, 2))
        gaps = np.hypot(*(places[:, np.newaxis] - places).T)[np.triu_indices(balls, 1)]
        if gaps.min() > 6.0 * RADIUS:
            found.append(bs.Scene(places, table=TABLE, physics=IDEAL))
    return found


def test_a_straight_pot_points_from_ball_to_ball_into_the_mouth() -> None:
    middle = np.array(mouth_middle("max", "max"))
    way = np.array((math.cos(0.6), math.sin(0.6)))
    start = of_kind(pots(scene(tuple(middle - 1.2 * way), tuple(middle - 0.5 * way))), "direct", "x_max_y_max")
    assert start.azimuth == pytest.approx(0.6, abs=1e-9)
    assert start.cut == pytest.approx(0.0, abs=1e-6)
    assert start.ball == "1"


def test_a_cut_drives_the_ball_along_the_line_of_centres() -> None:
    middle = np.array(mouth_middle("max", "min"))
    cue, ball = np.array((1.0, 0.9)), np.array((1.9, 0.5))
    start = of_kind(pots(scene(tuple(cue), tuple(ball))), "direct", "x_max_y_min")
    # Where a ball on that azimuth first touches the other: |cue + s way - ball| = 2 R.
    way = np.array((math.cos(start.azimuth), math.sin(start.azimuth)))
    along = (ball - cue) @ way
    aside = math.hypot(*(ball - cue - along * way))
    contact = cue + (along - math.sqrt(4.0 * RADIUS**2 - aside**2)) * way
    line = (ball - contact) / (2.0 * RADIUS)
    wanted = (middle - ball) / math.hypot(*(middle - ball))
    assert line == pytest.approx(wanted, abs=1e-9)
    assert math.cos(start.cut) == pytest.approx(way @ line, abs=1e-9)


PLANNED = {
    "direct": ["ball_ball"],
    "bank": ["ball_ball", "ball_rail"],
    "kick": ["ball_ball"],
    "combination": ["ball_ball"],
}
"""What the ball that is to fall goes through before it comes to the pocket."""


@pytest.mark.parametrize("kind", PLANNED)
def test_where_nothing_is_lost_the_aim_leads_the_ball_to_the_pocket(kind: str) -> None:
    came = disturbed = 0
    for place in random_places(25 if kind == "combination" else 8, 3, seed=5):
        starts = [start for start in pots(place) if start.kind == kind and start.cut < 1.0 and start.tolerance > 2e-4]
        if not starts:
            continue
        result = bs.rollout(place, bs.Shots(3.0, [start.azimuth for start in starts]), until=4.0, events=True)
        for index, start in enumerate(starts):
            mine = [event for event in result.events(index) if start.ball in event.balls]
            last = mine[: len(PLANNED[kind]) + 1][-1]
            if last.kind == "ball_ball":  # the balls meet again, which geometry does not look at
                disturbed += 1
                continue
            assert [event.kind for event in mine[: len(PLANNED[kind])]] == PLANNED[kind]
            assert last.rail not in RAILS
            assert (last.pocket or last.rail or "").startswith(start.pocket)
            came += 1
    assert came >= 5
    assert disturbed < came / 2


def test_the_tolerance_is_about_what_the_pocket_forgives() -> None:
    place = scene((1.2, 0.7), (1.9, 0.95))
    start = of_kind(pots(place), "direct", "x_max_y_max")
    azimuths = start.azimuth + start.tolerance * np.linspace(-3.0, 3.0, 61)
    fell = bs.rollout(place, bs.Shots(3.0, azimuths), until=4.0).pocketed("1", "x_max_y_max")
    width = np.count_nonzero(fell) * 0.1 * start.tolerance
    assert 1.0 * start.tolerance < width < 4.0 * start.tolerance  # jaws forgive more than a clean fall


def test_a_ball_in_the_way_bars_a_pot() -> None:
    middle = np.array(mouth_middle("max", "max"))
    cue, ball = np.array((1.0, 0.4)), np.array((1.9, 0.8))
    free = pots(scene(tuple(cue), tuple(ball)), "1", "x_max_y_max")
    assert "direct" in [start.kind for start in free]
    for between in (0.5 * (ball + middle), 0.5 * (cue + ball)):
        barred = pots(scene(tuple(cue), tuple(ball), tuple(between)), "1", "x_max_y_max")
        assert "direct" not in [start.kind for start in barred]


def test_no_pot_is_thinner_than_the_thinnest() -> None:
    # Behind the object ball, seen from the pocket, there is no way but by a rail.
    middle = np.array(mouth_middle("max", "max"))
    ball = middle - np.array((0.5, 0.4))
    found = pots(scene(tuple(0.5 * (middle + ball)), tuple(ball)), "1", "x_max_y_max")
    assert "direct" not in [start.kind for start in found]
    for place in random_places(10, 2, seed=8):
        assert all(start.cut <= THINNEST for start in pots(place))


def test_a_combination_is_named_for_the_ball_that_falls() -> None:
    middle = np.array(mouth_middle("max", "max"))
    way = np.array((math.cos(0.6), math.sin(0.6)))
    far, near, cue = middle - 0.3 * way, middle - 0.7 * way, middle - 1.2 * way
    found = pots(scene(tuple(cue), tuple(near), tuple(far)), pocket="x_max_y_max")
    start = of_kind(found, "combination", "x_max_y_max")
    assert (start.ball, start.azimuth) == ("2", pytest.approx(0.6, abs=1e-9))


def test_mirrored_balls_have_mirrored_aims() -> None:
    for place in random_places(3, 3, seed=2):
        turned = place.positions.copy()
        turned[:, 1] = TABLE.y_min + TABLE.y_max - turned[:, 1]
        here = sorted((start.kind, start.ball, start.azimuth, start.tolerance) for start in pots(place))
        there = sorted(
            (start.kind, start.ball, -start.azimuth, start.tolerance) for start in pots(scene(*map(tuple, turned)))
        )
        assert [one[:2] for one in here] == [other[:2] for other in there]
        for one, other in zip(here, there):
            assert one[2:] == pytest.approx(other[2:], abs=1e-12)


def test_the_most_forgiving_come_first() -> None:
    tolerances = [start.tolerance for start in pots(random_places(1, 4, seed=1)[0])]
    assert len(tolerances) > 5
    assert tolerances == sorted(tolerances, reverse=True)


@pytest.mark.parametrize(
    "arguments, said",
    [
        ({"ball": "7"}, "no ball is named '7'"),
        ({"pocket": "left"}, "no pocket is named 'left'"),
        ({"ball": "cue"}, "is the one that is struck"),
        ({"struck": "x"}, "no ball is named 'x'"),
    ],
)
def test_what_is_not_there_is_refused(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        pots(scene((1.0, 0.5), (1.5, 0.8)), **arguments)


def test_a_ball_that_is_off_the_table_is_not_potted() -> None:
    gone = bs.Scene([(1.0, 0.5), (1.5, 0.8), (0.0, 0.0)], table=TABLE, in_play=[True, True, False])
    assert {start.ball for start in pots(gone)} == {"1"}
    with pytest.raises(ValueError, match="'2' is not in play"):
        pots(gone, "2")
