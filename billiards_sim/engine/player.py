# SPDX-License-Identifier: Apache-2.0
"""Plays pieces of a rollout: in this thread, without the interpreter's lock where there is machine code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine import machine
from billiards_sim.engine.kernels.batch import PLAYED, TOO_LONG, Batch, play_batch
from billiards_sim.engine.kernels.state import INF, NOBODY, PARTS, RAILS, Record
from billiards_sim.engine.moment import begun_anew, start
from billiards_sim.engine.noise import ShooterNoise
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.shots import blows, refusals
from billiards_sim.engine.simulation import Simulation, StallError
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


class Piece(NamedTuple):
    """Rows of a rollout to be played: row r is sample r % samples of shot r // samples."""

    job: Job
    shots: NDArray[np.float64]  # (K, 5), all that the rows are of
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
    def blank(cls, rows: int, scene: Scene, error: int, events: bool) -> Played:
        """Of rows that are not played."""
        return cls(
            np.full((rows, len(scene), 2), math.nan),
            np.tile(scene.in_play, (rows, 1)),
            np.full((rows, len(scene)), -1, np.int8),
            np.full(rows, math.nan),
            np.zeros(rows, np.int32),
            np.full(rows, NOBODY, np.int32),
            np.full(rows, error, np.int8),
            {},
            [[] for _ in range(rows)] if events else None,
        )


def play_piece(piece: Piece, players: list[Player] | None = None) -> Played:
    """Play the rows of a piece. `players` are idle ones of the same job, who may be used, one a thread."""
    if not machine.is_ready():
        machine.compile()
    player = players.pop() if players else Player(piece.job)
    try:
        return player.play(piece)
    finally:
        if players is not None:
            players.append(player)


class Player:
    """Has the tables to play with."""

    def __init__(self, job: Job) -> None:
        self._job = job
        self._index = job.scene.names.index(job.ball)
        simulation = Simulation(job.scene)
        moment = start(job.scene)
        self._state = (begun_anew(moment) if simulation.at_rest else moment).state
        packed = isinstance(self._state, Packed)
        count = len(job.scene)
        self._batch = blank(
            Batch,
            packed,
            start=count,
            strokes=ROWS,
            outcomes=ROWS,
            places=ROWS * count,
            reel=1,
            events=EVENT_ROWS if job.events else 0,
        )
        for name in START:
            set_columns(self._batch.start, (name,), column(self._state.balls, name)[:, np.newaxis])

    def play(self, piece: Piece) -> Played:
        """The rows of a piece."""
        job = self._job
        played = Played.blank(piece.end - piece.first, job.scene, 0, job.events)
        shots = self._shots(piece)
        reasons = refusals(shots, job.scene.physics)
        for row, reason in reasons.items():
            aside = math.hypot(*shots[row, 2:4].tolist())
            played.error[row] = MISCUE if job.noise and aside > job.scene.physics.miscue_limit else REFUSED
            played.reasons[row] = reason
        good = np.flatnonzero(played.error == 0)
        for first in range(0, len(good), ROWS):
            rows = good[first : first + ROWS]
            self._play_rows(rows, blows(shots[rows], job.scene.physics), played)
        return played

    def _shots(self, piece: Piece) -> NDArray[np.float64]:
        # (rows, 5), with the errors of the shooter.
        samples, noise = self._job.samples, self._job.noise
        if noise is None:
            return piece.shots
        shot = piece.first // samples
        skipped = piece.first - shot * samples
        sampled = noise.samples(piece.shots, shot, samples, self._job.entropy).reshape(-1, 5)
        return sampled[skipped : skipped + piece.end - piece.first]

    def _play_rows(self, rows: NDArray[np.intp], strokes: NDArray[np.float64], played: Played) -> None:
        job, batch = self._job, self._batch
        count = len(rows)
        set_columns(batch.strokes[:count], STROKE, strokes)
        until = INF if job.until is None else job.until
        done = 0
        while done < count:
            set_fields(batch.reel, 0, events=0)
            before = done
            done = machine.call(play_batch, batch, self._state, self._index, before, count, until)
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
            self._play_alone(int(rows[k]), strokes[k].tolist(), played)

    def _unload(self, rows: NDArray[np.intp], first: int, end: int, logs: list[Any]) -> None:
        at = 0
        for k in range(first, end):
            if get_field(self._batch.outcomes, k, "status") == PLAYED:
                count = get_field(self._batch.outcomes, k, "events")
                logs[rows[k]] = copy_rows(self._batch.events[at : at + count])
                at += count

    def _play_alone(self, row: int, stroke: list[float], played: Played) -> None:
        # As a simulation, which has guards, can be interrupted, and has room for every event.
        job = self._job
        fx, fy, fz, _, side, up = stroke
        simulation = Simulation(job.scene)
        simulation.strike((fx, fy, fz), (side, up), job.ball)
        try:
            events = simulation.run(job.until)
        except StallError as error:
            self._mark(row, STALLED, str(error), played)
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

    def _mark(self, row: int, error: int, reason: str, played: Played) -> None:
        blank = Played.blank(1, self._job.scene, error, False)
        for name, value in blank._asdict().items():
            if isinstance(value, np.ndarray):
                getattr(played, name)[row] = value[0]
        played.reasons[row] = reason
