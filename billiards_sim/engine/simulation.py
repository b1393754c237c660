# SPDX-License-Identifier: Apache-2.0
"""The simulation: a scene in motion, from event to event."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import starmap
from time import perf_counter
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_sim.engine import cue, machine
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.events import KINDS, Event
from billiards_sim.engine.features import names_of
from billiards_sim.engine.kernels.law.spin import last_spin_end
from billiards_sim.engine.kernels.loop import PAUSED, run_until
from billiards_sim.engine.kernels.orientation import turn_all
from billiards_sim.engine.kernels.pocket import lay_down
from billiards_sim.engine.kernels.state import AT_REST, BALL_BALL, BALL_RAIL, INF, OFF_TABLE, POCKETED, Record
from billiards_sim.engine.kernels.strike import strike
from billiards_sim.engine.kernels.trajectory import run_followed
from billiards_sim.engine.moment import (
    SPINS,
    LastShot,
    Mark,
    Moment,
    begun_anew,
    copied,
    fetched,
    spins_after,
    start,
    stored,
)
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.quantity import listed, numbers, seconds, shown
from billiards_sim.engine.recorder import Recorder, blank_tape
from billiards_sim.engine.scene import OVERLAP_TOLERANCE, Scene, Shot, index_of, overlap_of
from billiards_sim.engine.scene_file import save_scene
from billiards_sim.engine.tables import Packed, as_tuple, column, columns, copy_block, get_field, join_rows, set_fields

BATCH = 50_000
"""Work of one call of the kernels, some milliseconds; signals are heard between two."""

INTERPRETED = 10
"""Times less work where the kernels are interpreted, which takes some tens of milliseconds."""

EVENT_BUDGET = 1_000_000
"""Passes of the event loop that must lead further than `STALL_TIME` or a ball's radius. A break takes a few hundred in
all, the worst cluster of balls pressed together some ten thousand."""

STALL_TIME = 1.0
"""s. A run that goes on by so much goes on, even if nothing moves by a radius meanwhile: a ball that friction of 1e-6
holds at a rail, step by step. A million passes take about as long on the wall clock."""


class StallError(RuntimeError):
    """The clock hardly advances: events follow each other without end. A defect of the engine, not of the scene.

    The simulation stands where it got to. Playing `scene`, with its shot if it has one, leads there again.

    Attributes:
        scene: what was on the table at the last shot, or at the start.
        path: the file that holds it; None if it could not be written.
        events: those of the call that ended so.
    """

    def __init__(self, reason: str, scene: Scene, events: EventLog) -> None:
        self.scene = scene
        self.events = events
        self.path: str | None = None
        try:
            handle, path = tempfile.mkstemp(prefix="billiards_sim_stall_", suffix=".yaml")
            os.close(handle)
            save_scene(scene, path)
            self.path = path
        except (OSError, ImportError) as error:
            super().__init__(f"{reason}; its scene could not be written: {error}")
        else:
            super().__init__(f"{reason}; {path} reproduces it")


def comes_to_rest(physics: Physics) -> bool:
    """Whether friction brings every ball to rest."""
    return 0.0 not in (physics.sliding_friction, physics.rolling_friction)


def check_comes_to_rest(physics: Physics) -> None:
    """Whether friction brings every ball to rest.

    Raises:
        ValueError: it does not, so that a run needs a time `until`.
    """
    if not comes_to_rest(physics):
        raise ValueError(
            f"the balls never rest with sliding_friction {physics.sliding_friction:g} and rolling_friction "
            f"{physics.rolling_friction:g}: give a time `until`"
        )


class EventLog(Sequence[Event]):
    """The events of a stretch of time, in order. `Event` objects are built when they are looked at."""

    def __init__(self, table: Sequence[Record], scene: Scene) -> None:
        self._table = table
        self._scene = scene

    def __len__(self) -> int:
        return len(self._table)

    @overload
    def __getitem__(self, index: int) -> Event: ...
    @overload
    def __getitem__(self, index: slice) -> EventLog: ...
    def __getitem__(self, index: int | slice) -> Event | EventLog:
        if isinstance(index, slice):
            return EventLog(self._table[index], self._scene)
        return self._event(*as_tuple(self._table[index]))

    def __iter__(self) -> Iterator[Event]:
        return starmap(self._event, map(as_tuple, self._table))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    @property
    def kinds(self) -> list[str]:
        """What happened, event by event; quicker than to look at each."""
        return [KINDS[kind] for kind in column(self._table, "kind").tolist()]

    def __add__(self, other: EventLog) -> EventLog:
        return EventLog(join_rows(Record, (self._table, other._table)), self._scene)

    def __repr__(self) -> str:
        return f"<EventLog of {len(self)} events>"

    def _event(self, time: float, kind: int, first: int, second: int, x: float, y: float, *impact: float) -> Event:
        normal_x, normal_y, approach, impulse = impact
        names = self._scene.names
        table = self._scene.table
        centre_x, centre_y = table.centre
        return Event(
            time=time,
            kind=KINDS[kind],
            balls=(names[first], names[second]) if kind == BALL_BALL else (names[first],),
            rail=names_of(table)[second] if kind == BALL_RAIL else None,
            pocket=names_of(table)[second] if kind == POCKETED else None,
            point=(x + centre_x, y + centre_y),
            normal=(normal_x, normal_y),
            approach_speed=approach,
            impulse=impulse,
        )


@dataclass(frozen=True)
class Snapshot:
    """The state of a simulation at a time; made by `Simulation.snapshot`, for `Simulation.restore`."""

    scene: Scene
    moment: Moment

    def __getstate__(self) -> tuple[Scene, Moment]:
        return self.scene, stored(self.moment)

    def __setstate__(self, state: tuple[Scene, Moment]) -> None:
        object.__setattr__(self, "scene", state[0])
        object.__setattr__(self, "moment", fetched(state[1]))


class Simulation:
    """Balls in motion on a table. Between events motion is in closed form; events are exact roots.

    Args:
        scene: where everything starts. A shot of the scene is not played by itself: `sim.strike(...)` plays one.
        time: what the clock shows then, s.

    The result does not depend on how a time is cut into calls of `advance` and `run`, to the last bit.

    Raises:
        ValueError: `time` is negative or no finite number.
    """

    def __init__(self, scene: Scene, time: float = 0.0) -> None:
        self._scene = scene
        self._now = start(scene, seconds("time", time))

    @property
    def start_scene(self) -> Scene:
        """The scene that the simulation started from."""
        return self._scene

    @property
    def time(self) -> float:
        """Simulated time since the start, s."""
        return self._now.time

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m, frame `table`, a copy; of a pocketed ball the middle of its pocket's circle, nan off the table."""
        motion = columns(self._now.state.balls, "time", "x", "y", "vx", "vy", "ax", "ay")
        dt = self._now.inner - motion[:, 0:1]
        return motion[:, 1:3] + (motion[:, 3:5] + 0.5 * motion[:, 5:7] * dt) * dt + self._centre

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s, a copy."""
        motion = columns(self._now.state.balls, "vx", "vy", "ax", "ay")
        return motion[:, 0:2] + motion[:, 2:4] * self._ages()

    @property
    def angular_velocities(self) -> NDArray[np.float64]:
        """(N, 3) rad/s, a copy."""
        return spins_after(columns(self._now.state.balls, *SPINS), self._ages())

    @property
    def orientations(self) -> NDArray[np.float64]:
        """(N, 4) unit quaternions x y z w: how each ball is turned since the start, a copy.

        They take directions fixed in a ball to the frame `table`. Exact but for rounding in rolling without spin about
        the vertical, to 1e-6 rad a second in sliding.

        Raises:
            ValueError: the scene does not track orientation.
        """
        if not self._scene.track_orientation:
            raise ValueError("orientations are there only with Scene(..., track_orientation=True)")
        turns = copy_block(self._now.turns)
        machine.call(turn_all, turns, self._now.inner)
        return columns(turns.turns, "qx", "qy", "qz", "qw")

    @property
    def at_rest(self) -> bool:
        """Whether nothing can change a position or a spin any more.

        A ball that spins about the vertical on the spot rests where nothing slows its spin.
        """
        if self._moves:
            return False
        if self._scene.physics.spin_friction == 0.0:
            return True
        inner = self._now.inner
        return bool(machine.call(last_spin_end, self._now.state, inner) == inner)

    @property
    def in_play(self) -> NDArray[np.bool_]:
        """(N,) whether each ball is on the table, a copy."""
        return column(self._now.state.balls, "phase") != OFF_TABLE

    @property
    def kinetic_energy(self) -> float:
        """Of all balls, linear and rotational, J."""
        return self._scene.physics.kinetic_energy(self.velocities, self.angular_velocities)

    def scene(self) -> Scene:
        """The present state as a scene, without a shot: to save, to edit, to start from.

        Raises:
            ValueError: balls are in the middle of an elastic contact, which a scene cannot hold.
        """
        pressing = np.flatnonzero(self._pressing)
        if len(pressing):
            names = listed([self._scene.names[index] for index in pressing])
            raise ValueError(
                f"at {self.time:.9g} s balls {names} are in the middle of an elastic contact, which a scene cannot "
                "hold: it ends within some 1e-3 s"
            )
        return self._scene_of(self.positions, self.velocities, self.angular_velocities, self.in_play)

    def _scene_of(
        self,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64],
        spins: NDArray[np.float64],
        in_play: NDArray[np.bool_],
    ) -> Scene:
        return replace(
            self._scene,
            positions=positions,
            velocities=velocities,
            angular_velocities=spins,
            in_play=in_play,
            shot=None,
        )

    def copy(self) -> Simulation:
        """An independent simulation in the same state, to the bit: to try a shot and go back."""
        return self._at(copied(self._now.with_log_taken()))

    def __getstate__(self) -> tuple[Scene, Moment]:
        return self._scene, stored(self._now)

    def __setstate__(self, state: tuple[Scene, Moment]) -> None:
        self._scene = state[0]
        self._now = fetched(state[1])

    def snapshot(self) -> Snapshot:
        """The present state, to `restore` later, as often as wanted."""
        return Snapshot(self._scene, copied(self._now.with_log_taken()))

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a state of this simulation or of a copy of it.

        Raises:
            ValueError: the snapshot is of another scene, or none.
        """
        if not isinstance(snapshot, Snapshot):
            raise ValueError(f"a simulation is restored from a Snapshot, got {shown(snapshot)}")
        if snapshot.scene != self._scene:
            raise ValueError("the snapshot is of a simulation of another scene")
        self._now = copied(snapshot.moment)

    def strike(self, force: Sequence[float], offset: Sequence[float] = (0.0, 0.0), ball: str = "cue") -> None:
        """Hit a resting ball with the cue (paper equations 1 to 12). The clock does not move.

        Args:
            force: (x, y, z) N, constant for `physics.cue_contact_time`; z < 0: the butt is raised. The ball stays on
                the cloth, which takes the part that points down.
            offset: where the tip hits, (sideways, up) m from the ball's centre in the shot's own frame: x' along the
                force, y' to its left, z' up, across the cue.
            ball: its name.

        The displacement during the contact (equation 3) stops short where a ball or a rail is in the way; the impulse
        is delivered whole. The "shot" event is the first of the next `advance` or `run`.

        Raises:
            ValueError: no such ball, the ball moves or is not in play, a force that is zero, not finite or points up,
                an offset off the ball or beyond the miscue limit. Nothing changes then.
        """
        index = self._index(ball)
        blow = cue.checked(force, offset, self._scene.physics)
        self.check_rests(ball)
        before = self._now.with_log_taken()
        anew = self.at_rest
        now = begun_anew(before) if anew else copied(before)
        machine.call(strike, now.state, index, now.inner, *blow)
        if not anew:  # `rest` is part of the time too
            now = now.with_log_taken()
            set_fields(now.pending[-1], 0, time=before.time)
        self._now = now.after_shot(LastShot(before.without_past(), blow, ball))

    def shoot(
        self,
        speed: float,
        azimuth: float,
        side: float = 0.0,
        up: float = 0.0,
        elevation: float = 0.0,
        ball: str = "cue",
    ) -> None:
        """Hit a resting ball as people say it; otherwise as `strike`.

        Args:
            speed: of the ball after the shot, along the table, m/s.
            azimuth: where the cue points along the table, rad, counter-clockwise from the x axis. The ball leaves this
                line by the squirt, where `physics.cue_end_mass` makes some, and curves where the butt is raised.
            side, up: where the tip hits, to the left and up in shares of the radius, seen along the cue.
            elevation: of the butt over the tip, rad: the force then points down.
            ball: its name.

        Raises:
            ValueError: as `Aim` and `strike`. Nothing changes then.
        """
        shot = Aim(speed, azimuth, side, up, elevation).shot(self._scene.physics, ball)
        self.strike(shot.force, shot.offset, shot.ball)

    def check_rests(self, ball: str) -> None:
        """Whether a ball can be struck.

        Raises:
            ValueError: no such ball, or it moves or is not in play.
        """
        index = self._index(ball)
        phase = get_field(self._now.state.balls, index, "phase")
        if phase == OFF_TABLE:
            raise ValueError(f"ball {ball!r} is not in play")
        if phase != AT_REST:
            speed = float(np.hypot(*self.velocities[index]))
            raise ValueError(f"ball {ball!r} must rest to be struck, it moves at {speed:.6g} m/s")

    def place(self, positions: Mapping[str, ArrayLike]) -> None:
        """Put balls at rest on the table, by name at (x, y) m: those in a pocket, and those that are in play. The clock
        does not move.

        Raises:
            ValueError: no such ball, no place, or one where `Scene` would not have it. Nothing changes then.
        """
        if not isinstance(positions, Mapping):
            raise ValueError(f"positions must be a map of names to (x, y), got {shown(positions)}")
        places, velocities, spins = self.positions, self.velocities, self.angular_velocities
        in_play, pressing = self.in_play, self._pressing
        for name, position in positions.items():
            index = self._index(name)
            places[index] = numbers(f"position of ball {name!r}", position, 2)
            velocities[index], spins[index], in_play[index], pressing[index] = 0.0, 0.0, True, False
        self._scene_of(places, velocities, spins, in_play & ~pressing)  # checks it
        self._check_room(positions, places, pressing)
        before = self._now.with_log_taken()
        now = begun_anew(before) if self.at_rest else copied(before)
        for name in positions:
            index = self._index(name)
            machine.call(lay_down, now.state, index, now.inner, *places[index].tolist())
        self._now = now.after_shot(LastShot(copied(now).without_past(), None, ""))

    def advance(self, duration: float, budget: float | None = None) -> EventLog:
        """Go on by exactly `duration` s, however many events fall inside; returns these events.

        Args:
            budget: s of the wall clock after which the call gives way: it then returns at an event, `time` says at
                which, and later calls go on from there with the same bits. It is looked at after every few
                milliseconds of work, some tens where the engine is interpreted. None: no bound.

        Raises:
            ValueError: `duration` or `budget` is negative or no finite number.
        """
        asked, rest = self._now.after(seconds("duration", duration))
        played = self._play(asked, budget)
        self._now, events = self._handing_over(*((asked, rest) if played else (self._now.asked, self._now.rest)))
        return events

    def run(
        self, until: float | None = None, recorder: Recorder | None = None, *, budget: float | None = None
    ) -> EventLog:
        """Go on until every ball rests, or until a time, s; returns the events.

        Without `until` the clock stops at the last event, or later, when the last spin has ended. A recorder takes down
        how every ball moves; `record` makes use of it. With a `budget` the call may give way before, as `advance` does.

        Raises:
            ValueError: `until` is no finite number or has passed; or, without it, there is no friction to bring the
                balls to rest; `budget` is negative or no finite number.
        """
        if until is None:
            if not comes_to_rest(self._scene.physics) and self._moves:
                check_comes_to_rest(self._scene.physics)
            played = self._play(INF, budget, recorder)
            asked, rest = self._now.at_rest_since() if played else (0.0, 0.0)
        else:
            end = seconds("until", until, self.time, f"a finite time >= now, {self.time:.9g} s")
            asked, rest = self._now.at(end)
            played = self._play(asked, budget, recorder)
        self._now, events = self._handing_over(*((asked, rest) if played else (self._now.asked, self._now.rest)))
        return events

    @property
    def _pressing(self) -> NDArray[np.bool_]:
        # (N,) whether each ball is in the middle of an elastic contact, where bodies reach into each other.
        return column(self._now.state.balls, "touches") > 0

    def _check_room(self, names: Iterable[str], places: NDArray[np.float64], pressing: NDArray[np.bool_]) -> None:
        # Whether balls have room beside those that a scene cannot hold.
        diameter = 2.0 * self._scene.physics.radius
        for name in names:
            for index in np.flatnonzero(pressing):
                distance = math.dist(places[self._index(name)], places[index])
                if diameter - distance > OVERLAP_TOLERANCE:
                    raise ValueError(overlap_of(name, self._scene.names[index], distance, diameter))

    @property
    def _moves(self) -> bool:
        return bool(column(self._now.state.balls, "phase").max() > AT_REST)

    @property
    def _centre(self) -> NDArray[np.float64]:
        return np.array(self._scene.table.centre)

    def _origin(self) -> Scene:
        # What leads to the present state: the scene, or what was on the table at the last shot, with the shot.
        if self._now.last_shot is None:
            return self._scene
        before, blow, ball = self._now.last_shot
        if blow is None:
            return replace(self._at(before).scene(), name=f"{self._scene.name} with balls laid down".strip())
        shot = Shot((blow.fx, blow.fy, blow.fz), (blow.side, blow.up), ball)
        return replace(self._at(before).scene(), name=f"{self._scene.name} before a shot".strip(), shot=shot)

    def _at(self, moment: Moment) -> Simulation:
        twin = object.__new__(Simulation)
        twin._scene, twin._now = self._scene, moment
        return twin

    def _ages(self) -> NDArray[np.float64]:
        # (N, 1) s since the anchors.
        return self._now.inner - columns(self._now.state.balls, "time")

    def _index(self, ball: str) -> int:
        return index_of(self._scene.names, ball)

    def _play(self, until: float, budget: float | None, recorder: Recorder | None = None) -> bool:
        # Up to a time of the kernels' clock, while the budget lasts; returns whether it did. The events wait.
        deadline = INF if budget is None else perf_counter() + seconds("budget", budget)
        if recorder is not None:
            recorder.epoch = self._now.epoch
        while not self._play_batch(until, recorder):
            self._check_progress()
            if recorder is not None:
                recorder.unload()
            if budget is not None and perf_counter() >= deadline:
                return False
        if recorder is not None:
            recorder.unload()
        return True

    def _play_batch(self, until: float, recorder: Recorder | None) -> bool:
        # Returns whether nothing is left to do.
        followed = recorder is not None or self._scene.track_orientation
        work = self._now.in_best_form()
        packed = isinstance(work.state, Packed)
        if not packed:
            if not followed and work.is_idle(until):
                return True
            work = work.to_be_left()
        most = BATCH if packed else max(BATCH // INTERPRETED, 1)
        if followed:
            tape = recorder.tape(packed) if recorder is not None else blank_tape(0, packed)
            status = machine.call(run_followed, work.state, work.turns, tape, until, work.taken, most)
        else:
            status = machine.call(run_until, work.state, until, work.taken, most)
        self._now = work.with_log_taken()
        return status != PAUSED

    def _check_progress(self) -> None:
        # A radius by its fastest ball, or `STALL_TIME`, within EVENT_BUDGET passes. Energy only falls, so what it was
        # at the mark bounds every speed since.
        passes = get_field(self._now.state.clock, 0, "passes")
        time = get_field(self._now.state.clock, 0, "now")
        mark = self._now.mark
        if mark is not None and passes - mark.passes < EVENT_BUDGET:
            return
        spins, physics = self.angular_velocities, self._scene.physics
        if physics.ball_friction + physics.ball_friction_slow + physics.rail_friction == 0.0:
            spins[:, 2] = 0.0  # that about the vertical moves nothing
        energy = physics.kinetic_energy(self.velocities, spins)
        self._now = self._now._replace(mark=Mark(passes, time, math.sqrt(2.0 * energy / physics.mass)))
        if mark is None:
            return
        gone = time - mark.time
        if gone < STALL_TIME and gone * mark.speed < physics.radius:
            reason = f"no progress: {passes - mark.passes} steps from {mark.time!r} to {time!r} s since the last shot"
            now, events = self._handing_over(self._now.asked, self._now.rest)
            error = StallError(reason, self._origin(), events)
            self._now = now
            raise error

    def _handing_over(self, asked: float, rest: float) -> tuple[Moment, EventLog]:
        # The moment after it, and the events.
        pending = self._now.pending
        return self._now._replace(asked=asked, rest=rest, pending=()), EventLog(
            pending[0] if len(pending) == 1 else join_rows(Record, pending), self._scene
        )
