# SPDX-License-Identifier: Apache-2.0
"""The simulation: a scene in motion, from event to event."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import starmap
from typing import overload

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.aim import Aim
from billiards_sim.engine.contact import free_ball
from billiards_sim.engine.cue import Strike, strike
from billiards_sim.engine.detection import contact_time, rail_contact_time
from billiards_sim.engine.events import BALL_BALL, BALL_RAIL, KINDS, RAILS, SHOT, Event
from billiards_sim.engine.jit import as_tuple, columns, copy_rows, join_rows, rows, set_columns
from billiards_sim.engine.loop import CONTACTS_PER_BALL, PAUSED, run_until
from billiards_sim.engine.orientation import Turn, turn_all
from billiards_sim.engine.scene import Scene, Shot, save_scene
from billiards_sim.engine.state import (
    AT_REST,
    INF,
    NOBODY,
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
    constants,
)
from billiards_sim.engine.trajectory import Recorder, blank_tape, run_followed

BATCH = 100_000
"""Passes of the event loop between two looks at the progress of the clock."""

EVENT_BUDGET = 1_000_000
"""Passes of the event loop until which the fastest ball must have come further than its radius. A break takes a few
hundred in all, the worst cluster of balls pressed together some ten thousand."""

LOG_ROWS = 1024
"""Events that the kernels log before they hand them over."""


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

    def __add__(self, other: EventLog) -> EventLog:
        return EventLog(join_rows((self._table, other._table)), self._scene)

    def __repr__(self) -> str:
        return f"<EventLog of {len(self)} events>"

    def _event(self, time: float, kind: int, first: int, second: int, x: float, y: float, *impact: float) -> Event:
        normal_x, normal_y, approach, impulse = impact
        names = self._scene.names
        centre_x, centre_y = self._scene.table.centre
        return Event(
            time=time,
            kind=KINDS[kind],
            balls=(names[first], names[second]) if kind == BALL_BALL else (names[first],),
            rail=RAILS[second] if kind == BALL_RAIL else None,
            point=(x + centre_x, y + centre_y),
            normal=(normal_x, normal_y),
            approach_speed=approach,
            impulse=impulse,
        )


@dataclass(frozen=True)
class BeforeShot:
    """What was on the table when a shot was made, and the arguments of `Simulation.strike`."""

    balls: Sequence[Ball]
    time: float
    force: Sequence[float]
    offset: Sequence[float]
    ball: str


@dataclass(frozen=True)
class Snapshot:
    """The state of a simulation at a time; made by `Simulation.snapshot`, for `Simulation.restore`."""

    scene: Scene
    state: State
    time: float
    time_rest: float
    before_shot: BeforeShot | None
    turns: Sequence[Turn]


class Simulation:
    """Balls in motion on a table. Between events motion is in closed form; events are exact roots.

    Args:
        scene: where everything starts. A shot of the scene is not played by itself: `sim.strike(...)` plays one.

    The result does not depend on how a time is cut into calls of `advance` and `run`, to the last bit.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._constants = constants(scene.physics, scene.table, len(scene))
        self._state = _start(scene, self._constants)
        self._time = 0.0
        self._time_rest = 0.0  # what rounding keeps out of _time when it is a sum of steps
        self._before_shot: BeforeShot | None = None
        self._turns = _upright(len(scene) if scene.track_orientation else 0)

    @property
    def start_scene(self) -> Scene:
        """The scene that the simulation started from."""
        return self._scene

    @property
    def time(self) -> float:
        """Simulated time since the start, s."""
        return self._time

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m, frame `table`, a copy."""
        dt = self._ages()
        motion = columns(self._state.balls, "x", "y", "vx", "vy", "ax", "ay")
        return motion[:, 0:2] + (motion[:, 2:4] + 0.5 * motion[:, 4:6] * dt) * dt + self._centre

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s, a copy."""
        motion = columns(self._state.balls, "vx", "vy", "ax", "ay")
        return motion[:, 0:2] + motion[:, 2:4] * self._ages()

    @property
    def angular_velocities(self) -> NDArray[np.float64]:
        """(N, 3) rad/s, a copy."""
        spins = columns(self._state.balls, "wx", "wy", "wz")
        spins[:, 0:2] += columns(self._state.balls, "alpha_x", "alpha_y") * self._ages()
        return spins

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
        turns = copy_rows(self._turns)
        turn_all(turns, self._time)
        return columns(turns, "qx", "qy", "qz", "qw")

    @property
    def at_rest(self) -> bool:
        """Whether every ball rests. A ball that spins about the vertical on the spot rests."""
        return not columns(self._state.balls, "phase").any()

    @property
    def kinetic_energy(self) -> float:
        """Of all balls, linear and rotational, J."""
        return self._scene.physics.kinetic_energy(self.velocities, self.angular_velocities)

    def scene(self) -> Scene:
        """The present state as a scene, without a shot: to save, to edit, to start from."""
        return replace(
            self._scene,
            positions=self.positions,
            velocities=self.velocities,
            angular_velocities=self.angular_velocities,
            shot=None,
        )

    def copy(self) -> Simulation:
        """An independent simulation in the same state, to the bit: to try a shot and go back."""
        twin = object.__new__(Simulation)
        twin._scene, twin._constants, twin._state = self._scene, self._constants, _copy(self._state)
        twin._time, twin._time_rest, twin._before_shot = self._time, self._time_rest, self._before_shot
        twin._turns = copy_rows(self._turns)
        return twin

    def snapshot(self) -> Snapshot:
        """The present state, to `restore` later, as often as wanted."""
        state, turns = _copy(self._state), copy_rows(self._turns)
        return Snapshot(self._scene, state, self._time, self._time_rest, self._before_shot, turns)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a state of this simulation or of a copy of it.

        Raises:
            ValueError: the snapshot is of another scene.
        """
        if snapshot.scene is not self._scene:
            raise ValueError("the snapshot is of a simulation of another scene")
        self._state = _copy(snapshot.state)
        self._time, self._time_rest = snapshot.time, snapshot.time_rest
        self._before_shot = snapshot.before_shot
        self._turns = copy_rows(snapshot.turns)

    def strike(self, force: Sequence[float], offset: Sequence[float] = (0.0, 0.0), ball: str = "cue") -> None:
        """Hit a resting ball with the cue (paper equations 1 to 12). The clock does not move.

        Args:
            force: (x, y, z) N, constant for `physics.cue_contact_time`; z must be 0.
            offset: where the tip hits, (sideways, up) m from the ball's centre in the shot's own frame: x' along the
                force, y' to its left, z' up.
            ball: its name.

        The displacement during the contact (equation 3) stops short where a ball or a rail is in the way; the impulse
        is delivered whole. The "shot" event is the first of the next `advance` or `run`.

        Raises:
            ValueError: no such ball, the ball moves, a force that is zero, not finite or not horizontal, an offset off
                the ball. Nothing changes then.
        """
        if ball not in self._scene.names:
            raise ValueError(f"no ball is named {ball!r}; the balls are {', '.join(self._scene.names)}")
        index = self._scene.names.index(ball)
        struck = strike(force, offset, self._scene.physics)
        row = self._state.balls[index]
        if row.phase != AT_REST:
            speed = float(np.hypot(*self.velocities[index]))
            raise ValueError(f"ball {ball!r} must rest to be struck, it moves at {speed:.6g} m/s")
        self._before_shot = BeforeShot(copy_rows(self._state.balls), self._time, force, offset, ball)
        centre = (self.positions[index] - self._centre).tolist()
        way = self._free_way(index, struck)
        clock = self._state.clock[0]
        clock.now = self._time
        if row.held > 0:
            free_ball(self._state, self._constants, index, self._time)
        elif not row.changed:
            row.changed = True
            self._state.changed[clock.changed].ball = index
            clock.changed += 1
        row.time = self._time
        row.x, row.y = (centre[axis] + way * struck.displacement[axis] for axis in range(2))
        row.vx, row.vy = struck.velocity[:2]
        row.wx += struck.angular_velocity[0]
        row.wy += struck.angular_velocity[1]
        row.wz += struck.angular_velocity[2]
        row.phase, row.reported = SLIDING, ROLLING
        event = self._state.log[clock.events]
        clock.events += 1
        event.time, event.kind, event.first, event.second = self._time, SHOT, index, NOBODY
        event.point_x, event.point_y = centre[0] + struck.tip[0], centre[1] + struck.tip[1]
        event.normal_x, event.normal_y = struck.direction
        event.approach, event.impulse = 0.0, struck.impulse

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
            azimuth: its direction, rad, counter-clockwise from the x axis.
            side, up: where the tip hits, to the left and up in shares of the radius, seen along the shot.
            elevation: of the butt over the tip, rad: the force then points down.
            ball: its name.

        Raises:
            ValueError: as `Aim` and `strike`. Nothing changes then.
        """
        shot = Aim(speed, azimuth, side, up, elevation).shot(self._scene.physics, ball)
        self.strike(shot.force, shot.offset, shot.ball)

    def advance(self, duration: float) -> EventLog:
        """Go on by exactly `duration` s, however many events fall inside; returns these events.

        Raises:
            ValueError: `duration` is negative or not finite.
        """
        if not (math.isfinite(duration) and duration >= 0.0):
            raise ValueError(f"duration must be a finite number >= 0 (s), got {duration!r}")
        # The clock is a sum of two floats, so that a thousand steps of 0.001 s end where one of 1 s does.
        until = math.fsum((self._time, self._time_rest, duration))
        rest = math.fsum((self._time, self._time_rest, duration, -until))
        events = self._run_until(until)
        self._time, self._time_rest = until, rest
        return events

    def run(self, until: float | None = None, recorder: Recorder | None = None) -> EventLog:
        """Go on until every ball rests, or until a time, s; returns the events.

        Without `until` the clock stops at the last event. A recorder takes down how every ball moves; `record` makes
        use of it.

        Raises:
            ValueError: `until` is not finite or has passed; or, without it, there is no friction to bring the balls
                to rest.
        """
        if until is None:
            physics = self._scene.physics
            if not self.at_rest and 0.0 in (physics.sliding_friction, physics.rolling_friction):
                raise ValueError(
                    f"the balls never rest with sliding_friction {physics.sliding_friction:g} and rolling_friction "
                    f"{physics.rolling_friction:g}: give run() a time `until`"
                )
            events = self._run_until(INF, recorder)
            self._time = max(self._time, self._state.clock[0].now)
        else:
            if not (math.isfinite(until) and until >= self._time):
                raise ValueError(f"until must be a finite time >= now, {self._time:.9g} s, got {until!r}")
            events = self._run_until(until, recorder)
            self._time = float(until)
        self._time_rest = 0.0
        return events

    @property
    def _centre(self) -> NDArray[np.float64]:
        return np.array(self._scene.table.centre)

    def _origin(self) -> Scene:
        # What leads to the present state: the scene, or what was on the table at the last shot, with the shot.
        before = self._before_shot
        if before is None:
            return self._scene
        force_x, force_y, force_z = before.force
        side, up = before.offset
        twin = self.copy()
        twin._state = twin._state._replace(balls=before.balls)
        twin._time = before.time
        return replace(
            twin.scene(),
            name=f"{self._scene.name} before a shot".strip(),
            shot=Shot((force_x, force_y, force_z), (side, up), before.ball),
        )

    def _ages(self) -> NDArray[np.float64]:
        # (N, 1) s since the anchors.
        return self._time - columns(self._state.balls, "time")

    def _free_way(self, index: int, struck: Strike) -> float:
        # Share of the displacement under the cue, 0 to 1, that ends at the first ball or rail in the way.
        diameter = 2.0 * self._scene.physics.radius
        limits = (self._constants.limit_x, self._constants.limit_y)
        centres = self.positions - self._centre
        way = 1.0
        for axis, move in enumerate(struck.displacement):
            room = limits[axis] - math.copysign(1.0, move) * float(centres[index, axis])
            way = min(way, rail_contact_time(room, abs(move), 0.0, 0.0))
        for other, (px, py) in enumerate((centres[index] - centres).tolist()):
            if other != index:
                way = min(way, contact_time(px, py, *struck.displacement, 0.0, 0.0, 1.0, diameter, 0.0))
        return way

    def _run_until(self, until: float, recorder: Recorder | None = None) -> EventLog:
        clock = self._state.clock[0]
        followed = recorder is not None or self._scene.track_orientation
        tape = recorder.tape if recorder is not None else blank_tape(0)
        chunks = []
        passes, time = clock.passes, clock.now
        while True:
            if followed:
                status = run_followed(self._state, self._turns, tape, self._constants, until, BATCH)
            else:
                status = run_until(self._state, self._constants, until, BATCH)
            chunks.append(copy_rows(self._state.log[: clock.events]))
            clock.events = 0
            if recorder is not None:
                recorder.unload()
            if status != PAUSED:
                return EventLog(chunks[0] if len(chunks) == 1 else join_rows(chunks), self._scene)
            if clock.passes - passes >= EVENT_BUDGET:
                speeds = np.hypot(*columns(self._state.balls, "vx", "vy").T)
                if (clock.now - time) * float(speeds.max()) < self._scene.physics.radius:
                    self._time, self._time_rest = float(clock.now), 0.0
                    reason = f"no progress: {clock.passes - passes} steps from {time!r} to {clock.now!r} s"
                    raise StallError(reason, self._origin(), EventLog(join_rows(chunks), self._scene))
                passes, time = clock.passes, clock.now


def _start(scene: Scene, constants: Constants) -> State:
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
    moving = (scene.velocities != 0.0).any(axis=1) | (scene.angular_velocities[:, :2] != 0.0).any(axis=1)
    set_columns(state.balls, ("x", "y"), scene.positions - scene.table.centre)
    set_columns(state.balls, ("vx", "vy"), scene.velocities)
    set_columns(state.balls, ("wx", "wy", "wz"), scene.angular_velocities)
    set_columns(state.balls, ("phase", "reported"), np.where(moving[:, np.newaxis], (SLIDING, ROLLING), AT_REST))
    return state


def _upright(count: int) -> Sequence[Turn]:
    turns = rows(Turn, count)
    set_columns(turns, ("qw",), np.ones((count, 1)))
    return turns


def _new_log(count: int) -> Sequence[Record]:
    return rows(Record, LOG_ROWS + (CONTACTS_PER_BALL + 1) * count)


def _copy(state: State) -> State:
    # What is scratch is made anew, of the log only what no call has handed over yet is copied.
    count = len(state.balls)
    pending = state.clock[0].events
    log = _new_log(count)
    if pending:
        log[:pending] = copy_rows(state.log[:pending])  # type: ignore[index]
    return State(
        balls=copy_rows(state.balls),
        cells=copy_rows(state.cells),
        nodes=copy_rows(state.nodes),
        changed=copy_rows(state.changed),
        members=rows(Slot, count),
        contacts=copy_rows(state.contacts),
        impacts=rows(Impact, CONTACTS_PER_BALL * count),
        clock=copy_rows(state.clock),
        log=log,
    )
