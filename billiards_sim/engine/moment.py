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
from numpy.typing import NDArray

from billiards_sim.engine import machine
from billiards_sim.engine.cue import Blow
from billiards_sim.engine.elastic import (
    CONTACT_STEPS,
    damping,
    duration_factor,
    mean_depth,
    shortening,
    stiffness_of,
)
from billiards_sim.engine.features import features_of
from billiards_sim.engine.kernels.law.spin import last_spin_end
from billiards_sim.engine.kernels.loop import CONTACTS_PER_BALL
from billiards_sim.engine.kernels.orientation import Turns, turn_all
from billiards_sim.engine.kernels.state import (
    AT_REST,
    INF,
    OFF_TABLE,
    ONE_CELL,
    PRESS_HEIGHT,
    REST_DISTANCE,
    ROLLING,
    SCRATCH,
    SLIDING,
    SPEED_ROUNDING,
    Constants,
    Record,
    State,
)
from billiards_sim.engine.kernels.strike import begin_anew
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.tables import (
    Packed,
    blank,
    columns,
    copy_block,
    copy_rows,
    fill,
    get_field,
    in_form,
    set_columns,
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


SPINS = ("wx", "wy", "wz", "alpha_x", "alpha_y", "alpha_z")
"""Of a ball or an arc: rad/s and rad/s^2, the last until wz is 0."""


def spins_after(spins: NDArray[np.float64], ages: NDArray[np.float64]) -> NDArray[np.float64]:
    """(..., 3) rad/s: what `SPINS`, (..., 6), are after so many s, (..., 1); the formulas of `motion.anchor`."""
    after = spins[..., 0:3].copy()
    after[..., 0:2] += spins[..., 3:5] * ages
    if spins[..., 5].any():
        change = spins[..., 5] * ages[..., 0]
        after[..., 2] = np.where(np.abs(change) >= np.abs(after[..., 2]), 0.0, after[..., 2] + change)
    return after


class LastShot(NamedTuple):
    """A shot, and the moment at which it was made; or that at which balls were laid down, without a shot."""

    before: Moment
    blow: Blow | None
    ball: str


class Moment(NamedTuple):
    """Where a simulation is. The kernels go on with `state` and `turns` in place; the rest is replaced."""

    state: State
    turns: Turns
    epoch: float = 0.0  # s, time of the table when the kernels' clock was at 0
    asked: float = 0.0  # s, of the kernels' clock: until where it was asked to go
    rest: float = 0.0  # s, what rounding keeps out of `asked`, so that a thousand steps of 0.001 s make one of 1 s
    taken: int = 0  # number of events, since the kernels' clock was at 0, that are copied from their log
    pending: tuple[Sequence[Record], ...] = ()  # events, at times of the table, that no call has handed over yet
    mark: Mark | None = None  # where progress is measured from
    last_shot: LastShot | None = None

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
        pending = (*self.pending, events)
        return Moment(
            self.state, self.turns, self.epoch, self.asked, self.rest, logged, pending, self.mark, self.last_shot
        )

    def is_idle(self, until: float) -> bool:
        """Whether the kernels have nothing to do up to a time of their clock, s."""
        state = self.state
        if not get_field(state.clock, 0, "begun") or get_field(state.clock, 0, "changed"):
            return False
        first = get_field(state.nodes, 1, "ball")
        next_event = get_field(state.balls, first, "event_time")
        return bool(next_event > until or next_event == INF)

    def at_rest_since(self) -> tuple[float, float]:
        """What `asked` and `rest` are when nothing moves, after the last event, and nothing spins any more."""
        if get_field(self.state.constants, 0, "spin_deceleration") == 0.0:
            return self.asked, self.rest
        end = machine.call(last_spin_end, self.state, self.inner)
        return (end, 0.0) if end > self.inner else (self.asked, self.rest)

    def in_best_form(self) -> Moment:
        """The same in the form of machine code where there is some."""
        machine.seek()
        packed = machine.is_ready()
        if isinstance(self.state, Packed) == packed:
            return self
        moment = self.with_log_taken()
        return moment._replace(state=in_form(moment.state, packed, SCRATCH), turns=in_form(moment.turns, packed))

    def to_be_left(self) -> Moment:
        """A copy for the interpreter to work on, which can be left half way."""
        return copied(self.with_log_taken())

    def after_shot(self, shot: LastShot) -> Moment:
        """The same, with another last shot."""
        return Moment(
            self.state, self.turns, self.epoch, self.asked, self.rest, self.taken, self.pending, self.mark, shot
        )

    def without_past(self) -> Moment:
        """The same, without the events and the shot before."""
        return Moment(self.state, self.turns, self.epoch, self.asked, self.rest, self.taken)


def start(scene: Scene, time: float = 0.0) -> Moment:
    """Where a simulation begins, at a time of the table, s."""
    count = len(scene)
    constants = constants_of(scene)
    features = features_of(scene.table, scene.physics.radius)
    packed = machine.is_ready()
    state = blank(
        State,
        packed,
        balls=count,
        cells=constants.cells_x * constants.cells_y,
        nodes=2 << (count - 1).bit_length(),
        changed=count,
        contacts=CONTACTS_PER_BALL * count + 1,
        touches=CONTACTS_PER_BALL * count + 1 if constants.stiffness else 0,
        stages=count if constants.stiffness else 0,
        clock=1,
        constants=1,
        features=len(features),
        members=count,
        impacts=CONTACTS_PER_BALL * count,
        log=LOG_ROWS + (CONTACTS_PER_BALL + 1) * count,
    )
    fill(state.constants, [constants])
    fill(state.features, features)
    phases = np.where(scene.in_play[:, np.newaxis], AT_REST, OFF_TABLE)
    moving = (scene.velocities != 0.0).any(axis=1) | (scene.angular_velocities[:, :2] != 0.0).any(axis=1)
    set_columns(state.balls, ("x", "y"), scene.positions - scene.table.centre)
    set_columns(state.balls, ("vx", "vy"), scene.velocities)
    set_columns(state.balls, ("wx", "wy", "wz"), scene.angular_velocities)
    set_columns(state.balls, ("phase", "reported"), np.where(moving[:, np.newaxis], (SLIDING, ROLLING), phases))
    turns = blank(Turns, packed, turns=count if scene.track_orientation else 0)
    set_columns(turns.turns, ("qw",), np.ones((len(turns.turns), 1)))
    return Moment(state, turns, time)


def constants_of(scene: Scene) -> Constants:
    """What the kernels need of physics and table. The cells are about as many as the balls, none narrower than one."""
    physics, table, count = scene.physics, scene.table, len(scene)
    sliding = physics.sliding_friction * physics.gravity
    rolling = physics.rolling_friction * physics.gravity
    nose_sine = 2.0 * table.nose_height - 1.0  # (h - R)/R
    stiffness = stiffness_of(physics)
    rail_restitution = (1.0 + physics.rail_restitution) * (1.0 - nose_sine * nose_sine) - 1.0
    rest_speed = math.sqrt(2.0 * rolling * REST_DISTANCE) if sliding > 0.0 else 0.0
    side = max(2.0 * physics.radius, math.sqrt(table.length * table.width / count))
    cells_x = 1 if count <= ONE_CELL else max(1, int(table.length / side))
    cells_y = 1 if count <= ONE_CELL else max(1, int(table.width / side))
    return Constants(
        mass=physics.mass,
        radius=physics.radius,
        sliding=sliding,
        rolling=rolling,
        ball_restitution=physics.ball_restitution,
        ball_friction=physics.ball_friction,
        ball_friction_slow=physics.ball_friction_slow,
        ball_friction_decay=physics.ball_friction_decay,
        rail_restitution=physics.rail_restitution,
        rail_friction=physics.rail_friction,
        nose_sine=nose_sine,
        nose_cosine=math.sqrt(1.0 - nose_sine * nose_sine),
        stiffness=stiffness,
        ball_damping=damping(physics.ball_restitution) * math.sqrt(0.5 * stiffness),
        rail_damping=damping(max(rail_restitution, 0.0)) * math.sqrt(stiffness),
        contact_steps=CONTACT_STEPS,
        duration_factor=duration_factor(physics.ball_restitution) if stiffness else 0.0,
        rail_duration_factor=duration_factor(max(rail_restitution, 0.0)) if stiffness else 0.0,
        shortening=shortening(physics.ball_restitution),
        pressing=mean_depth(physics.ball_restitution) if stiffness else 0.0,
        spin_deceleration=physics.spin_deceleration,
        centre_x=table.centre[0],
        centre_y=table.centre[1],
        cells_x=cells_x,
        cells_y=cells_y,
        cell_width=table.length / cells_x,
        cell_height=table.width / cells_y,
        rest_speed=rest_speed,
        least_approach=max(rest_speed, SPEED_ROUNDING),
        cue_contact_time=physics.cue_contact_time,
        cue_end_mass=physics.cue_end_mass,
        low_speed=math.sqrt(4.0 * (sliding + rolling) * PRESS_HEIGHT),
    )


def begun_anew(moment: Moment) -> Moment:
    """The same on the table, balls at rest and the log taken, as a start: the kernels' clock at 0, no predictions."""
    state = copy_block(moment.state, SCRATCH)
    machine.call(begin_anew, state)
    turns = moment.turns
    if len(turns.turns):
        turns = copy_block(turns)
        machine.call(turn_all, turns, moment.inner)
        set_columns(turns.turns, ("time",), np.zeros((len(turns.turns), 1)))
    return Moment(state, turns, moment.time, pending=moment.pending, last_shot=moment.last_shot)


def copied(moment: Moment) -> Moment:
    """The log taken, one that shares nothing that changes."""
    return moment._replace(state=copy_block(moment.state, SCRATCH), turns=copy_block(moment.turns))


def stored(moment: Moment) -> Moment:
    """One to be kept outside of the process, or beside this one."""
    last_shot = moment.last_shot and moment.last_shot._replace(before=stored(moment.last_shot.before))
    return copied(moment.with_log_taken())._replace(last_shot=last_shot)


def fetched(moment: Moment) -> Moment:
    """What was stored, perhaps by a process where there was machine code and here is none."""
    packed = machine.is_ready()
    last_shot = moment.last_shot and moment.last_shot._replace(before=fetched(moment.last_shot.before))
    return moment._replace(
        state=in_form(moment.state, packed, SCRATCH), turns=in_form(moment.turns, packed), last_shot=last_shot
    )
