# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a table is where the engine has it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.engine.features import trouble_at
from billiards_sim.table_shape import shape_of

TABLES: tuple[Callable[[], bs.Table], ...] = (bs.Table, bs.Table.pool_9ft, bs.Table.snooker_12ft, bs.Table.carom_10ft)
RADIUS = 0.02


@pytest.mark.parametrize("make", TABLES)
def test_noses_are_as_long_as_pockets_leave_them(make: Callable[[], bs.Table]) -> None:
    table = make()
    cushions = shape_of(table).cushions
    corner, side = table.corner_pocket, table.side_pocket
    at_corner = 0.0 if corner is None else corner.mouth / math.sqrt(2.0) + corner.setback
    at_side = 0.0 if side is None else 0.5 * side.mouth + side.setback
    long = table.length - 2.0 * at_corner - 2.0 * at_side
    assert len(cushions) == (4 if side is None else 6)
    found = {"long": 0.0, "short": 0.0}
    for cushion in cushions:
        places = np.array(cushion)
        for axis, low, high, kind in ((1, table.y_min, table.y_max, "long"), (0, table.x_min, table.x_max, "short")):
            for nose in (low, high):
                on_nose = places[np.abs(places[:, axis] - nose) < 1e-12]
                if len(on_nose) == 2:
                    found[kind] += float(np.ptp(on_nose[:, 1 - axis]))
    assert found["long"] == pytest.approx(2.0 * long, abs=1e-12)
    assert found["short"] == pytest.approx(2.0 * (table.width - 2.0 * at_corner), abs=1e-12)


@pytest.mark.parametrize("make", TABLES)
def test_a_ball_that_touches_the_rubber_touches_what_the_engine_has_there(make: Callable[[], bs.Table]) -> None:
    table = make()
    centre = np.array(table.centre)
    seen = 0
    for cushion in shape_of(table).cushions:
        places = np.array(cushion) - centre
        x, y = places.T
        turn = np.sign(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))  # > 0: listed counter-clockwise
        # the edge from one jaw's start to the other's, without what lies behind; its outward side is the table
        for a, b in zip(places[1:-2], places[2:-1]):
            outward = turn * np.array([b[1] - a[1], a[0] - b[0]])
            for depth, wanted in ((-1e-4, True), (1e-4, False)):
                at = 0.5 * (a + b) + outward / np.hypot(*outward) * (RADIUS + depth)
                trouble = trouble_at(table, RADIUS, *at.tolist(), 1e-9)
                if "pocket" not in trouble:
                    assert bool(trouble) == wanted, (trouble, at, depth)
                    seen += 1
    assert seen >= 8


@pytest.mark.parametrize("make", TABLES)
def test_a_table_is_drawn_as_symmetric_as_it_is(make: Callable[[], bs.Table]) -> None:
    table = make()
    shape = shape_of(table)
    places = np.array([place for cushion in shape.cushions for place in cushion] + list(shape.sights)) - table.centre
    for mirror in ((-1.0, 1.0), (1.0, -1.0)):
        mirrored = places * mirror
        distances = np.abs(places[:, np.newaxis] - mirrored).max(axis=2)
        assert distances.min(axis=1).max() < 1e-12
    assert len(shape.pockets) == len(table.mouths)
