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

from billiards_sim.engine.jit import entry, kernel
from billiards_sim.engine.state import State

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
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 0.0


@dataclass(slots=True)
class End:
    """When a turn ends."""

    time: float = 0.0  # s


@entry
def turn_all(turns: Sequence[Turn], time: float) -> None:
    """Turn every ball on to a time."""
    for i in range(len(turns)):
        _turn_to(turns[i], time)


@entry
def turn_along(turns: Sequence[Turn], scratch: Sequence[Turn]) -> None:
    """Carry the orientation of the first through the others: one ball's turns, one for each stretch of its motion.

    `scratch` is a row to work in.
    """
    turn = scratch[0]
    for k in range(1, len(turns)):
        _copy(turns[k - 1], turn)
        _turn_to(turn, turns[k].time)
        turns[k].qx = turn.qx
        turns[k].qy = turn.qy
        turns[k].qz = turn.qz
        turns[k].qw = turn.qw


@entry
def turn_each(turns: Sequence[Turn], ends: Sequence[End]) -> None:
    """Turn each on to its own end."""
    for k in range(len(turns)):
        _turn_to(turns[k], ends[k].time)


@kernel
def follow(state: State, turns: Sequence[Turn]) -> None:
    """Turn every ball on to where its present motion began, and take that over."""
    for i in range(len(turns)):
        ball = state.balls[i]
        turn = turns[i]
        _turn_to(turn, ball.time)
        turn.wx = ball.wx
        turn.wy = ball.wy
        turn.wz = ball.wz
        turn.alpha_x = ball.alpha_x
        turn.alpha_y = ball.alpha_y


@kernel
def _copy(turn: Turn, to: Turn) -> None:
    to.time = turn.time
    to.wx = turn.wx
    to.wy = turn.wy
    to.wz = turn.wz
    to.alpha_x = turn.alpha_x
    to.alpha_y = turn.alpha_y
    to.qx = turn.qx
    to.qy = turn.qy
    to.qz = turn.qz
    to.qw = turn.qw


@kernel
def _turn_to(turn: Turn, time: float) -> None:
    duration = time - turn.time
    turn.time = time
    if duration == 0.0:
        return
    # a x b, with b horizontal
    cross_x = -turn.wz * turn.alpha_y
    cross_y = turn.wz * turn.alpha_x
    cross_z = turn.wx * turn.alpha_y - turn.wy * turn.alpha_x
    cross = math.sqrt(cross_x * cross_x + cross_y * cross_y + cross_z * cross_z)
    end_x = turn.wx + turn.alpha_x * duration
    end_y = turn.wy + turn.alpha_y * duration
    rate = math.sqrt(max(turn.wx * turn.wx + turn.wy * turn.wy, end_x * end_x + end_y * end_y) + turn.wz * turn.wz)
    angular_acceleration = math.sqrt(turn.alpha_x * turn.alpha_x + turn.alpha_y * turn.alpha_y)
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
            h * turn.wz - twist * cross_z,
        )
        turn.wx += h * turn.alpha_x  # a x b stays what it is
        turn.wy += h * turn.alpha_y


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
