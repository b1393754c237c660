# SPDX-License-Identifier: Apache-2.0
"""What a shot would do: played out on a copy of the table, with bounded work."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from billiards_sim.engine.events import Event
from billiards_sim.engine.record import Run
from billiards_sim.engine.recorder import Recorder
from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros.messages import Stamps, answer_record, collision_record

SLICE = 0.05
"""s of simulated time that is played at once at the start, when events are dense."""

GROWTH = 1.0
"""Later slices in shares of the time since the shot: few slices are quick."""

PIECE = 0.01
"""s of the wall clock after which the engine gives way at the latest: some ten thousand events, before the bounds are
looked at again."""

HORIZON = 60.0
"""s of simulated time after which a preview ends, for tables whose balls hardly come to rest."""

MOST_EVENTS = 1000
"""Events after which a preview ends; a break has some 200."""

MOST_WORK = 5.0
"""s of work after which a preview ends, for balls that take ages to do what is not even an event. A break takes 3 ms,
50 ms where the engine is interpreted."""


@dataclass(frozen=True)
class Preview:
    """A shot played out.

    Attributes:
        scene: of the balls.
        start: simulated time of the shot, s.
        end: time of the last state, s.
        complete: whether every ball rests at the end; else it ran into `HORIZON`, `MOST_EVENTS` or `MOST_WORK`.
        events: in order.
        paths: of each ball in play, by name in the order of the scene, the points (t, x, y), simulated s and m, that
            its centre passes, as `Run.path` has them; the struck ball's begin where it lay before the cue pushed it. A
            single one for a ball that stays.
    """

    scene: Scene
    start: float
    end: float
    complete: bool
    events: Sequence[Event]
    paths: Mapping[str, Sequence[tuple[float, float, float]]]

    @property
    def pocketed(self) -> dict[str, str]:
        """Pockets by the names of the balls that fall into them, in order."""
        return {event.balls[0]: event.pocket for event in self.events if event.pocket is not None}

    @property
    def final_positions(self) -> dict[str, tuple[float, float]]:
        """(x, y) m of each ball that is still in play."""
        gone = self.pocketed
        return {name: path[-1][1:] for name, path in self.paths.items() if name not in gone}


class Prediction:
    """A shot that is being played out on a copy of a resting table, piece by piece.

    Raises:
        ValueError: as `Simulation.strike`.
    """

    def __init__(self, simulation: Simulation, shot: Shot) -> None:
        self._twin = simulation.copy()
        self._start = self._twin.time
        names, in_play = self._twin.start_scene.names, self._twin.in_play
        places = zip(names, self._twin.positions.tolist(), in_play)
        self._lay = {name: (self._start, x, y) for name, (x, y), is_there in places if is_there}
        self._twin.strike(shot.force, shot.offset, shot.ball)
        self._recorder = Recorder(len(names))
        self._log = self._twin.run(self._start, self._recorder, budget=0.0)
        self._work = 0.0  # s

    @property
    def _ended(self) -> bool:
        return (
            self._twin.at_rest
            or self._twin.time >= self._start + HORIZON
            or len(self._log) >= MOST_EVENTS
            or self._work >= MOST_WORK
        )

    def go_on(self, budget: float = math.inf) -> Preview | None:
        """Play on for some s of the wall clock; returns the preview once it is there.

        Raises:
            StallError: as `Simulation.run`.
        """
        before, began = self._work, time.monotonic()
        while not self._ended and self._work - before < budget:
            elapsed = self._twin.time - self._start
            until = self._start + min(elapsed + max(SLICE, GROWTH * elapsed), HORIZON)
            self._log += self._twin.run(max(until, self._twin.time), self._recorder, budget=PIECE)
            self._work = before + time.monotonic() - began
        return self._preview() if self._ended else None

    def _preview(self) -> Preview:
        scene = self._twin.start_scene
        events = list(self._log[:MOST_EVENTS])
        complete = self._twin.at_rest and len(events) == len(self._log)
        cut = len(events) < len(self._log)
        end = self._rest_time(events[-1].time) if complete else events[-1].time if cut else self._twin.time
        run = Run(scene, self._recorder, events, self._start, end)
        paths = {name: [tuple(point) for point in run.path(name).tolist()] for name in self._lay}
        paths = {name: path if path[0] == self._lay[name] else [self._lay[name], *path] for name, path in paths.items()}
        return Preview(scene, self._start, end, complete, events, paths)

    def _rest_time(self, last: float) -> float:
        # From the last event, s, on: until the last spin about the vertical has ended, where they do.
        deceleration = self._twin.start_scene.physics.spin_deceleration
        if deceleration == 0.0:
            return last
        run = Run(self._twin.start_scene, self._recorder, self._log, self._start, self._twin.time)
        spin = float(np.abs(run.angular_velocities([last])[0, :, 2]).max())
        return min(last + spin / deceleration, self._twin.time)


def predict(simulation: Simulation, shot: Shot) -> Preview:
    """Play a shot on a copy of a resting table; the simulation itself does not change.

    Raises:
        ValueError: as `Simulation.strike`.
        StallError: as `Simulation.run`.
    """
    preview = Prediction(simulation, shot).go_on()
    assert preview is not None
    return preview


def preview_json(preview: Preview, stamps: Stamps, request: tuple[int, int]) -> str:
    """A preview as JSON for `preview/result`.

    Args:
        stamps: of simulated times.
        request: (sec, nanosec), the stamp of the message that asked.
    """
    radius = preview.scene.physics.radius
    answer = answer_record("", preview.start, request)
    answer["complete"] = preview.complete
    answer["duration"] = preview.end - preview.start
    answer["names"] = list(preview.paths)
    answer["final_positions"] = preview.final_positions
    answer["pocketed"] = preview.pocketed
    answer["paths"] = preview.paths
    answer["events"] = [collision_record(event, stamps.at(event.time), radius) for event in preview.events]
    return json.dumps(answer)
