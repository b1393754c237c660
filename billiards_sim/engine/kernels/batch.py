# SPDX-License-Identifier: Apache-2.0
"""Many shots from one start, one after the other, without Python between them.

Each is what a simulation does with it alone: the balls are laid down as at the start, the clock is set back as for a
shot at resting balls, the ball is struck, and the loop goes on to the end. So each has the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from .kernel import kernel
from .law.spin import last_spin_end
from .loop import DONE, run_until
from .state import BALL_BALL, INF, NOBODY, OFF_TABLE, Record, State
from .strike import begin_anew, strike

PLAYED = 0
"""The shot was played to its end."""

TOO_LONG = 1
"""It took more work than it may here, or has more events than there is room for: left to who can be interrupted."""

SLICE = 50_000
"""Work of one call of the loop."""


@dataclass(slots=True)
class Start:
    """A ball before the shot."""

    x: float = 0.0  # m, centred
    y: float = 0.0
    vx: float = 0.0  # m/s
    vy: float = 0.0
    wx: float = 0.0  # rad/s
    wy: float = 0.0
    wz: float = 0.0
    phase: int = 0
    reported: int = 0


@dataclass(slots=True)
class Stroke:
    """A shot, with the numbers that `strike` takes."""

    fx: float = 0.0  # N
    fy: float = 0.0
    fz: float = 0.0
    along: float = 0.0
    side: float = 0.0  # m
    up: float = 0.0


@dataclass(slots=True)
class Outcome:
    """What became of a shot."""

    status: int = PLAYED
    duration: float = 0.0  # s
    events: int = 0  # number of events
    first_hit: int = NOBODY  # the ball that the struck one met first


@dataclass(slots=True)
class Place:
    """Where a ball is at the end."""

    x: float = 0.0  # m, frame `table`
    y: float = 0.0
    in_play: bool = False
    mouth: int = 0  # the feature that it fell into, 0 for none


@dataclass(slots=True)
class Reel:
    """How many events are kept."""

    events: int = 0


class Batch(NamedTuple):
    """Shots and what became of them."""

    start: Sequence[Start]  # a row a ball, or a row a ball of each shot
    strokes: Sequence[Stroke]
    outcomes: Sequence[Outcome]
    places: Sequence[Place]  # a row a ball of each shot
    reel: Sequence[Reel]  # one row
    events: Sequence[Record]  # of all shots, one after the other; none where nobody asks for them


@kernel
def play_batch(batch: Batch, state: State, i: int, first: int, end: int, until: float, most: int) -> int:
    """Play the shots `first` to `end` at ball i, each up to a time, s, or to rest where that is INF.

    A shot that takes more work than `most` is left.

    Returns the shot at which there was no more room for events, else `end`.
    """
    count = len(state.balls)
    for m in range(first, end):
        _lay_out(batch, state, m * count if len(batch.start) > count else 0)
        stroke = batch.strokes[m]
        strike(state, i, 0.0, stroke.fx, stroke.fy, stroke.fz, stroke.along, stroke.side, stroke.up)
        outcome = batch.outcomes[m]
        before = batch.reel[0].events
        outcome.first_hit = NOBODY
        outcome.status = _play(batch, state, outcome, i, until, most)
        if outcome.status != PLAYED:
            batch.reel[0].events = before
            if before > 0:
                return m  # perhaps there is room after the events so far
            continue
        outcome.events = state.clock[0].logged
        time = until
        if until == INF:
            time = state.clock[0].now
            if state.constants[0].spin_deceleration > 0.0:
                time = last_spin_end(state, time)
        outcome.duration = time
        for k in range(count):
            _note_place(state, batch.places[m * count + k], k, time)
    return end


@kernel
def _lay_out(batch: Batch, state: State, first: int) -> None:
    # The balls as at the start, whose rows begin with `first`, and nothing predicted.
    begin_anew(state)
    for k in range(len(state.balls)):
        ball, start = state.balls[k], batch.start[first + k]
        ball.x = start.x
        ball.y = start.y
        ball.vx = start.vx
        ball.vy = start.vy
        ball.wx = start.wx
        ball.wy = start.wy
        ball.wz = start.wz
        ball.phase = start.phase
        ball.reported = start.reported
        ball.feature = 0


@kernel
def _play(batch: Batch, state: State, outcome: Outcome, i: int, until: float, most: int) -> int:
    # To the end, and take from the log what is wanted of it each time that it begins again.
    clock = state.clock[0]
    taken = 0
    while clock.work < most:
        status = run_until(state, until, taken, min(SLICE, most))
        if outcome.first_hit == NOBODY:
            outcome.first_hit = _first_hit(state, i)
        if not _keep_events(batch, state):
            return TOO_LONG
        taken = clock.logged
        if status == DONE:
            return PLAYED
    return TOO_LONG


@kernel
def _first_hit(state: State, i: int) -> int:
    for k in range(state.clock[0].events):
        event = state.log[k]
        if event.kind == BALL_BALL:
            if event.first == i:
                return event.second
            if event.second == i:
                return event.first
    return NOBODY


@kernel
def _keep_events(batch: Batch, state: State) -> bool:
    # Returns whether there was room for them, or nobody asks for them.
    if len(batch.events) == 0:
        return True
    reel = batch.reel[0]
    count = state.clock[0].events
    if reel.events + count > len(batch.events):
        return False
    for k in range(count):
        kept, event = batch.events[reel.events + k], state.log[k]
        kept.time = event.time
        kept.kind = event.kind
        kept.first = event.first
        kept.second = event.second
        kept.point_x = event.point_x
        kept.point_y = event.point_y
        kept.normal_x = event.normal_x
        kept.normal_y = event.normal_y
        kept.approach = event.approach
        kept.impulse = event.impulse
    reel.events += count
    return True


@kernel
def _note_place(state: State, place: Place, k: int, time: float) -> None:
    ball = state.balls[k]
    dt = time - ball.time
    constants = state.constants[0]
    place.x = ball.x + (ball.vx + 0.5 * ball.ax * dt) * dt + constants.centre_x
    place.y = ball.y + (ball.vy + 0.5 * ball.ay * dt) * dt + constants.centre_y
    place.in_play = ball.phase != OFF_TABLE
    place.mouth = 0 if place.in_play else ball.feature
