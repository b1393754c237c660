# SPDX-License-Identifier: Apache-2.0
"""The cells that the playing area is cut into: who may be near whom.

A ball looks for others in its own cell and the eight around it, until it leaves the cell. Few balls share one cell,
which nothing leaves.
"""

from __future__ import annotations

from .detection import rail_contact_time
from .kernel import kernel
from .motion import place_at, velocity_at
from .state import INF, NOBODY, OFF_TABLE, X_MAX, X_MIN, Y_MAX, Y_MIN, Ball, Constants, State


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
def enter_cells(state: State, constants: Constants) -> None:
    """Begin: every ball in play is in its cell."""
    for c in range(len(state.cells)):
        state.cells[c].ball = NOBODY
    for i in range(len(state.balls) - 1, -1, -1):
        ball = state.balls[i]
        if ball.phase != OFF_TABLE:
            enter_cell(state, constants, i)


@kernel
def enter_cell(state: State, constants: Constants, i: int) -> None:
    """Put ball i, whose anchor is now, into the cell where it is."""
    ball = state.balls[i]
    ball.cell_x = _cell_of(ball.x, constants.cell_width, constants.cells_x)
    ball.cell_y = _cell_of(ball.y, constants.cell_height, constants.cells_y)
    _link(state, constants, i)


@kernel
def _cell_of(place: float, width: float, count: int) -> int:
    return min(max(int(place / width + 0.5 * count), 0), count - 1)


@kernel
def _link(state: State, constants: Constants, i: int) -> None:
    ball = state.balls[i]
    cell = state.cells[ball.cell_y * constants.cells_x + ball.cell_x]
    ball.next_in_cell = cell.ball
    cell.ball = i


@kernel
def leave_cell(state: State, constants: Constants, i: int) -> None:
    """Take ball i out of its cell."""
    ball = state.balls[i]
    cell = state.cells[ball.cell_y * constants.cells_x + ball.cell_x]
    if cell.ball == i:
        cell.ball = ball.next_in_cell
    else:
        j = cell.ball
        while state.balls[j].next_in_cell != i:
            j = state.balls[j].next_in_cell
        state.balls[j].next_in_cell = ball.next_in_cell


@kernel
def change_cell(state: State, constants: Constants, i: int) -> None:
    """Move ball i over the border that it has come to."""
    leave_cell(state, constants, i)
    ball = state.balls[i]
    if ball.border == X_MIN:
        ball.cell_x -= 1
    elif ball.border == X_MAX:
        ball.cell_x += 1
    elif ball.border == Y_MIN:
        ball.cell_y -= 1
    else:
        ball.cell_y += 1
    _link(state, constants, i)


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
def _try_border(
    ball: Ball, border: int, inner: bool, now: float, distance: float, speed: float, acceleration: float
) -> None:
    if inner and (speed != 0.0 or acceleration != 0.0):
        time = now + rail_contact_time(distance, speed, acceleration, 0.0)
        if time < ball.border_time:
            ball.border_time = time
            ball.border = border
