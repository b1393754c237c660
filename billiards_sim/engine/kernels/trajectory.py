# SPDX-License-Identifier: Apache-2.0
"""What a run can leave behind: every stretch of every ball's motion, in closed form.

A run that is followed goes on by one event at a time with `run_until`, the loop of every other run, and is looked at
after each. So it has the same bits, and a run that nobody follows pays nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from .kernel import kernel
from .loop import PAUSED, run_until
from .orientation import Turns, follow
from .state import Ball, State


@dataclass(slots=True)
class Arc:
    """A stretch of a ball's motion, x + v t + a t^2/2 and w + alpha t from a time on, until its next arc."""

    ball: int = 0
    time: float = 0.0  # s
    x: float = 0.0  # m, centred
    y: float = 0.0
    vx: float = 0.0  # m/s
    vy: float = 0.0
    ax: float = 0.0  # m/s^2
    ay: float = 0.0
    wx: float = 0.0  # rad/s
    wy: float = 0.0
    wz: float = 0.0
    alpha_x: float = 0.0  # rad/s^2
    alpha_y: float = 0.0
    alpha_z: float = 0.0  # until wz is 0


@dataclass(slots=True)
class Spool:
    """How much is on a tape."""

    arcs: int = 0


class Tape(NamedTuple):
    """What the kernels write arcs on. The spool is a table of one row."""

    latest: Sequence[Arc]  # the arc of each ball; without rows nothing is written
    arcs: Sequence[Arc]  # those not handed over yet, in the order of their times
    spool: Sequence[Spool]


@kernel
def run_followed(state: State, turns: Turns, tape: Tape, until: float, taken: int, work: int) -> int:
    """What `run_until` does, with orientations that follow every ball's motion and arcs that are written down."""
    # For a literal number Numba would compile the whole loop again.
    none, one = -work, min(work, 1)
    run_until(state, until, taken, none)
    follow(state, turns)
    _write(state, tape)
    room = len(tape.arcs) - len(tape.latest)
    clock = state.clock[0]
    enough = clock.work + work
    while clock.work < enough:
        if tape.spool[0].arcs > room:
            return PAUSED
        passes = clock.passes
        status = run_until(state, until, taken, one)
        follow(state, turns)
        _write(state, tape)
        if status != PAUSED or clock.passes == passes:
            return status
    return PAUSED


@kernel
def _write(state: State, tape: Tape) -> None:
    for i in range(len(tape.latest)):
        ball = state.balls[i]
        latest = tape.latest[i]
        if ball.x != ball.x and latest.time == ball.time:  # nan, which differs from itself: it was never in play
            continue
        if _has_changed(ball, latest):
            _copy(ball, latest)
            arc = tape.arcs[tape.spool[0].arcs]
            _copy(ball, arc)
            arc.ball = i
            tape.spool[0].arcs += 1


@kernel
def _has_changed(ball: Ball, arc: Arc) -> bool:
    return (
        ball.time != arc.time
        or ball.x != arc.x
        or ball.y != arc.y
        or ball.vx != arc.vx
        or ball.vy != arc.vy
        or ball.ax != arc.ax
        or ball.ay != arc.ay
        or ball.wx != arc.wx
        or ball.wy != arc.wy
        or ball.wz != arc.wz
        or ball.alpha_x != arc.alpha_x
        or ball.alpha_y != arc.alpha_y
        or ball.alpha_z != arc.alpha_z
    )


@kernel
def _copy(ball: Ball, arc: Arc) -> None:
    arc.time = ball.time
    arc.x = ball.x
    arc.y = ball.y
    arc.vx = ball.vx
    arc.vy = ball.vy
    arc.ax = ball.ax
    arc.ay = ball.ay
    arc.wx = ball.wx
    arc.wy = ball.wy
    arc.wz = ball.wz
    arc.alpha_x = ball.alpha_x
    arc.alpha_y = ball.alpha_y
    arc.alpha_z = ball.alpha_z
