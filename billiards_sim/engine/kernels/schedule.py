# SPDX-License-Identifier: Apache-2.0
"""What comes next: the predicted contacts of every ball, and the earliest event of all.

An event changes the motion of one ball or a few; only these are predicted again, against those in the cells around
them. The earliest event is on top of a tournament tree over the balls: each node holds the ball of the two below it
that comes first.
"""

from __future__ import annotations

from .cells import enter_cells, first_neighbour, next_neighbour
from .detection import contact_time
from .island import hold_each_other
from .kernel import kernel
from .motion import mark, place_at, velocity_at
from .state import AT_REST, INF, NOBODY, OFF_TABLE, Constants, State


@kernel
def enter_all(state: State, constants: Constants) -> None:
    """Begin: every ball is on its leaf of the tree; those in play are in their cells and marked as changed."""
    enter_cells(state, constants)
    count = len(state.balls)
    half = len(state.nodes) // 2
    for i in range(count):
        if state.balls[i].phase == OFF_TABLE:
            state.balls[i].event_time = INF
        else:
            mark(state, i)
    for k in range(half):
        state.nodes[half + k].ball = k if k < count else NOBODY
    for k in range(half - 1, 0, -1):
        state.nodes[k].ball = state.nodes[2 * k].ball


@kernel
def predict_pairs(state: State, constants: Constants, i: int, now: float) -> None:
    """Predict the contacts of ball i with its neighbours, from now on.

    A neighbour that was to meet ball i, and now does not or later, keeps the time as the earliest at which it can meet
    anybody: it is predicted again only then, if nothing happens to it before.
    """
    mine = state.balls[i]
    x, y = place_at(mine, now)
    vx, vy = velocity_at(mine, now)
    ax, ay = mine.ax, mine.ay
    moving = vx != 0.0 or vy != 0.0 or ax != 0.0 or ay != 0.0
    mine.horizon = min(mine.phase_end, mine.feature_time, mine.border_time)
    best = INF
    partner = NOBODY
    looks = 0
    j = first_neighbour(state, constants, i)
    while j != NOBODY:
        other = state.balls[j]
        looks += 1
        time = INF
        if j != i and (moving or other.phase != AT_REST):
            other_x, other_y = place_at(other, now)
            other_vx, other_vy = velocity_at(other, now)
            time = now + contact_time(
                x - other_x,
                y - other_y,
                vx - other_vx,
                vy - other_vy,
                ax - other.ax,
                ay - other.ay,
                min(mine.horizon, other.horizon) - now,
                2.0 * constants.radius,
                constants.least_approach,
            )
            if time < INF and mine.held > 0 and other.held > 0 and hold_each_other(state, i, j):
                time = INF
        if time < best:
            best = time
            partner = j
        if time < other.hit_time:
            other.hit_time = time
            other.hit = i
            reschedule(state, j)
        elif other.hit == i and time > other.hit_time:
            other.hit = NOBODY
        j = next_neighbour(state, constants, i, j)
    state.clock[0].work += looks
    mine.hit_time = best
    mine.hit = partner
    reschedule(state, i)


@kernel
def await_step(state: State, i: int) -> None:
    """Have ball i, in an elastic contact, come next at the end of its step: whom it meets until then is found there."""
    ball = state.balls[i]
    ball.feature_time = INF
    ball.hit_time = INF
    ball.hit = NOBODY
    ball.horizon = min(ball.phase_end, ball.border_time)
    reschedule(state, i)


@kernel
def reschedule(state: State, i: int) -> None:
    """Bring the tree up to date with the times of ball i. Of two at the same instant the lower index comes first."""
    balls = state.balls
    nodes = state.nodes
    ball = balls[i]
    ball.event_time = min(ball.horizon, ball.hit_time)
    at = (len(nodes) // 2 + i) // 2
    while at >= 1:
        left, right = nodes[2 * at].ball, nodes[2 * at + 1].ball
        best = left
        if right != NOBODY and balls[right].event_time < balls[left].event_time:
            best = right
        if best == nodes[at].ball and best != i:
            return
        nodes[at].ball = best
        at //= 2
