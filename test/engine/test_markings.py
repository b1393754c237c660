# SPDX-License-Identifier: Apache-2.0
"""Spots and lines are where the rules have them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.engine.markings import lines, spots

INCH = 0.0254
SNOOKER = bs.Table.snooker_12ft()
CAROM = bs.Table.carom_10ft()


def test_snooker_has_a_baulk_line_and_a_d_whose_ends_are_spots() -> None:
    # WPBSA: 29 in from the bottom cushion, a half-circle of 11 1/2 in, to within a millimetre.
    baulk, half_round = (np.array(line) for line in lines(SNOOKER))
    assert baulk == pytest.approx(
        np.array([(SNOOKER.x_min + 29.0 * INCH, y) for y in (SNOOKER.y_min, SNOOKER.y_max)]), abs=1e-3
    )
    where = spots(SNOOKER)
    assert half_round[[0, -1]] == pytest.approx(np.array([where["green"], where["yellow"]]))
    assert np.hypot(*(half_round - where["brown"]).T) == pytest.approx(np.full(len(half_round), 11.5 * INCH), abs=1e-3)
    assert half_round[:, 0].min() == pytest.approx(SNOOKER.x_min + 17.5 * INCH, abs=1e-3)  # towards the bottom
    assert np.hypot(*np.diff(half_round, axis=0).T).sum() == pytest.approx(math.pi * 11.5 * INCH, abs=2e-3)


def test_the_colours_of_snooker_begin_on_its_spots() -> None:
    scene, where = bs.scenes.snooker(), spots(SNOOKER)
    assert len(where) == 6
    for name, place in where.items():
        assert scene.positions[scene.names.index(name)].tolist() == list(place)
    assert where["black"] == pytest.approx((SNOOKER.x_max - 12.75 * INCH, SNOOKER.centre[1]), abs=1e-3)


def test_the_balls_of_three_cushion_begin_on_spots() -> None:
    assert lines(CAROM) == []
    where = list(spots(CAROM).values())
    assert len(where) == len(set(where)) == 5
    assert CAROM.centre in where
    for place in bs.scenes.three_cushion().positions.tolist():
        assert tuple(place) in where


@pytest.mark.parametrize("table", [bs.Table(), bs.Table.pool_9ft(), bs.Table.snooker_12ft(length=3.0)])
def test_other_tables_have_a_head_and_a_foot_spot_and_no_lines(table: bs.Table) -> None:
    assert spots(table) == {"head": table.head_spot, "foot": table.foot_spot}
    assert lines(table) == []


def test_a_table_keeps_its_marks_where_its_cushions_are_others() -> None:
    assert spots(bs.Table.snooker_12ft(nose_height=0.6, corner_pocket=None)) == spots(SNOOKER)
