# SPDX-License-Identifier: Apache-2.0
"""How balls are turned: orientation integrated from the angular velocity, where a scene asks for it.

A unit quaternion (x, y, z, w) takes directions fixed in the ball to the frame `table`; q' = w q / 2 with the angular
velocity w in that frame. Between events w = a + b t, so the exponent of the Magnus series (1954) to fourth order is

    h w(h/2) - h^3/12 a x b,

exact in one step where a and b are parallel: in rolling without spin about the vertical, and without friction.
Otherwise the step is cut until what is left out is below 1e-7 rad a second.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from .kernel import kernel
from .state import State

MOST_TURN = 0.1
"""rad. Largest turn in a step where the axis of rotation turns too."""

PARALLEL_ROUNDING = 1e-12
"""Relative: a and b are parallel but for rounding."""


@dataclass(slots=True)
class Turn:
    """Orientation of a ball at a time, and its angular velocity from then on."""

    time: float = 0.0  # s
    wx: float = 0.0  # rad/s
    wy: float = 0.0
    wz: float = 0.0
    alpha_x: float = 0.0  # rad/s^2
    alpha_y: float = 0.0
    alpha_z: float = 0.0  # until wz is 0
    end: float = 0.0  # s, until when `turn_each` turns
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 0.0


class Turns(NamedTuple):
    """How balls are turned: a row a ball, or a row for each stretch of a motion."""

    turns: Sequence[Turn]


@kernel
def turn_all(turns: Turns, time: float) -> None:
    """Turn every ball on to a time."""
    for i in range(len(turns.turns)):
        _turn_to(turns.turns[i], time)


@kernel
def turn_each(turns: Turns) -> None:
    """Turn each on to its own end."""
    for i in range(len(turns.turns)):
        _turn_to(turns.turns[i], turns.turns[i].end)


@kernel
def turn_along(turns: Turns) -> None:
    """Carry the orientation of each ball through the stretches of its motion, which follow each other.

    Its first stretch has the orientation; those after it, up to the next ball's first, have none yet: qw is 0.
    """
    rows = turns.turns
    for k in range(1, len(rows)):
        if rows[k].qw == 0.0:
            _turn_from(rows[k - 1], rows[k])


@kernel
def follow(state: State, turns: Turns) -> None:
    """Turn every ball on to where its present motion began, and take that over."""
    for i in range(len(turns.turns)):
        ball = state.balls[i]
        turn = turns.turns[i]
        _turn_to(turn, ball.time)
        turn.wx = ball.wx
        turn.wy = ball.wy
        turn.wz = ball.wz
        turn.alpha_x = ball.alpha_x
        turn.alpha_y = ball.alpha_y
        turn.alpha_z = ball.alpha_z


@kernel
def _turn_from(before: Turn, turn: Turn) -> None:
    # Give a turn the orientation that the one before it, of the same ball, leads to.
    time, wx, wy, wz = turn.time, turn.wx, turn.wy, turn.wz
    alpha_x, alpha_y, alpha_z = turn.alpha_x, turn.alpha_y, turn.alpha_z
    turn.time = before.time
    turn.wx = before.wx
    turn.wy = before.wy
    turn.wz = before.wz
    turn.alpha_x = before.alpha_x
    turn.alpha_y = before.alpha_y
    turn.alpha_z = before.alpha_z
    turn.qx = before.qx
    turn.qy = before.qy
    turn.qz = before.qz
    turn.qw = before.qw
    _turn_to(turn, time)
    turn.wx, turn.wy, turn.wz = wx, wy, wz
    turn.alpha_x, turn.alpha_y, turn.alpha_z = alpha_x, alpha_y, alpha_z


@kernel
def _turn_to(turn: Turn, time: float) -> None:
    if turn.alpha_z != 0.0:
        stop = turn.time - turn.wz / turn.alpha_z
        if stop < time:  # its spin about the vertical ends before
            _turn_steadily(turn, max(stop, turn.time))
            turn.wz = 0.0
            turn.alpha_z = 0.0
    _turn_steadily(turn, time)


@kernel
def _turn_steadily(turn: Turn, time: float) -> None:
    duration = time - turn.time
    turn.time = time
    if duration == 0.0:
        return
    # a x b
    cross_x = turn.wy * turn.alpha_z - turn.wz * turn.alpha_y
    cross_y = turn.wz * turn.alpha_x - turn.wx * turn.alpha_z
    cross_z = turn.wx * turn.alpha_y - turn.wy * turn.alpha_x
    cross = math.sqrt(cross_x * cross_x + cross_y * cross_y + cross_z * cross_z)
    end_x = turn.wx + turn.alpha_x * duration
    end_y = turn.wy + turn.alpha_y * duration
    rate = math.sqrt(max(turn.wx * turn.wx + turn.wy * turn.wy, end_x * end_x + end_y * end_y) + turn.wz * turn.wz)
    angular_acceleration = math.sqrt(
        turn.alpha_x * turn.alpha_x + turn.alpha_y * turn.alpha_y + turn.alpha_z * turn.alpha_z
    )
    steps = 1
    if cross > PARALLEL_ROUNDING * rate * angular_acceleration:
        steps = 1 + int(rate * duration / MOST_TURN)
    h = duration / steps
    twist = h * h * h / 12.0
    for _ in range(steps):
        _rotate(
            turn,
            h * (turn.wx + 0.5 * h * turn.alpha_x) - twist * cross_x,
            h * (turn.wy + 0.5 * h * turn.alpha_y) - twist * cross_y,
            h * (turn.wz + 0.5 * h * turn.alpha_z) - twist * cross_z,
        )
        turn.wx += h * turn.alpha_x  # a x b stays what it is
        turn.wy += h * turn.alpha_y
        turn.wz += h * turn.alpha_z


@kernel
def _rotate(turn: Turn, x: float, y: float, z: float) -> None:
    # By the rotation vector, rad, in the frame `table`.
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return
    scale = math.sin(0.5 * angle) / angle
    c = math.cos(0.5 * angle)
    x *= scale
    y *= scale
    z *= scale
    qx, qy, qz, qw = turn.qx, turn.qy, turn.qz, turn.qw
    nx = c * qx + x * qw + y * qz - z * qy
    ny = c * qy + y * qw + z * qx - x * qz
    nz = c * qz + z * qw + x * qy - y * qx
    nw = c * qw - x * qx - y * qy - z * qz
    length = math.sqrt(nx * nx + ny * ny + nz * nz + nw * nw)
    turn.qx = nx / length
    turn.qy = ny / length
    turn.qz = nz / length
    turn.qw = nw / length
