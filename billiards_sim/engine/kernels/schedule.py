# SPDX-License-Identifier: Apache-2.0
"""What comes next: the predicted contacts of every ball, and the earliest event of all.

The playing area is cut into cells; a ball looks for contacts in its own cell and the eight around it, until it leaves
the cell. Few balls share one cell, which nothing leaves. An event changes the motion of one ball or
a few; only these are predicted again. The earliest event is on top of a tournament tree over the balls: each node holds
the ball of the two below it that comes first.
"""

from __future__ import annotations

from .detection import contact_time, rail_contact_time
from .kernel import kernel
from .motion import place_at, velocity_at
from .state import AT_REST, INF, NOBODY, OFF_TABLE, X_MAX, X_MIN, Y_MAX, Y_MIN, Ball, Constants, State


@kernel
def mark(state: State, i: int) -> None:
    """Note that the motion of ball i has changed: it is to be set going, and predicted again."""
    if not state.balls[i].changed:
        state.balls[i].changed = True
        state.changed[state.clock[0].changed].ball = i
        state.clock[0].changed += 1


@kernel
def first_neighbour(state: State, constants: Constants, i: int) -> int:
    """First ball in the cells around ball i, itself among them; NOBODY if there is none."""
    ball = state.balls[i]
    return _first_from(state, constants, ball, max(ball.cell_x - 1, 0), max(ball.cell_y - 1, 0))


@kernel
def next_neighbour(state: State, constants: Constants, i: int, j: int) -> int:
    """The one after ball j."""
    other = state.balls[j]
    if other.next_in_cell != NOBODY:
        return other.next_in_cell
    return _first_from(state, constants, state.balls[i], other.cell_x + 1, other.cell_y)


@kernel
def _first_from(state: State, constants: Constants, ball: Ball, x: int, y: int) -> int:
    # First ball in the cells around `ball`, row by row, from cell (x, y) on.
    last_x = min(ball.cell_x + 1, constants.cells_x - 1)
    last_y = min(ball.cell_y + 1, constants.cells_y - 1)
    while y <= last_y:
        while x <= last_x:
            head = state.cells[y * constants.cells_x + x].ball
            if head != NOBODY:
                return head
            x += 1
        x = max(ball.cell_x - 1, 0)
        y += 1
    return NOBODY


@kernel
def enter_all(state: State, constants: Constants) -> None:
    """Begin: every ball in play is in its cell, on its leaf of the tree and marked as changed."""
    for c in range(len(state.cells)):
        state.cells[c].ball = NOBODY
    count = len(state.balls)
    half = len(state.nodes) // 2
    for i in range(count - 1, -1, -1):
        ball = state.balls[i]
        if ball.phase == OFF_TABLE:
            ball.event_time = INF
            continue
        ball.cell_x = min(max(int(ball.x / constants.cell_width + 0.5 * constants.cells_x), 0), constants.cells_x - 1)
        ball.cell_y = min(max(int(ball.y / constants.cell_height + 0.5 * constants.cells_y), 0), constants.cells_y - 1)
        _enter_cell(state, constants, i)
    for i in range(count):
        if state.balls[i].phase != OFF_TABLE:
            mark(state, i)
    for k in range(half):
        state.nodes[half + k].ball = k if k < count else NOBODY
    for k in range(half - 1, 0, -1):
        state.nodes[k].ball = state.nodes[2 * k].ball


@kernel
def _enter_cell(state: State, constants: Constants, i: int) -> None:
    ball = state.balls[i]
    cell = state.cells[ball.cell_y * constants.cells_x + ball.cell_x]
    ball.next_in_cell = cell.ball
    cell.ball = i


@kernel
def change_cell(state: State, constants: Constants, i: int) -> None:
    """Move ball i over the border that it has come to."""
    ball = state.balls[i]
    cell = state.cells[ball.cell_y * constants.cells_x + ball.cell_x]
    if cell.ball == i:
        cell.ball = ball.next_in_cell
    else:
        j = cell.ball
        while state.balls[j].next_in_cell != i:
            j = state.balls[j].next_in_cell
        state.balls[j].next_in_cell = ball.next_in_cell
    if ball.border == X_MIN:
        ball.cell_x -= 1
    elif ball.border == X_MAX:
        ball.cell_x += 1
    elif ball.border == Y_MIN:
        ball.cell_y -= 1
    else:
        ball.cell_y += 1
    _enter_cell(state, constants, i)


@kernel
def predict_border(ball: Ball, constants: Constants, now: float) -> None:
    """Find when a ball leaves its cell; never where there is one cell."""
    ball.border_time = INF
    if constants.cells_x == 1 and constants.cells_y == 1:
        return
    x, y = place_at(ball, now)
    vx, vy = velocity_at(ball, now)
    low_x = constants.cell_width * (ball.cell_x - 0.5 * constants.cells_x)
    low_y = constants.cell_height * (ball.cell_y - 0.5 * constants.cells_y)
    _try_border(ball, X_MIN, ball.cell_x > 0, now, x - low_x, -vx, -ball.ax)
    _try_border(ball, X_MAX, ball.cell_x < constants.cells_x - 1, now, low_x + constants.cell_width - x, vx, ball.ax)
    _try_border(ball, Y_MIN, ball.cell_y > 0, now, y - low_y, -vy, -ball.ay)
    _try_border(ball, Y_MAX, ball.cell_y < constants.cells_y - 1, now, low_y + constants.cell_height - y, vy, ball.ay)


@kernel
def _try_border(ball: Ball, border: int, inner: bool, now: float, distance: float, speed: float, pull: float) -> None:
    if inner and (speed != 0.0 or pull != 0.0):
        time = now + rail_contact_time(distance, speed, pull, 0.0)
        if time < ball.border_time:
            ball.border_time = time
            ball.border = border


@kernel
def predict_rail(ball: Ball, constants: Constants) -> None:
    """Find the next rail contact of a ball, from its anchor on."""
    best = INF
    rail = NOBODY
    least = constants.least_approach
    if not ball.held_x and (ball.vx != 0.0 or ball.ax != 0.0):
        low = rail_contact_time(ball.x + constants.limit_x, -ball.vx, -ball.ax, least)
        high = rail_contact_time(constants.limit_x - ball.x, ball.vx, ball.ax, least)
        best, rail = (low, X_MIN) if low < high else (high, X_MAX)
    if not ball.held_y and (ball.vy != 0.0 or ball.ay != 0.0):
        low = rail_contact_time(ball.y + constants.limit_y, -ball.vy, -ball.ay, least)
        high = rail_contact_time(constants.limit_y - ball.y, ball.vy, ball.ay, least)
        if low < best:
            best, rail = low, Y_MIN
        if high < best:
            best, rail = high, Y_MAX
    ball.rail_time = ball.time + best
    ball.rail = rail


@kernel
def hold_each_other(state: State, i: int, j: int) -> bool:
    """Whether balls i and j are in sustained contact with each other."""
    for c in range(state.clock[0].contacts):
        first, second = state.contacts[c].first, state.contacts[c].second
        if (first == i and second == j) or (first == j and second == i):
            return True
    return False


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
    mine.horizon = min(mine.phase_end, mine.rail_time, mine.border_time)
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
