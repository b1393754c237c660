# SPDX-License-Identifier: Apache-2.0
"""Where a simulation is: the kernels' state, and what Python keeps of time and of events beside it.

The kernels' clock is at 0 at the start, and again at every shot at resting balls. So the same shot from the same state
gives the same bits whatever the time of the table, and no bit of a short time is lost to a long one.

An exception from a signal's handler can come between any two steps of Python. Whatever the moment it finds, the next
call goes on from there: compiled kernels are one step, interpreted ones work on a copy; what is kept beside them is
replaced as a whole; and the events that were taken from the log are told by their number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_sim.engine.jit import COMPILED, as_rows, columns, copy_rows, get_field, rows, set_columns
from billiards_sim.engine.loop import CONTACTS_PER_BALL
from billiards_sim.engine.orientation import Turn, turn_all
from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.engine.state import (
    AT_REST,
    INF,
    OFF_TABLE,
    ROLLING,
    SLIDING,
    Ball,
    Clock,
    Constants,
    Contact,
    Impact,
    Record,
    Slot,
    State,
)

LOG_ROWS = 1024
"""Events that the kernels log before they hand them over."""


def inner_time(time: float, epoch: float) -> float:
    """Time of the kernels' clock, s, at a time of the table: the latest of those that are rounded to it.

    So what has happened by then are the events that say so, also where times of the table are rounded.
    """
    if epoch == 0.0:
        return time
    inner = math.fsum((time, 0.5 * math.ulp(time), -epoch))
    while epoch + inner > time:
        inner = math.nextafter(inner, -math.inf)
    return inner


class Mark(NamedTuple):
    """Where progress is measured from."""

    passes: int  # of the event loop
    time: float  # s, of the kernels' clock
    speed: float  # m/s, which no ball can have exceeded since, nor its rim by rolling or sliding


class Moment(NamedTuple):
    """Where a simulation is. The kernels go on with `state` and `turns` in place; the rest is replaced."""

    state: State
    turns: Sequence[Turn]
    epoch: float = 0.0  # s, time of the table when the kernels' clock was at 0
    asked: float = 0.0  # s, of the kernels' clock: until where it was asked to go
    rest: float = 0.0  # s, what rounding keeps out of `asked`, so that a thousand steps of 0.001 s make one of 1 s
    taken: int = 0  # number of events, since the kernels' clock was at 0, that are copied from their log
    pending: tuple[Sequence[Record], ...] = ()  # events, at times of the table, that no call has handed over yet
    mark: Mark | None = None  # where progress is measured from
    last_shot: tuple[Moment, Shot] | None = None  # and the moment at which it was made

    @property
    def inner(self) -> float:
        """Time of the kernels' clock, s."""
        return max(self.asked, get_field(self.state.clock, 0, "now"))

    @property
    def time(self) -> float:
        """Time of the table, s."""
        inner = self.inner
        return math.fsum((self.epoch, inner, self.rest if inner == self.asked else 0.0))

    def after(self, duration: float) -> tuple[float, float]:
        """What `asked` and `rest` are `duration` s later."""
        inner = self.inner
        terms = (inner, self.rest if inner == self.asked else 0.0, duration)
        asked = max(inner, math.fsum(terms))
        return asked, math.fsum((*terms, -asked))

    def at(self, time: float) -> tuple[float, float]:
        """What `asked` and `rest` are at a time of the table, s, that has not passed."""
        asked = inner_time(time, self.epoch)
        return asked, math.fsum((time, -self.epoch, -asked))

    def with_log_taken(self) -> Moment:
        """One that has the events of the kernels' log among the pending ones, at times of the table."""
        logged = get_field(self.state.clock, 0, "logged")
        if logged == self.taken:
            return self
        count = get_field(self.state.clock, 0, "events")
        events = copy_rows(self.state.log[:count])  # the log began again when all before were taken
        if self.epoch != 0.0:
            set_columns(events, ("time",), self.epoch + columns(events, "time"))
        return self._replace(taken=logged, pending=(*self.pending, events))

    def is_idle(self, until: float) -> bool:
        """Whether the kernels have nothing to do up to a time of their clock, s."""
        state = self.state
        if not get_field(state.clock, 0, "begun") or get_field(state.clock, 0, "changed"):
            return False
        first = get_field(state.nodes, 1, "ball")
        next_event = get_field(state.balls, first, "event_time")
        return bool(next_event > until or next_event == INF)

    def to_work_on(self) -> Moment:
        """What the kernels go on with: where they are interpreted, and can be left half way, a copy without scratch."""
        if COMPILED:
            return self
        state = self.state
        contacts = get_field(state.clock, 0, "contacts")
        copy = state._replace(
            balls=copy_rows(state.balls),
            cells=copy_rows(state.cells),
            nodes=copy_rows(state.nodes),
            changed=copy_rows(state.changed),
            contacts=[*copy_rows(state.contacts[:contacts]), *state.contacts[contacts:]],
            clock=copy_rows(state.clock),
        )
        return self._replace(state=copy, turns=copy_rows(self.turns))


def start(scene: Scene, constants: Constants) -> Moment:
    """Where a simulation begins."""
    count = len(scene)
    state = State(
        balls=rows(Ball, count),
        cells=rows(Slot, constants.cells_x * constants.cells_y),
        nodes=rows(Slot, 2 << (count - 1).bit_length()),
        changed=rows(Slot, count),
        members=rows(Slot, count),
        contacts=rows(Contact, CONTACTS_PER_BALL * count + 1),
        impacts=rows(Impact, CONTACTS_PER_BALL * count),
        clock=rows(Clock, 1),
        log=_new_log(count),
    )
    phases = np.where(scene.in_play[:, np.newaxis], AT_REST, OFF_TABLE)
    moving = (scene.velocities != 0.0).any(axis=1) | (scene.angular_velocities[:, :2] != 0.0).any(axis=1)
    set_columns(state.balls, ("x", "y"), scene.positions - scene.table.centre)
    set_columns(state.balls, ("vx", "vy"), scene.velocities)
    set_columns(state.balls, ("wx", "wy", "wz"), scene.angular_velocities)
    set_columns(state.balls, ("phase", "reported"), np.where(moving[:, np.newaxis], (SLIDING, ROLLING), phases))
    turns = rows(Turn, count if scene.track_orientation else 0)
    set_columns(turns, ("qw",), np.ones((len(turns), 1)))
    return Moment(state, turns)


def begun_anew(moment: Moment) -> Moment:
    """The same on the table, balls at rest and the log taken, as a start: the kernels' clock at 0, no predictions."""
    balls = rows(Ball, len(moment.state.balls))
    set_columns(balls, ("x", "y", "wz"), columns(moment.state.balls, "x", "y", "wz"))
    set_columns(balls, ("phase",), columns(moment.state.balls, "phase").astype(np.int64))
    state = moment.state._replace(balls=balls, clock=rows(Clock, 1))
    turns = copy_rows(moment.turns)
    if len(turns):
        turn_all(turns, moment.inner)
        set_columns(turns, ("time",), np.zeros((len(turns), 1)))
    return moment._replace(state=state, turns=turns, epoch=moment.time, asked=0.0, rest=0.0, taken=0, mark=None)


def copied(moment: Moment) -> Moment:
    """The log taken, one that shares nothing that changes; what is scratch is made anew."""
    state = moment.state
    count = len(state.balls)
    return moment._replace(
        state=State(
            balls=copy_rows(state.balls),
            cells=copy_rows(state.cells),
            nodes=copy_rows(state.nodes),
            changed=copy_rows(state.changed),
            members=rows(Slot, count),
            contacts=copy_rows(state.contacts),
            impacts=rows(Impact, CONTACTS_PER_BALL * count),
            clock=copy_rows(state.clock),
            log=_new_log(count),
        ),
        turns=copy_rows(moment.turns),
    )


def packed(moment: Moment) -> Moment:
    """One to be kept outside of the process, without scratch."""
    moment = moment.with_log_taken()
    state = moment.state._replace(members=(), impacts=(), log=())
    last_shot = moment.last_shot and (packed(moment.last_shot[0]), moment.last_shot[1])
    return moment._replace(state=state, last_shot=last_shot)


def unpacked(moment: Moment) -> Moment:
    """What was packed, perhaps by a process where the kernels were compiled and here are not, or reversely."""
    count = len(moment.state.balls)
    kinds = State(Ball, Slot, Slot, Slot, Slot, Contact, Impact, Clock, Record)  # type: ignore[arg-type]
    state = State(*(as_rows(kind, table) for kind, table in zip(kinds, moment.state)))  # type: ignore[arg-type]
    state = state._replace(
        members=rows(Slot, count), impacts=rows(Impact, CONTACTS_PER_BALL * count), log=_new_log(count)
    )
    return moment._replace(
        state=state,
        turns=as_rows(Turn, moment.turns),
        pending=tuple(as_rows(Record, table) for table in moment.pending),
        last_shot=moment.last_shot and (unpacked(moment.last_shot[0]), moment.last_shot[1]),
    )


def _new_log(count: int) -> Sequence[Record]:
    return rows(Record, LOG_ROWS + (CONTACTS_PER_BALL + 1) * count)
