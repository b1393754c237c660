# SPDX-License-Identifier: Apache-2.0
"""What a solver made of a scene, kept so that tables, pictures and movies can look at any time of it."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from billiards_sim.engine.events import Event
from billiards_sim.engine.record import Run
from billiards_sim.engine.record import record as record_run
from billiards_sim.engine.recorder import Recorder
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation
from billiards_sim.quaternion import IDENTITY, turned
from billiards_sim.study.time_stepping import SOLVERS, TIME_STEP, Array, SchemeError, Solver, SteppedSolver

MOST_TICKS = 1_000_000
"""Times of a table: of a break every hundredth of a second for three hours. Its file would have gigabytes."""

MOST_STEPS = 1_000_000
"""Steps of a stepped solver, whose states are all kept: a few gigabytes."""

MOST_EVENTS = 1_000_000
"""Of a run that is recorded: a table without friction goes on for ever, and a third of a gigabyte is enough."""

PIECE = 0.5
"""s of the wall clock between two looks at how many events there are."""

CHUNK = 256
"""Times that are looked up together: enough to be quick, few enough to need no memory."""


class TooMany(ValueError):
    """More times than a table or a movie can have, or more events than are kept."""


class State(NamedTuple):
    """All balls at a time."""

    time: float  # s, by the solver's clock
    positions: Array  # (N, 2) m
    velocities: Array  # (N, 2) m/s
    angular_velocities: Array  # (N, 3) rad/s


class Pose(NamedTuple):
    """Where all balls are at a time, and how they are turned since the start."""

    time: float  # s, by the solver's clock
    positions: Array  # (N, 2) m
    orientations: Array  # (N, 4) unit quaternions x y z w


@dataclass(frozen=True)
class Recording(ABC):
    """A run, from `record`.

    Attributes:
        scene: where it started; its shot was played.
        start: the state after the shot, before anything moved.
        end: the state at the end.
        at_rest: whether every ball rests then.
        events: all events, in order.
        wall_seconds: s that the solver took on the wall clock, compiling not counted.
    """

    scene: Scene
    start: State
    end: State
    at_rest: bool
    events: Sequence[Event]
    wall_seconds: float

    @abstractmethod
    def samples(self, interval: float) -> Iterator[State]:
        """The states that a table of the run shows, from the start to the end, both included.

        Those of the engine are `interval` s apart, the last two less; those of a stepped solver are its own steps.
        """

    @abstractmethod
    def path(self, ball: str) -> Array:
        """(K, 3) t s, x m, y m: points that the path of a ball can be drawn through, every corner among them."""

    @abstractmethod
    def poses(self, times: ArrayLike) -> Iterator[Pose]:
        """The balls at times, s, that ascend from the start to the end at most; between steps on straight lines."""


@dataclass(frozen=True)
class ExactRecording(Recording):
    """A run of the engine, with how every ball moved."""

    run: Run

    def samples(self, interval: float) -> Iterator[State]:
        for times in _chunks(ticks(self.start.time, self.end.time, interval)):
            values = (self.run.positions(times), self.run.velocities(times), self.run.angular_velocities(times))
            yield from map(State, times.tolist(), *values)

    def path(self, ball: str) -> Array:
        return self.run.path(ball)

    def poses(self, times: ArrayLike) -> Iterator[Pose]:
        for some in _chunks(np.asarray(times, dtype=np.float64)):
            yield from map(Pose, some.tolist(), self.run.positions(some), self.run.orientations(some))


@dataclass(frozen=True)
class SteppedRecording(Recording):
    """A run of a stepped solver, with the state after each of its steps, from the start on."""

    steps: Sequence[State]

    def samples(self, interval: float) -> Iterator[State]:
        return iter(self.steps)

    def path(self, ball: str) -> Array:
        index = self.scene.names.index(ball)
        return np.array([(step.time, *step.positions[index]) for step in self.steps])

    def poses(self, times: ArrayLike) -> Iterator[Pose]:
        # The paper's clock can step back; a movie cannot.
        clock = np.maximum.accumulate([step.time for step in self.steps]).tolist()
        orientations = np.tile(IDENTITY, (len(self.scene), 1))
        last = 0
        for at in np.asarray(times, dtype=np.float64).tolist():
            while last + 1 < len(clock) and clock[last + 1] <= at:
                spins = 0.5 * (self.steps[last].angular_velocities + self.steps[last + 1].angular_velocities)
                orientations = turned(orientations, spins, clock[last + 1] - clock[last])
                last += 1
            here = self.steps[last]
            if last + 1 == len(clock):
                yield Pose(at, here.positions, orientations)
                continue
            ahead = self.steps[last + 1]
            share = (at - clock[last]) / (clock[last + 1] - clock[last])
            spins = here.angular_velocities + 0.5 * share * (ahead.angular_velocities - here.angular_velocities)
            positions = here.positions + share * (ahead.positions - here.positions)
            yield Pose(at, positions, turned(orientations, spins, at - clock[last]))


def record(scene: Scene, solver: str = "event", time_step: float = TIME_STEP, until: float | None = None) -> Recording:
    """Play a scene, with its shot if it has one.

    Args:
        solver: one of `SOLVERS`.
        time_step: s, of a stepped solver.
        until: s; None: until every ball rests.

    Raises:
        ValueError: the shot is refused; or without `until`, the balls never rest; or a stepped solver would need more
            than `MOST_STEPS` steps.
        TooMany: the engine has more than `MOST_EVENTS` events.
        SchemeError, StallError: the solver cannot go on.
    """
    player = SOLVERS[solver](scene, time_step)
    _play_shot(player)
    start = look(player)
    if isinstance(player, Simulation):
        return _record_run(player, start, until)
    assert isinstance(player, SteppedSolver)
    return _record_steps(player, start, time_step, until)


def _record_run(simulation: Simulation, start: State, until: float | None) -> ExactRecording:
    record_run(simulation.copy(), until=start.time)  # loads machine code, if there is some
    scene = simulation.start_scene
    recorder = Recorder(len(scene))
    began = time.perf_counter()
    events = simulation.run(until, recorder, budget=PIECE)
    while not (simulation.at_rest if until is None else simulation.time >= until):
        if len(events) > MOST_EVENTS:
            raise TooMany(f"more than {MOST_EVENTS} events by {simulation.time:.6g} s: end it earlier, with --until")
        events += simulation.run(until, recorder, budget=PIECE)
    wall_seconds = time.perf_counter() - began
    run = Run(scene, recorder, events, start.time, simulation.time)
    return ExactRecording(scene, start, look(simulation), simulation.at_rest, events, wall_seconds, run)


def _record_steps(player: SteppedSolver, start: State, time_step: float, until: float | None) -> SteppedRecording:
    if until is not None and not (until - start.time) / time_step <= MOST_STEPS:
        raise ValueError(
            f"{(until - start.time) / time_step:.3g} steps of {time_step:g} s to {until:g} s are too many: at most "
            f"{MOST_STEPS}"
        )
    steps = [start]
    began = time.perf_counter()
    for _ in player.steps(until):
        steps.append(look(player))
        if len(steps) > MOST_STEPS:
            raise SchemeError(
                f"{MOST_STEPS} steps of {time_step:g} s lead to {player.time:.6g} s only: the most it takes"
            )
    events = player.run(until=player.time)
    wall_seconds = time.perf_counter() - began
    steps[-1] = look(player)
    return SteppedRecording(player.start_scene, start, steps[-1], player.at_rest, events, wall_seconds, steps)


def ticks(start: float, end: float, interval: float, most: int = MOST_TICKS) -> Array:
    """(T,) times from the start to the end, both included, `interval` apart but for the last two. All s.

    Raises:
        TooMany: more than `most`.
    """
    rounding = 1e-9
    count = (end - start) / interval
    if not count < most:
        raise TooMany(f"{count:.3g} times, {interval:g} s apart until {end:g} s, are too many: at most {most}")
    return np.append(start + interval * np.arange(math.ceil(count - rounding)), end)


def look(solver: Solver) -> State:
    """The present state of a solver."""
    return State(solver.time, solver.positions, solver.velocities, solver.angular_velocities)


def _chunks(times: Array) -> Iterator[Array]:
    for first in range(0, len(times), CHUNK):
        yield times[first : first + CHUNK]


def _play_shot(solver: Solver) -> None:
    shot = solver.start_scene.shot
    if shot is not None:
        solver.strike(shot.force, shot.offset, shot.ball)
