# SPDX-License-Identifier: Apache-2.0
"""A run to look at afterwards: where every ball was at any time of it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_sim.engine import machine
from billiards_sim.engine.events import Event
from billiards_sim.engine.kernels.orientation import Turns, turn_along, turn_each
from billiards_sim.engine.moment import SPINS, inner_time, spins_after
from billiards_sim.engine.quantity import float_array, shown
from billiards_sim.engine.recorder import Recorder
from billiards_sim.engine.scene import Scene, index_of
from billiards_sim.engine.simulation import Simulation
from billiards_sim.engine.tables import blank, columns, set_columns
from billiards_sim.quaternion import IDENTITY, product

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

CHORD = 2e-4
"""m. How far the straight line between two points of a path may lie from the ball at any time: less than a tenth of a
pixel where a table fills a screen."""


TURN = ("time", "wx", "wy", "wz", "alpha_x", "alpha_y", "alpha_z", "qx", "qy", "qz", "qw")


class Run:
    """What happened from one time to another, from `record`.

    Attributes:
        scene: of the simulation.
        start, end: s. Every time that is asked for lies between, both included.
        events: those of the run, in order.

    Positions, velocities and angular velocities have the bits that the simulation would have shown at that time.
    """

    def __init__(
        self,
        scene: Scene,
        recorder: Recorder,
        events: Sequence[Event],
        start: float,
        end: float,
        orientations: Array | None = None,
    ) -> None:
        self.scene, self.events, self.start, self.end = scene, events, start, end
        self._epoch = recorder.epoch
        arcs = recorder.arcs()
        balls = columns(arcs, "ball")[:, 0].astype(np.intp)
        by_ball = np.argsort(balls, kind="stable")
        self._first = np.searchsorted(balls[by_ball], np.arange(len(scene) + 1))
        self._times = columns(arcs, "time")[by_ball, 0]
        self._places = columns(arcs, "x", "y")[by_ball]
        self._velocities = columns(arcs, "vx", "vy")[by_ball]
        self._accelerations = columns(arcs, "ax", "ay")[by_ball]
        self._spins = columns(arcs, *SPINS)[by_ball]
        self._orientations = orientations

    def positions(self, times: ArrayLike) -> Array:
        """(T, N, 2) m, frame `table`, at times (T,), s; nan for balls that are not in play.

        Raises:
            ValueError: `times` has another shape, or one of them lies outside of the run.
        """
        return self._positions(*self._arcs(times))

    def velocities(self, times: ArrayLike) -> Array:
        """(T, N, 2) m/s, at times (T,), s.

        Raises:
            ValueError: as `positions`.
        """
        arcs, ages = self._arcs(times)
        return self._velocities[arcs] + self._accelerations[arcs] * ages

    def angular_velocities(self, times: ArrayLike) -> Array:
        """(T, N, 3) rad/s, at times (T,), s.

        Raises:
            ValueError: as `positions`.
        """
        arcs, ages = self._arcs(times)
        return spins_after(self._spins[arcs], ages)

    def orientations(self, times: ArrayLike) -> Array:
        """(T, N, 4) unit quaternions x y z w, at times (T,), s: how each ball is turned.

        Counted from the start of the run, or of the simulation where its scene tracks orientation; as exact as
        `Simulation.orientations`.

        Raises:
            ValueError: as `positions`.
        """
        arcs, _ = self._arcs(times)
        turns = _turns(self._turns[arcs.ravel()])
        set_columns(turns.turns, ("end",), np.repeat(self._inner(times), len(self.scene))[:, np.newaxis])
        machine.call(turn_each, turns)
        since = columns(turns.turns, "qx", "qy", "qz", "qw")
        if self._orientations is not None:
            since = product(since, np.tile(self._orientations, (len(arcs), 1)))
        return since.reshape(*arcs.shape, 4)

    def arcs(self, ball: str) -> Array:
        """(K, 13) the stretches of a ball's motion in closed form, in order; each holds until the next begins.

        Columns: t, s; x, y, m from the centre of the table; vx, vy; ax, ay; wx, wy, wz; and their rates of change, of
        which that of wz lasts until wz is 0. At a time T and an age d = T - t the ball is at (v + a/2 d) d + (x, y),
        plus the centre, with the bits of `positions`. A ball that is not in play has none.

        Raises:
            ValueError: no such ball.
        """
        rows = slice(*self._first[index_of(self.scene.names, ball) :][:2])
        parts = (self._places, self._velocities, self._accelerations, self._spins)
        arcs = np.column_stack((self._times[rows] + self._epoch, *(part[rows] for part in parts)))
        return arcs[~np.isnan(arcs[:, 1])]

    def path(self, ball: str) -> Array:
        """(K, 3) t s, x m, y m: points that the path of a ball can be drawn or played through, on straight lines.

        They begin at the start of the run and end with it or where the ball stays; a ball that is not in play has none.
        There is one at each event of the ball, and between two of them as many as it takes to keep the lines within
        `CHORD` of the ball at every time: a motion of acceleration a bends away from a line of duration d by
        a/2 (d/2)^2. A ball that falls has two points at that time: at the edge of the slate, and where it is from then
        on.

        Raises:
            ValueError: no such ball.
        """
        index = index_of(self.scene.names, ball)
        times = self._path_times(index, np.unique([self.start, *self._event_times[ball], self.end]))
        points = self._positions(*self._arcs_of(index, self._inner(times)))
        if np.isnan(points[0, 0]):
            return np.empty((0, 3))
        stays = len(points) > 1 and np.array_equal(points[-1], points[-2])
        path = np.column_stack((times, points))[: -1 if stays else None]
        fall = self._falls.get(ball)
        if fall is None:
            return path
        place = int(np.searchsorted(path[:, 0], fall.time))  # where the ball is in the pocket already
        return np.insert(path, place, (fall.time, *fall.point), axis=0)

    def _path_times(self, ball: int, stops: Array) -> Array:
        # (K,) the stops, (S,), and what is needed between two of them.
        first, last = self._first[ball : ball + 2]
        began, sizes = self._times[first:last], self._sizes[first:last]
        begin, end = stops[:-1], stops[1:]
        low = np.searchsorted(began, self._inner(begin), "right") - 1
        high = np.searchsorted(began, self._inner(end), "left")
        acceleration = sizes[low]
        through = np.flatnonzero(high - low > 1)
        if len(through):
            lines = [
                line
                for one in through.tolist()
                for line in self._lines(first + low[one], first + high[one], *stops[one : one + 2].tolist())
            ]
            kept = np.column_stack((begin, end, acceleration))[high - low <= 1]
            begin, end, acceleration = np.array(sorted([*map(tuple, kept.tolist()), *lines])).T
        parts = np.maximum(np.ceil((end - begin) * np.sqrt(acceleration / (8.0 * CHORD))), 1.0).astype(np.intp)
        part = np.arange(1, parts.sum() + 1) - np.repeat(np.cumsum(parts) - parts, parts)  # 1, 2 .. in each stretch
        stretch = np.repeat(np.arange(len(parts)), parts)
        share = part / parts[stretch]
        between = np.where(share < 1.0, begin[stretch] + (end - begin)[stretch] * share, end[stretch])
        return np.append(stops[0], between)

    def _lines(self, low: int, high: int, begin: float, end: float) -> list[tuple[float, float, float]]:
        # From when to when there is an arc of its own, with its acceleration, or a single line through several, 0,
        # where a ball goes through hundreds, as in touch with another. On a line of duration T on which the velocity
        # changes by A in all, the ball stays within A T/4.
        began = np.clip(self._times[low + 1 : high] + self._epoch, begin, end)
        times = [begin, *began.tolist(), end]
        jumps, sizes = [0.0, *self._jumps[low : high - 1].tolist()], self._sizes[low:high].tolist()
        lines: list[tuple[float, float, float]] = []
        since, change, alone = begin, 0.0, 0.0
        for start, stop, jump, size in zip(times, times[1:], jumps, sizes):
            change += jump
            if stop == start:
                continue
            gain = size * (stop - start)
            if start > since and (stop - since) * (change + gain) > 4.0 * CHORD:
                lines.append((since, start, alone))
                since, change = start, 0.0
            change, alone = change + gain, size if start == since else 0.0
        return [*lines, (since, end, alone)]

    def _arcs(self, times: ArrayLike) -> tuple[Indices, Array]:
        # (T, N) the arcs that the balls are on at times, and (T, N, 1) s since these began.
        try:
            at = float_array(times)
        except ValueError:
            raise ValueError(f"times must be numbers of shape (T,), got {shown(times)}") from None
        if at.ndim != 1:
            raise ValueError(f"times must have shape (T,), got {at.shape}")
        outside = ~((at >= self.start) & (at <= self.end))
        if outside.any():
            raise ValueError(
                f"times must lie in the run, {self.start:.9g} to {self.end:.9g} s, got {at[outside].item(0)!r}"
            )
        inner = self._inner(at)
        found = [self._arcs_of(ball, inner) for ball in range(len(self.scene))]
        return np.stack([arcs for arcs, _ in found], axis=1), np.stack([ages for _, ages in found], axis=1)

    def _inner(self, times: ArrayLike) -> Array:
        # Of the kernels' clock, by which the arcs go.
        at = np.asarray(times, dtype=np.float64)
        return np.array([inner_time(time, self._epoch) for time in at.tolist()]) if self._epoch else at

    def _arcs_of(self, ball: int, times: Array) -> tuple[Indices, Array]:
        # (T,) and (T, 1) of one ball. Of several arcs that begin at the same time the last is what the others led to.
        first, last = self._first[ball : ball + 2]
        arcs = first + np.searchsorted(self._times[first:last], times, side="right") - 1
        return arcs, (times - self._times[arcs])[:, np.newaxis]

    def _positions(self, arcs: Indices, ages: Array) -> Array:
        # The operations of `Simulation.positions`, in their order.
        moved = (self._velocities[arcs] + 0.5 * self._accelerations[arcs] * ages) * ages
        return self._places[arcs] + moved + np.array(self.scene.table.centre)

    @cached_property
    def _event_times(self) -> dict[str, list[float]]:
        times: dict[str, list[float]] = {name: [] for name in self.scene.names}
        for event in self.events:
            for ball in event.balls:
                times[ball].append(max(event.time, self.start))
        return times

    @cached_property
    def _sizes(self) -> Array:
        # (arcs,) of the accelerations, m/s^2.
        return np.hypot(*self._accelerations.T)

    @cached_property
    def _jumps(self) -> Array:
        # (arcs - 1,) m/s, by how much the velocity changes from the end of an arc to the next of the same ball.
        began = self._times + self._epoch
        ends = self._velocities[:-1] + self._accelerations[:-1] * np.diff(began)[:, np.newaxis]
        return np.hypot(*(self._velocities[1:] - ends).T)

    @cached_property
    def _falls(self) -> dict[str, Event]:
        return {event.balls[0]: event for event in self.events if event.kind == "pocketed"}

    @cached_property
    def _turns(self) -> Array:
        # (arcs, fields of TURN) how the balls are turned where their arcs begin. What was on its way already counts
        # from the start.
        start = inner_time(self.start, self._epoch)
        begun, spins = self._times.copy(), self._spins.copy()
        for first in self._first[:-1]:
            age = max(start - begun[first], 0.0)
            spins[first, 0:3] = spins_after(spins[first], np.array([age]))
            begun[first] += age
        orientations = np.zeros((len(begun), 4))
        orientations[self._first[:-1]] = IDENTITY  # those of later arcs follow
        turns = _turns(np.column_stack((begun, spins, orientations)))
        machine.call(turn_along, turns)
        return columns(turns.turns, *TURN)


def _turns(values: Array) -> Turns:
    turns = blank(Turns, machine.is_ready(), turns=len(values))
    set_columns(turns.turns, TURN, values)
    return turns


def record(simulation: Simulation, until: float | None = None) -> Run:
    """Let a simulation go on, as its `run` does, and keep how every ball moved.

    Args:
        until: s; None: until every ball rests.

    Raises:
        ValueError, StallError: as `Simulation.run`.
    """
    scene, start = simulation.start_scene, simulation.time
    orientations = simulation.orientations if scene.track_orientation else None
    recorder = Recorder(len(scene))
    twin = simulation.copy()  # so that an interrupt leaves all to be recorded again
    events = twin.run(until, recorder)
    run = Run(scene, recorder, events, start, twin.time, orientations)
    simulation.restore(twin.snapshot())
    return run
