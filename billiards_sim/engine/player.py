# SPDX-License-Identifier: Apache-2.0
"""Plays pieces of a rollout: in this thread, without the interpreter's lock where there is machine code."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine import machine
from billiards_sim.engine.kernels.batch import PLAYED, TOO_LONG, Batch, play_batch
from billiards_sim.engine.kernels.state import AT_REST, INF, NOBODY, OFF_TABLE, PARTS, RAILS, Record
from billiards_sim.engine.moment import start
from billiards_sim.engine.noise import ShooterNoise
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.shots import blows, refusals
from billiards_sim.engine.simulation import Simulation, StallError
from billiards_sim.engine.starts import Starts
from billiards_sim.engine.tables import Packed, blank, column, columns, copy_rows, get_field, set_columns, set_fields

REFUSED = 1
MISCUE = 2
STALLED = 3
MISSING = 4
"""Errors of a shot."""

ROWS = 128
"""Shots of one call of the kernels. Between two the other threads are heard."""

EVENT_ROWS = 32_768
"""Events that a player keeps before it hands them over, where they are asked for."""

MOST_WORK = 1_000_000
"""Of a shot, some tens of milliseconds: a break takes 3 000, with elastic contacts 20 000. What takes more is played
as a simulation."""

START = ("x", "y", "vx", "vy", "wx", "wy", "wz", "phase", "reported")
STROKE = ("fx", "fy", "fz", "along", "side", "up")


class Job(NamedTuple):
    """What all pieces of a rollout have in common."""

    scene: Scene
    ball: str
    until: float | None
    noise: ShooterNoise | None
    samples: int
    entropy: int
    events: bool
    starts: bool  # whether each shot begins elsewhere


class Piece(NamedTuple):
    """Rows of a rollout to be played: row r is sample r % samples of shot r // samples."""

    job: Job
    shots: NDArray[np.float64]  # (K, 5), all that the rows are of
    starts: Starts | None  # of these shots
    first: int  # row
    end: int


class Played(NamedTuple):
    """What became of the rows of a piece. Where there is an error, numbers are nan, or 0 or -1, and all is in play that
    was before."""

    positions: NDArray[np.float64]
    in_play: NDArray[np.bool_]
    pocket: NDArray[np.int8]
    duration: NDArray[np.float64]
    event_count: NDArray[np.int32]
    first_hit: NDArray[np.int32]
    error: NDArray[np.int8]
    reasons: dict[int, str]
    logs: list[Sequence[Record]] | None

    @classmethod
    def blank(cls, in_play: NDArray[np.bool_], error: int, events: bool) -> Played:
        """Of rows that are not played, with (rows, N) what is in play before."""
        rows, count = in_play.shape
        return cls(
            np.full((rows, count, 2), math.nan),
            in_play,
            np.full((rows, count), -1, np.int8),
            np.full(rows, math.nan),
            np.zeros(rows, np.int32),
            np.full(rows, NOBODY, np.int32),
            np.full(rows, error, np.int8),
            {},
            [[] for _ in range(rows)] if events else None,
        )


class Idle(threading.local):
    """Who has played the last piece in this thread, and with which job: pieces of one come one after the other."""

    job: Job | None = None
    player: Player | None = None


_idle = Idle()


def play_piece(piece: Piece) -> Played:
    """Play the rows of a piece; what an executor is given to do."""
    if not machine.is_ready():
        machine.compile()
    player = _idle.player if _idle.player is not None and _idle.job == piece.job else Player(piece.job)
    _idle.player = None  # until it has played: an exception may leave it half way
    played = player.play(piece)
    _idle.job, _idle.player = piece.job, player
    return played


class Player:
    """Has the tables to play with."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._index = job.scene.names.index(job.ball)
        self._state = start(job.scene).state
        packed = isinstance(self._state, Packed)
        count = len(job.scene)
        self._batch = blank(
            Batch,
            packed,
            start=ROWS * count if job.starts else count,
            strokes=ROWS,
            outcomes=ROWS,
            places=ROWS * count,
            reel=1,
            events=EVENT_ROWS if job.events else 0,
        )
        for name in START if not job.starts else ():
            set_columns(self._batch.start, (name,), column(self._state.balls, name)[:, np.newaxis])

    def play(self, piece: Piece) -> Played:
        """The rows of a piece."""
        job = self._job
        shots, of_shot = self._shots(piece), np.arange(piece.first, piece.end) // job.samples
        of_shot -= of_shot[0]
        in_play = np.tile(job.scene.in_play, (len(shots), 1)) if piece.starts is None else piece.starts.in_play[of_shot]
        played = Played.blank(in_play, 0, job.events)
        reasons = refusals(shots, job.scene.physics)
        for row, reason in reasons.items():
            aside = math.hypot(*shots[row, 2:4].tolist())
            played.error[row] = MISCUE if job.noise and aside > job.scene.physics.miscue_limit else REFUSED
            played.reasons[row] = reason
        good = np.flatnonzero(played.error == 0)
        for first in range(0, len(good), ROWS):
            rows = good[first : first + ROWS]
            if piece.starts is not None:
                self._lay_out(piece.starts.positions[of_shot[rows]], in_play[rows])
            self._play_rows(rows, blows(shots[rows], job.scene.physics), played, piece.starts, of_shot)
        return played

    def kernel_calls(self, strokes: NDArray[np.float64]) -> Iterator[Callable[[], int]]:
        """The calls of the kernel that play shots, (M, 6) as `blows` makes them, to rest: to be timed."""
        for first in range(0, len(strokes), ROWS):
            some = strokes[first : first + ROWS]
            set_columns(self._batch.strokes[: len(some)], STROKE, some)
            yield partial(machine.call, play_batch, self._batch, self._state, self._index, 0, len(some), INF, MOST_WORK)

    def _shots(self, piece: Piece) -> NDArray[np.float64]:
        # (rows, 5), with the errors of the shooter.
        samples, noise = self._job.samples, self._job.noise
        if noise is None:
            return piece.shots
        shot = piece.first // samples
        skipped = piece.first - shot * samples
        sampled = noise.samples(piece.shots, shot, samples, self._job.entropy).reshape(-1, 5)
        return sampled[skipped : skipped + piece.end - piece.first]

    def _lay_out(self, positions: NDArray[np.float64], in_play: NDArray[np.bool_]) -> None:
        places = (positions - self._job.scene.table.centre).reshape(-1, 2)
        phases = np.where(in_play, AT_REST, OFF_TABLE).reshape(-1, 1)
        start = self._batch.start[: len(places)]
        set_columns(start, ("x", "y"), places)
        set_columns(start, ("phase",), phases)  # all else is 0

    def _play_rows(
        self,
        rows: NDArray[np.intp],
        strokes: NDArray[np.float64],
        played: Played,
        starts: Starts | None,
        of_shot: NDArray[np.intp],
    ) -> None:
        job, batch = self._job, self._batch
        count = len(rows)
        set_columns(batch.strokes[:count], STROKE, strokes)
        until = INF if job.until is None else job.until
        done = 0
        while done < count:
            set_fields(batch.reel, 0, events=0)
            before = done
            done = machine.call(play_batch, batch, self._state, self._index, before, count, until, MOST_WORK)
            if played.logs is not None:
                self._unload(rows, before, done, played.logs)
        outcomes, places = batch.outcomes[:count], batch.places[: count * len(job.scene)]
        shape = (count, len(job.scene))
        played.positions[rows] = columns(places, "x", "y").reshape(*shape, 2)
        played.in_play[rows] = column(places, "in_play").reshape(shape)
        played.pocket[rows] = (column(places, "mouth").reshape(shape) - RAILS) // PARTS
        played.duration[rows] = column(outcomes, "duration")
        played.event_count[rows] = column(outcomes, "events")
        played.first_hit[rows] = column(outcomes, "first_hit")
        for k in np.flatnonzero(column(outcomes, "status") == TOO_LONG).tolist():
            scene = job.scene if starts is None else starts.scene(job.scene, of_shot[rows[k]])
            self._play_alone(int(rows[k]), scene, strokes[k].tolist(), played)

    def _unload(self, rows: NDArray[np.intp], first: int, end: int, logs: list[Any]) -> None:
        at = 0
        for k in range(first, end):
            if get_field(self._batch.outcomes, k, "status") == PLAYED:
                count = get_field(self._batch.outcomes, k, "events")
                logs[rows[k]] = copy_rows(self._batch.events[at : at + count])
                at += count

    def _play_alone(self, row: int, scene: Scene, stroke: list[float], played: Played) -> None:
        # As a simulation, which has guards, can be interrupted, and has room for every event.
        job = self._job
        fx, fy, fz, _, side, up = stroke
        simulation = Simulation(scene)
        simulation.strike((fx, fy, fz), (side, up), job.ball)
        try:
            events = simulation.run(job.until)
        except StallError as error:
            self._mark(row, STALLED, str(error), scene, played)
            return
        off_table = ~simulation.in_play
        mouths = np.where(off_table, column(simulation._now.state.balls, "feature"), 0)
        hits = (event.balls for event in events if event.kind == "ball_ball" and job.ball in event.balls)
        hit = next((one if other == job.ball else other for one, other in hits), None)
        played.positions[row] = simulation.positions
        played.in_play[row] = ~off_table
        played.pocket[row] = (mouths - RAILS) // PARTS
        played.duration[row] = simulation.time
        played.event_count[row] = len(events)
        played.first_hit[row] = NOBODY if hit is None else job.scene.names.index(hit)
        if played.logs is not None:
            played.logs[row] = events._table

    def _mark(self, row: int, error: int, reason: str, scene: Scene, played: Played) -> None:
        blank = Played.blank(scene.in_play[np.newaxis], error, False)
        for name, value in blank._asdict().items():
            if isinstance(value, np.ndarray):
                getattr(played, name)[row] = value[0]
        played.reasons[row] = reason
