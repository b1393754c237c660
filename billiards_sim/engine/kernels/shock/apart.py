# SPDX-License-Identifier: Apache-2.0
"""Balls of a slow island moved apart, so that the rigid rules can take over, which know no overlap."""

from __future__ import annotations

import math

from ..cells import first_neighbour, next_neighbour
from ..feature import next_feature, normal_of, overlap_with
from ..kernel import kernel
from ..motion import place_at
from ..settle import advance_to as settle_to
from ..state import NOBODY, OFF_TABLE, Constants, State
from .touch import way_to

NEAR = 1e-12
"""m. Overlaps as small as that are not parted."""

BESIDE = 1e-5
"""m. The overlaps that are parted when the rigid rules take over are half as large at most."""

SEPARATING_SWEEPS = 100
"""Bound on the sweeps that part what still overlaps by some 1e-6 m when the rigid rules take over."""


@kernel
def leans_on_others(state: State, constants: Constants, count: int, now: float) -> bool:
    """Whether beside a slow island there is a ball that presses others, and is not to be moved."""
    for k in range(count):
        i = state.members[k].ball
        j = first_neighbour(state, constants, i)
        while j != NOBODY:
            presses = state.balls[j].touches > 0 and not state.stages[j].slow
            if presses and not _is_member(state, count, j):
                gap, _, _ = way_to(state, constants, i, j, now)
                if gap < BESIDE:
                    return True
            j = next_neighbour(state, constants, i, j)
    return False


@kernel
def _is_member(state: State, count: int, j: int) -> bool:
    k = 0
    while k < count and state.members[k].ball != j:
        k += 1
    return k < count


@kernel
def separate(state: State, constants: Constants, touches: int, now: float) -> None:
    """Move the balls of an island apart until none overlaps, with those that stand in their way."""
    for c in range(touches):
        touch = state.touches[c]
        state.stages[touch.first].moved = True
        if touch.second >= 0:
            state.stages[touch.second].moved = True
    for _ in range(SEPARATING_SWEEPS):
        worst = 0.0
        for i in range(len(state.balls)):
            if state.stages[i].moved:
                worst = max(worst, _move_off(state, constants, i, now))
        if worst <= NEAR:
            break
    for i in range(len(state.balls)):
        state.stages[i].moved = False


@kernel
def _move_off(state: State, constants: Constants, i: int, now: float) -> float:
    # Move a ball off whom it overlaps with; returns the largest overlap, m.
    ball = state.balls[i]
    worst = 0.0
    k = next_feature(state, NOBODY, ball.x, ball.y, 0.0)
    while k != NOBODY:
        depth = overlap_with(state, k, ball.x, ball.y)
        if depth > NEAR:
            nx, ny = normal_of(state, k, ball.x, ball.y)
            ball.x += depth * nx
            ball.y += depth * ny
            worst = max(worst, depth)
        k = next_feature(state, k, ball.x, ball.y, 0.0)
    j = first_neighbour(state, constants, i)
    while j != NOBODY:
        other = state.balls[j]
        if j != i and other.phase != OFF_TABLE:
            x, y = place_at(other, now)
            dx, dy = ball.x - x, ball.y - y
            distance = math.sqrt(dx * dx + dy * dy)
            depth = 2.0 * constants.radius - distance
            if depth > NEAR:
                worst = max(worst, depth)
                yields = state.stages[j].moved or other.touches == 0 or state.stages[j].slow
                if not state.stages[j].moved and other.touches == 0:
                    settle_to(state, constants, j, now)
                    state.stages[j].moved = True
                part = 0.5 * depth / distance if yields else depth / distance
                ball.x += part * dx
                ball.y += part * dy
                if yields:
                    other.x -= part * dx
                    other.y -= part * dy
        j = next_neighbour(state, constants, i, j)
    return worst
