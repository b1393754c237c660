# SPDX-License-Identifier: Apache-2.0
"""What a solver made of a scene, kept so that tables, pictures and movies can look at any time of it."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from billiards_sim.engine.events import Event
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation
from billiards_sim.quaternion import IDENTITY, turned
from billiards_sim.study.time_stepping import SOLVERS, TIME_STEP, Array, Solver, SteppedSolver

PATH_STEP = 0.01
"""s between two points of a path, corners aside: sliding friction bends it by 25 um in that time."""

PATH_POINTS = 10_000
"""Points of a path, corners aside, from which on they are further apart than `PATH_STEP`."""


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
    def path(self) -> Array:
        """(T, N, 2) m: positions that the balls' paths can be drawn through, every corner among them."""

    @abstractmethod
    def poses(self, times: Iterable[float]) -> Iterator[Pose]:
        """The balls at times, s, that ascend from the start to the end at most; between steps on straight lines."""


class ExactRecording(Recording):
    """A run of the engine. Whatever is asked for is computed anew: cutting a run into pieces changes no bit of it."""

    def samples(self, interval: float) -> Iterator[State]:
        simulation = _started(self.scene)
        for at in ticks(self.start.time, self.end.time, interval):
            simulation.run(until=at)
            yield look(simulation)

    def path(self) -> Array:
        interval = max(PATH_STEP, self.end.time / PATH_POINTS)
        corners = [event.time for event in self.events]
        times = np.union1d(corners, [*ticks(self.start.time, self.end.time, interval)])
        simulation = _started(self.scene)
        points = []
        for at in times.tolist():
            simulation.run(until=at)
            points.append(simulation.positions)
        return np.array(points)

    def poses(self, times: Iterable[float]) -> Iterator[Pose]:
        simulation = _started(replace(self.scene, track_orientation=True))
        for at in times:
            simulation.run(until=at)
            yield Pose(at, simulation.positions, simulation.orientations)


@dataclass(frozen=True)
class SteppedRecording(Recording):
    """A run of a stepped solver, with the state after each of its steps, from the start on."""

    steps: Sequence[State]

    def samples(self, interval: float) -> Iterator[State]:
        return iter(self.steps)

    def path(self) -> Array:
        return np.array([step.positions for step in self.steps])

    def poses(self, times: Iterable[float]) -> Iterator[Pose]:
        # The paper's clock can step back; a movie cannot.
        clock = np.maximum.accumulate([step.time for step in self.steps]).tolist()
        orientations = np.tile(IDENTITY, (len(self.scene), 1))
        last = 0
        for at in times:
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
        ValueError: the shot is refused; or without `until`, the balls never rest.
        SchemeError, StallError: the solver cannot go on.
    """
    player = SOLVERS[solver](scene, time_step)
    _play_shot(player)
    start = look(player)
    if isinstance(player, SteppedSolver):
        began = time.perf_counter()
        steps = [start, *(look(player) for _ in player.steps(until))]
        events = player.run(until=player.time)
        wall_seconds = time.perf_counter() - began
        steps[-1] = look(player)
        return SteppedRecording(scene, start, steps[-1], player.at_rest, events, wall_seconds, steps)
    _started(scene).run(until=0.0)  # compiles the engine
    began = time.perf_counter()
    events = player.run(until)
    wall_seconds = time.perf_counter() - began
    return ExactRecording(scene, start, look(player), player.at_rest, events, wall_seconds)


def ticks(start: float, end: float, interval: float) -> Iterator[float]:
    """Times from the start to the end, both included, `interval` apart but for the last two. All s."""
    rounding = 1e-9
    for count in range(math.ceil((end - start) / interval - rounding)):
        yield start + count * interval
    yield end


def look(solver: Solver) -> State:
    """The present state of a solver."""
    return State(solver.time, solver.positions, solver.velocities, solver.angular_velocities)


def _started(scene: Scene) -> Simulation:
    simulation = Simulation(scene)
    _play_shot(simulation)
    return simulation


def _play_shot(solver: Solver) -> None:
    shot = solver.start_scene.shot
    if shot is not None:
        solver.strike(shot.force, shot.offset, shot.ball)
