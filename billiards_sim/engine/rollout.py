# SPDX-License-Identifier: Apache-2.0
"""Many shots from one scene, each played to its end, spread over threads, processes or machines."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor, as_completed
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_sim.engine import machine
from billiards_sim.engine.kernels.state import Record
from billiards_sim.engine.noise import ShooterNoise
from billiards_sim.engine.player import MISSING, Job, Piece, Played, play_piece
from billiards_sim.engine.quantity import listed, seconds, shown
from billiards_sim.engine.scene import Scene, index_of
from billiards_sim.engine.shots import Shots, refusals
from billiards_sim.engine.simulation import EventLog, Simulation, check_comes_to_rest
from billiards_sim.engine.starts import Starts

ERRORS = ("", "refused", "miscue", "stalled", "missing")
"""What the numbers in `Rollout.error` mean."""

ON_ERROR = ("raise", "mask")

LEAST_PIECE, MOST_PIECE = 16, 512
"""Rows of a piece, which costs 0.1 to 0.3 ms of the interpreter's time."""

PIECES_AHEAD = 4
"""Pieces that each thread has before it at any time, if they stay as large: the rows that are left, in ever smaller
pieces, so that none has much to do when the others are through."""

PIECES = 64
"""Of a rollout on an executor whose workers nobody can count, if they have enough rows."""

REASONS_SHOWN = 5
"""In a message."""


class BadShots(ValueError):
    """Shots that cannot be played; none was.

    Attributes:
        reasons: why, by the index of the shot.
    """

    def __init__(self, reasons: Mapping[int, str], count: int) -> None:
        self.reasons = dict(reasons)
        lines = [f"{index}: {reason}" for index, reason in list(reasons.items())[:REASONS_SHOWN]]
        rest = len(reasons) - len(lines)
        more = f"; and {rest} more" if rest else ""
        super().__init__(f"{len(reasons)} of {count} shots cannot be played: {'; '.join(lines)}{more}")
        self._given = (reasons, count)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._given  # to come back from another process


class BrokenRollout(RuntimeError):
    """An executor did not play every shot.

    Attributes:
        result: what there is; the `error` of what is missing is 4.
        missing: (K,) indices of the missing shots; with samples, of those that lack any.
    """

    def __init__(self, result: Rollout, missing: NDArray[np.intp], cause: BaseException) -> None:
        self.result = result
        self.missing = missing
        names = listed([str(index) for index in missing[: 2 * REASONS_SHOWN].tolist()])
        more = ", ..." if len(missing) > 2 * REASONS_SHOWN else ""
        why = f"{type(cause).__name__}: {cause}".strip().rstrip(":")
        super().__init__(f"{len(missing)} of {len(result.error)} shots are missing, {names}{more}; {why}")
        self._given = (result, missing, cause)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._given  # to come back from another process


@dataclass(frozen=True, eq=False)
class Rollout:
    """What became of M shots at a scene of N balls. With S > 1 samples of each, (M, S) stands for (M,) everywhere.

    Attributes:
        scene: that each shot began at.
        positions: (M, N, 2) m at the end, frame `table`; of a pocketed ball the middle of its pocket's circle.
        in_play: (M, N) whether a ball is on the table at the end.
        pocket: (M, N) index into `pockets` of the pocket that a ball fell into, -1 for none.
        duration: (M,) s, until everything rested, or `until`.
        event_count: (M,) number of events, the shot among them.
        first_hit: (M,) index of the ball that the struck one met first, -1 for none.
        error: (M,) 0, or why a shot was not played, a number of `ERRORS`: 1 refused, 2 miscue, 3 stalled, 4 missing.
            Its positions and duration are nan then, and what was in play is.
        reasons: of each error in words, by index: m, or (m, s) with samples.
        entropy: of the noise; given as `seed` it makes the same errors.
    """

    scene: Scene
    positions: NDArray[np.float64]
    in_play: NDArray[np.bool_]
    pocket: NDArray[np.int8]
    duration: NDArray[np.float64]
    event_count: NDArray[np.int32]
    first_hit: NDArray[np.int32]
    error: NDArray[np.int8]
    reasons: Mapping[Any, str]
    entropy: int
    _logs: list[Sequence[Record]] | None = field(repr=False)

    def __len__(self) -> int:
        return len(self.error)

    @property
    def pockets(self) -> tuple[str, ...]:
        """Names of the table's pockets, in the order of the indices in `pocket`."""
        return tuple(mouth.name for mouth in self.scene.table.mouths)

    def pocketed(self, ball: str, pocket: str | None = None) -> NDArray[np.bool_]:
        """(M,) whether a ball fell, into a pocket of this name, or into any.

        Raises:
            ValueError: there is no such ball, or no such pocket.
        """
        fell = self.pocket[..., index_of(self.scene.names, ball)]
        if pocket is None:
            return np.asarray(fell >= 0)
        if pocket not in self.pockets:
            raise ValueError(f"no pocket is named {shown(pocket)}; the pockets are {listed(self.pockets) or 'none'}")
        return np.asarray(fell == self.pockets.index(pocket))

    def events(self, shot: int, sample: int = 0) -> EventLog:
        """The events of a shot; none where it has an error.

        Raises:
            ValueError: the rollout was made without `events=True`.
            IndexError: no such shot or sample.
        """
        if self._logs is None:
            raise ValueError("events are there only with rollout(..., events=True)")
        rows = np.arange(self.error.size).reshape(len(self.error), -1)
        return EventLog(self._logs[rows[shot, sample]], self.scene)


def rollout(
    scene: Scene,
    shots: Shots,
    *,
    positions: ArrayLike | None = None,
    in_play: ArrayLike | None = None,
    until: float | None = None,
    noise: ShooterNoise | None = None,
    samples: int = 1,
    seed: int | None = None,
    events: bool = False,
    executor: Executor | None = None,
    progress: bool = False,
    on_error: str = "raise",
    ball: str = "cue",
    piece: int | None = None,
) -> Rollout:
    """Play each of M shots from the same scene, to rest or until a time; the same bits as as many single runs.

    Args:
        scene: where each begins. The struck ball must rest; others may move.
        shots: as `Simulation.shoot` takes them.
        positions, in_play: (M, N, 2) m, and (M, N): where the balls lie at rest before each shot, and which are on the
            table, in place of what the scene has.
        until: s; None: until everything rests.
        noise: of the shooter. The errors of a shot depend on `seed` and its index alone.
        samples: how often each shot is played, with other errors each time; more than 1 needs noise.
        seed: of the errors, >= 0; None: another one each time, `Rollout.entropy` says which.
        events: whether `Rollout.events` has them; they take some 10 kB a break.
        executor: that plays pieces of it, in threads, processes, or on other machines; it is left open. None: threads
            of this process, one a core.
        progress: show a bar, with tqdm.
        on_error: "mask": shots that cannot be played are marked in `error`; "raise": nothing is played then. Miscues by
            noise and shots that stall are marked in any case.
        ball: name of the struck ball.
        piece: rows that are played at once; None: as it fits. It changes no bit.

    Raises:
        BadShots: shots cannot be played; the text has the first ones with the reasons.
        BrokenRollout: an executor broke; it has what was played.
        ValueError: another argument is wrong.
    """
    given = positions is not None or in_play is not None
    job = _job(scene, shots, until, noise, samples, seed, events, ball, given)
    if on_error not in ON_ERROR:
        raise ValueError(f"on_error must be one of {', '.join(ON_ERROR)}, got {shown(on_error)}")
    if piece is not None and not (_is_whole(piece) and piece >= 1):
        raise ValueError(f"piece must be a whole number >= 1, got {shown(piece)}")
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise ValueError(f"executor must be a concurrent.futures.Executor or None, got {shown(executor)}")
    wanted, starts = shots.columns(), Starts.of(scene, len(shots), positions, in_play)
    bad = refusals(wanted, scene.physics)
    if starts is not None:
        bad = dict(sorted({**starts.refusals(scene, ball), **bad}.items()))
    if bad and on_error == "raise":
        raise BadShots(bad, len(shots))
    wanted[list(bad)] = np.nan  # whatever noise is added
    before = np.tile(scene.in_play, (len(shots), 1)) if starts is None else starts.in_play
    whole = Played.blank(np.repeat(before, samples, axis=0), MISSING, events)
    trouble = _play_all(job, wanted, starts, whole, executor, piece, progress)
    for index, reason in bad.items():
        for row in whole.reasons.keys() & set(range(index * samples, (index + 1) * samples)):
            whole.reasons[row] = reason
    result = _result(job, whole)
    if trouble is not None:
        missing = np.flatnonzero((whole.error.reshape(len(shots), -1) == MISSING).any(axis=1))
        raise BrokenRollout(result, missing, trouble) from trouble
    return result


def _job(
    scene: Scene,
    shots: Shots,
    until: float | None,
    noise: ShooterNoise | None,
    samples: int,
    seed: int | None,
    events: bool,
    ball: str,
    starts: bool,
) -> Job:
    for name, value, kind in (("scene", scene, Scene), ("shots", shots, Shots)):
        if not isinstance(value, kind):
            raise ValueError(f"{name} must be {kind.__name__}, got {shown(value)}")
    if noise is not None and not isinstance(noise, ShooterNoise):
        raise ValueError(f"noise must be a ShooterNoise or None, got {shown(noise)}")
    if not _is_whole(samples) or samples < 1:
        raise ValueError(f"samples must be a whole number >= 1, got {shown(samples)}")
    if samples > 1 and noise is None:
        raise ValueError(f"{samples} samples without noise would all be the same")
    if seed is not None and not (_is_whole(seed) and seed >= 0):
        raise ValueError(f"seed must be a whole number >= 0, got {shown(seed)}")
    if until is None:
        check_comes_to_rest(scene.physics)
    else:
        until = seconds("until", until)
    if not starts:
        Simulation(scene).check_rests(ball)
    else:
        index_of(scene.names, ball)
    if seed is None:
        drawn: Any = np.random.SeedSequence().entropy if noise is not None else 0
        seed = drawn
    return Job(scene, ball, until, noise, int(samples), int(seed), events, starts)


def _is_whole(value: Any) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool)


def _play_all(
    job: Job,
    shots: NDArray[np.float64],
    starts: Starts | None,
    whole: Played,
    executor: Executor | None,
    piece: int | None,
    progress: bool,
) -> BaseException | None:
    # Into `whole`; returns the first thing that went wrong.
    rows = len(whole.error)
    with ExitStack() as stack:
        bar = stack.enter_context(_bar(rows)) if progress else None
        if executor is None:
            machine.compile()
            workers = cores() if machine.is_ready() else 1
            bounds = _equal(rows, piece) if piece is not None else _shrinking(rows, workers)
            executor = ThreadPoolExecutor(workers, "billiards_sim rollout")
            stack.callback(executor.shutdown, cancel_futures=True)
        else:
            even = -(-rows // PIECES)
            bounds = _equal(rows, piece if piece is not None else min(max(even, 2 * LEAST_PIECE), MOST_PIECE))
        pending: dict[Future[Played], tuple[int, int]] = {}
        trouble: BaseException | None = None
        try:
            for first, end in bounds:
                some = slice(first // job.samples, -(-end // job.samples))
                begun = None if starts is None else Starts(starts.positions[some], starts.in_play[some])
                future = executor.submit(play_piece, Piece(job, shots[some], begun, first, end))
                if not isinstance(future, Future):
                    raise TypeError(f"submit of the executor must return a Future, got {shown(future)}")
                pending[future] = first, end
        except Exception as error:  # it is broken, or shut down
            trouble = error
        try:
            for future in as_completed(list(pending)):
                first, end = pending.pop(future)
                try:
                    _put(whole, future.result(), first, end)
                except (Exception, CancelledError) as error:
                    trouble = trouble or error
                if bar is not None:
                    bar.update(end - first)
        finally:
            for future in pending:
                future.cancel()
    return trouble


def _put(whole: Played, played: Played, first: int, end: int) -> None:
    if not isinstance(played, Played) or len(played.error) != end - first:
        raise TypeError(f"the executor must return what it was given to play, got {shown(played)}")
    for name, rows in played._asdict().items():
        if isinstance(rows, np.ndarray):
            getattr(whole, name)[first:end] = rows
    whole.reasons.update({first + row: reason for row, reason in played.reasons.items()})
    if whole.logs is not None and played.logs is not None:
        whole.logs[first:end] = played.logs


def _shrinking(rows: int, workers: int) -> Iterator[tuple[int, int]]:
    # Bounds of pieces that get smaller towards the end.
    first = 0
    while first < rows:
        size = min(max((rows - first) // (PIECES_AHEAD * workers), LEAST_PIECE), MOST_PIECE)
        yield first, min(first + size, rows)
        first += size


def _equal(rows: int, size: int) -> Iterator[tuple[int, int]]:
    for first in range(0, rows, size):
        yield first, min(first + size, rows)


def cores() -> int:
    """Threads that a rollout without an executor has, where there is machine code."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _bar(rows: int) -> Any:
    try:
        from tqdm import tqdm
    except ImportError:
        raise ImportError("progress needs tqdm: pip install 'billiards_sim[progress]'") from None
    return tqdm(total=rows, unit="shot")


def _result(job: Job, whole: Played) -> Rollout:
    def shaped(rows: NDArray[Any]) -> NDArray[Any]:
        return rows.reshape(-1, job.samples, *rows.shape[1:]) if job.samples > 1 else rows

    reasons: dict[Any, str] = dict(sorted(whole.reasons.items()))
    if job.samples > 1:
        reasons = {divmod(row, job.samples): reason for row, reason in reasons.items()}
    arrays = {name: shaped(value) for name, value in whole._asdict().items() if isinstance(value, np.ndarray)}
    return Rollout(job.scene, **arrays, reasons=reasons, entropy=job.entropy, _logs=whole.logs)
