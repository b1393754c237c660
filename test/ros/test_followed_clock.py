# SPDX-License-Identifier: Apache-2.0
"""When a clock that others move makes a tick due."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from billiards_sim.ros.followed_clock import FollowedClock

MS = 1_000_000
PERIOD = 10 * MS


def ticks(readings: Iterable[int]) -> list[tuple[int, int | None]]:
    """Readings (ms) at which a tick is due, and the ns since the one before."""
    clock = FollowedClock()
    found = []
    for reading in readings:
        if clock.due(reading * MS, PERIOD):
            found.append((reading, clock.tick(reading * MS)))
    return found


@pytest.mark.parametrize("step", [10, 1, 4, 7])
def test_ticks_come_at_their_rate_whatever_the_steps_of_the_clock(step: int) -> None:
    found = ticks(range(1_003, 3_003, step))
    assert found[0] == (1_003, None)
    assert abs(len(found) - 200) <= 1
    assert sum(since for _, since in found[1:]) == (found[-1][0] - 1_003) * MS


def test_a_step_of_many_periods_is_one_tick() -> None:
    assert ticks([1_000, 1_500, 1_501, 1_510]) == [(1_000, None), (1_500, 500 * MS), (1_510, 10 * MS)]


def test_a_clock_that_stands_still_makes_no_tick() -> None:
    assert ticks([1_000, 1_010, 1_010, 1_010, 1_020]) == [(1_000, None), (1_010, 10 * MS), (1_020, 10 * MS)]


def test_a_clock_at_zero_is_not_set_yet() -> None:
    assert ticks([0, 0, 2, 9, 10]) == [(2, None), (10, 8 * MS)]


def test_a_clock_that_goes_back_is_told_once() -> None:
    assert ticks([5_000, 2_003, 2_004, 2_010]) == [(5_000, None), (2_003, -2_997 * MS), (2_010, 7 * MS)]


def test_a_clock_that_is_set_to_zero_begins_anew() -> None:
    assert ticks([5_000, 0, 0, 7]) == [(5_000, None), (0, -5_000 * MS), (7, None)]
