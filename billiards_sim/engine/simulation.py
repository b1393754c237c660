"""The simulation: a scene in motion, from event to event."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.contact import release_ball
from billiards_sim.engine.cue import Strike, strike
from billiards_sim.engine.detection import contact_time, rail_contact_time
from billiards_sim.engine.events import BALL_BALL, BALL_RAIL, KINDS, RAILS, SHOT, Event
from billiards_sim.engine.jit import Rows, as_array, copy_rows, rows
from billiards_sim.engine.loop import CONTACTS_PER_BALL, PAUSED, run_until
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.schedule import NOBODY
from billiards_sim.engine.state import (
    AT_REST,
    AX,
    BALL_COLUMNS,
    CHANGED,
    CLOCK_COLUMNS,
    CONTACT_COLUMNS,
    E_APPROACH,
    E_FIRST,
    E_IMPULSE,
    E_KIND,
    E_NORMAL_X,
    E_NORMAL_Y,
    E_POINT_X,
    E_POINT_Y,
    E_SECOND,
    E_TIME,
    EVENT_COLUMNS,
    EVENTS,
    HELD,
    HIT_TIME,
    IMPACT_COLUMNS,
    INF,
    NOW,
    PHASE,
    REPORTED,
    ROLLING,
    SLIDING,
    TIME,
    UPDATE_TIME,
    VX,
    WX,
    WY,
    State,
    X,
    constants,
)

BATCH = 10_000
"""Events between two looks at the progress of the clock."""

LEAST_PROGRESS = 1e-9
"""s. Batches of events that advance the clock by less are a stall; a break has a few hundred events in seconds."""

STALLED_BATCHES = 10
"""Batches without progress until the simulation gives up."""

LOG_ROWS = 1024
"""Events that the kernels log before they hand them over."""


class StallError(RuntimeError):
    """The clock no longer advances: events follow each other without end. A defect of the engine, not of the scene."""


class EventLog(Sequence[Event]):
    """The events of a stretch of time, in order. `Event` objects are built when they are looked at."""

    def __init__(self, table: NDArray[np.float64], scene: Scene) -> None:
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
        return self._event(self._table[index].tolist())

    def __iter__(self) -> Iterator[Event]:
        return map(self._event, self._table.tolist())

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    def __add__(self, other: EventLog) -> EventLog:
        return EventLog(np.concatenate((self._table, other._table)), self._scene)

    def __repr__(self) -> str:
        return f"<EventLog of {len(self)} events>"

    def _event(self, row: list[float]) -> Event:
        kind = int(row[E_KIND])
        names = self._scene.names
        first = names[int(row[E_FIRST])]
        centre_x, centre_y = self._scene.table.centre
        return Event(
            time=row[E_TIME],
            kind=KINDS[kind],
            balls=(first, names[int(row[E_SECOND])]) if kind == BALL_BALL else (first,),
            rail=RAILS[int(row[E_SECOND])] if kind == BALL_RAIL else None,
            point=(row[E_POINT_X] + centre_x, row[E_POINT_Y] + centre_y),
            normal=(row[E_NORMAL_X], row[E_NORMAL_Y]),
            approach_speed=row[E_APPROACH],
            impulse=row[E_IMPULSE],
        )


@dataclass(frozen=True)
class Snapshot:
    """The state of a simulation at a time; made by `Simulation.snapshot`, for `Simulation.restore`."""

    scene: Scene
    state: State
    time: float
    time_rest: float


class Simulation:
    """Balls in motion on a table. Between events motion is in closed form; events are exact roots.

    Args:
        scene: where everything starts. A shot of the scene is not played by itself: `sim.strike(...)` plays one.

    The result does not depend on how a time is cut into calls of `advance` and `run`, to the last bit.
    """

    def __init__(self, scene: Scene) -> None:
        count = len(scene)
        balls = np.zeros((count, BALL_COLUMNS))
        balls[:, X : X + 2] = scene.positions - scene.table.centre
        balls[:, VX : VX + 2] = scene.velocities
        balls[:, WX : WX + 3] = scene.angular_velocities
        balls[:, HIT_TIME] = INF
        moving = np.any(balls[:, VX : WY + 1] != 0.0, axis=1)
        balls[:, PHASE] = np.where(moving, SLIDING, AT_REST)
        balls[:, REPORTED] = np.where(moving, ROLLING, AT_REST)
        balls[:, CHANGED] = 1.0
        self._scene = scene
        self._constants = constants(scene.physics, scene.table)
        self._state = State(
            balls=rows(balls),
            pairs=rows(np.full((count, count), INF)),
            contacts=rows(np.zeros((CONTACTS_PER_BALL * count + 1, CONTACT_COLUMNS))),
            impacts=rows(np.zeros((CONTACTS_PER_BALL * count, IMPACT_COLUMNS))),
            clock=rows(np.zeros((1, CLOCK_COLUMNS))),
            log=_new_log(count),
        )
        self._time = 0.0
        self._time_rest = 0.0  # what rounding keeps out of _time when it is a sum of steps

    @property
    def scene(self) -> Scene:
        """The scene that the simulation started from."""
        return self._scene

    @property
    def time(self) -> float:
        """Simulated time since the start, s."""
        return self._time

    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m, frame `table`, a copy."""
        balls, dt = self._balls_and_ages()
        return balls[:, X : X + 2] + (balls[:, VX : VX + 2] + 0.5 * balls[:, AX : AX + 2] * dt) * dt + self._centre

    @property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s, a copy."""
        balls, dt = self._balls_and_ages()
        return balls[:, VX : VX + 2] + balls[:, AX : AX + 2] * dt

    @property
    def angular_velocities(self) -> NDArray[np.float64]:
        """(N, 3) rad/s, a copy."""
        balls, dt = self._balls_and_ages()
        spins = balls[:, WX : WX + 3].copy()
        spins[:, :2] += balls[:, AX + 2 : AX + 4] * dt
        return spins

    @property
    def at_rest(self) -> bool:
        """Whether every ball rests. A ball that spins about the vertical on the spot rests."""
        return all(ball[PHASE] == AT_REST for ball in self._state.balls)

    @property
    def kinetic_energy(self) -> float:
        """Of all balls, linear and rotational, J."""
        physics = self._scene.physics
        linear = 0.5 * physics.mass * float(np.sum(self.velocities**2))
        return linear + 0.5 * physics.moment_of_inertia * float(np.sum(self.angular_velocities**2))

    def copy(self) -> Simulation:
        """An independent simulation in the same state, to the bit: to try a shot and go back."""
        twin = object.__new__(Simulation)
        twin._scene, twin._constants = self._scene, self._constants
        twin.restore(self.snapshot())
        return twin

    def snapshot(self) -> Snapshot:
        """The present state, to `restore` later, as often as wanted."""
        return Snapshot(self._scene, _copy(self._state), self._time, self._time_rest)

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a state of this simulation or of a copy of it.

        Raises:
            ValueError: the snapshot is of another scene.
        """
        if snapshot.scene is not self._scene:
            raise ValueError("the snapshot is of a simulation of another scene")
        self._state = _copy(snapshot.state)
        self._time, self._time_rest = snapshot.time, snapshot.time_rest

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
        if self._state.balls[index][PHASE] != AT_REST:
            speed = float(np.hypot(*self.velocities[index]))
            raise ValueError(f"ball {ball!r} must rest to be struck, it moves at {speed:.6g} m/s")
        centre = (self.positions[index] - self._centre).tolist()
        way = self._free_way(index, struck)
        row = self._state.balls[index]
        if row[HELD] > 0.0:
            release_ball(self._state, index)
        row[TIME] = self._time
        for axis in range(2):
            row[X + axis] = centre[axis] + way * struck.displacement[axis]
            row[VX + axis] = struck.velocity[axis]
        for axis in range(3):
            row[WX + axis] += struck.angular_velocity[axis]
        row[PHASE], row[REPORTED] = SLIDING, ROLLING
        row[CHANGED] = 1.0
        clock = self._state.clock[0]
        clock[UPDATE_TIME] = self._time
        point = (centre[0] + struck.tip[0], centre[1] + struck.tip[1])
        event = (self._time, SHOT, index, NOBODY, *point, *struck.direction, 0.0, struck.impulse)
        self._state.log[int(clock[EVENTS])] = list(event)
        clock[EVENTS] += 1.0

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

    def run(self, until: float | None = None) -> EventLog:
        """Go on until every ball rests, or until a time, s; returns the events.

        Without `until` the clock stops at the last event.

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
            events = self._run_until(INF)
            self._time = max(self._time, self._state.clock[0][NOW])
        else:
            if not (math.isfinite(until) and until >= self._time):
                raise ValueError(f"until must be a finite time >= now, {self._time:.9g} s, got {until!r}")
            events = self._run_until(until)
            self._time = float(until)
        self._time_rest = 0.0
        return events

    @property
    def _centre(self) -> NDArray[np.float64]:
        return np.array(self._scene.table.centre)

    def _balls_and_ages(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        balls = as_array(self._state.balls)
        return balls, (self._time - balls[:, TIME])[:, np.newaxis]

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

    def _run_until(self, until: float) -> EventLog:
        clock = self._state.clock[0]
        chunks = []
        progress = clock[NOW]
        stalled = 0
        while True:
            status = run_until(self._state, self._constants, until, BATCH)
            logged = int(clock[EVENTS])
            chunks.append(as_array(self._state.log[:logged]).reshape(logged, EVENT_COLUMNS))
            clock[EVENTS] = 0.0
            if status != PAUSED:
                return EventLog(np.concatenate(chunks), self._scene)
            stalled = stalled + 1 if clock[NOW] - progress < LEAST_PROGRESS else 0
            if stalled == 0:
                progress = clock[NOW]
            elif stalled > STALLED_BATCHES:
                raise StallError(f"no progress at {clock[NOW]!r} s: events follow each other without end")


def _new_log(count: int) -> Rows:
    return rows(np.zeros((LOG_ROWS + (CONTACTS_PER_BALL + 1) * count, EVENT_COLUMNS)))


def _copy(state: State) -> State:
    # What is scratch is made anew, of the log only what no call has handed over yet is copied.
    log = _new_log(len(state.balls))
    for index in range(int(state.clock[0][EVENTS])):
        log[index][:] = state.log[index]
    return State(
        balls=copy_rows(state.balls),
        pairs=copy_rows(state.pairs),
        contacts=copy_rows(state.contacts),
        impacts=copy_rows(state.impacts),
        clock=copy_rows(state.clock),
        log=log,
    )
