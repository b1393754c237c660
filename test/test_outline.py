# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a table is what balls meet."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import billiards_sim as bs
from billiards_sim.engine.features import trouble_at
from billiards_sim.outline import area, outline, triangles

TABLES = {
    "paper": bs.Table(),
    "pool": bs.Table.pool_9ft(),
    "bar": bs.Table.pool_7ft(),
    "snooker": bs.Table.snooker_12ft(),
    "carom": bs.Table.carom_10ft(),
    "corners only": bs.Table.pool_9ft(side_pocket=None),
    "sides only": bs.Table.pool_9ft(corner_pocket=None),
    "thin rails": bs.Table.pool_9ft(rail_thickness=0.02),
}
MARGIN = 3e-4
"""m. By which the corners of arcs may miss them: 62 mm (1 - cos 4 deg) is 0.15 mm."""


def contains(polygon: NDArray[np.float64], x: float, y: float) -> bool:
    begin, end = polygon, np.roll(polygon, -1, axis=0)
    crosses = (begin[:, 1] > y) != (end[:, 1] > y)
    begin, end = begin[crosses], end[crosses]
    at = begin[:, 0] + (y - begin[:, 1]) / (end[:, 1] - begin[:, 1]) * (end[:, 0] - begin[:, 0])
    return bool((at > x).sum() % 2)


def distance(polygon: NDArray[np.float64], x: float, y: float) -> float:
    """m to the line around it."""
    begin, along = polygon, np.roll(polygon, -1, axis=0) - polygon
    share = (((x, y) - begin) * along).sum(axis=1) / (along**2).sum(axis=1)
    nearest = begin + np.clip(share, 0.0, 1.0)[:, np.newaxis] * along
    return float(np.hypot(*(nearest - (x, y)).T).min())


@pytest.mark.parametrize("name", TABLES)
def test_triangles_make_up_every_part(name: str) -> None:
    parts = outline(TABLES[name])
    for polygon in (parts.cloth, *parts.cushions, *parts.wood, *parts.holes):
        corners = triangles(polygon)
        assert len(corners) <= len(polygon) - 2  # less where corners are on one line
        areas = [area(polygon[three]) for three in corners]
        assert min(areas) >= 0.0
        assert sum(areas) == pytest.approx(area(polygon), rel=1e-9)


@pytest.mark.parametrize("name", TABLES)
def test_the_parts_cover_the_table_once(name: str) -> None:
    table = TABLES[name]
    parts = outline(table)
    (left, right), (low, high) = parts.outer
    if name != "thin rails":
        assert (left, low) == pytest.approx((0.0, 0.0), abs=1e-12)
    rng = np.random.default_rng(3)
    polygons = (parts.cloth, *parts.cushions, *parts.wood)
    for x, y in rng.uniform((left, low), (right, high), (500, 2)).tolist():
        on = sum(contains(polygon, x, y) for polygon in polygons)
        hole = any(contains(polygon, x, y) for polygon in parts.holes)
        assert on == 1 or (hole and on == 0), (x, y)


@pytest.mark.parametrize("name", ["pool", "bar", "snooker", "corners only", "sides only"])
def test_a_ball_lies_where_there_is_room_in_the_drawing(name: str) -> None:
    table = TABLES[name]
    radius = (bs.Physics.snooker() if name == "snooker" else bs.Physics.pool()).radius
    parts = outline(table)
    rng = np.random.default_rng(7)
    told = {True: 0, False: 0}
    for mouth in table.mouths:
        middle = np.array(mouth.centre) + table.centre
        for x, y in (middle + rng.uniform(-0.16, 0.16, (300, 2))).tolist():
            on_cloth = contains(parts.cloth, x, y)
            gap = min(distance(polygon, x, y) for polygon in parts.cushions) - radius
            if abs(gap) < MARGIN or distance(parts.cloth, x, y) < MARGIN:
                continue
            trouble = trouble_at(table, radius, x - table.centre[0], y - table.centre[1], 0.0)
            assert (on_cloth and gap > 0.0) == (trouble == ""), (x, y, trouble)
            told[trouble == ""] += 1
    assert min(told.values()) > 50
