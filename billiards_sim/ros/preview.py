# SPDX-License-Identifier: Apache-2.0
"""What a shot would do: played out on a copy of the table, with bounded work."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from billiards_sim.engine.events import Event
from billiards_sim.engine.record import Run
from billiards_sim.engine.scene import Shot
from billiards_sim.engine.simulation import Simulation
from billiards_sim.engine.trajectory import Recorder
from billiards_sim.ros.messages import Stamps, answer_record, collision_record

SLICE = 0.05
"""s of simulated time that is played at once at the start, when events are dense."""

GROWTH = 1.0
"""Later slices in shares of the time since the shot: few slices are quick."""

HORIZON = 60.0
"""s of simulated time after which a preview ends, for tables whose balls hardly come to rest."""

MOST_EVENTS = 1000
"""Events after which a preview ends with the slice; a break has some 200."""


@dataclass(frozen=True)
class Preview:
    """A shot played out.

    Attributes:
        start: simulated time of the shot, s.
        end: time of the last state, s.
        complete: whether every ball rests at the end; else the preview ran into `HORIZON` or `MOST_EVENTS`.
        events: in order.
        paths: of each ball the points (t, x, y), simulated s and m, that its centre passes, in order, as `Run.path`
            has them; the struck ball's begin where it lay before the cue pushed it. A single one for a ball that stays.
    """

    start: float
    end: float
    complete: bool
    events: Sequence[Event]
    paths: Sequence[Sequence[tuple[float, float, float]]]

    @property
    def final_positions(self) -> list[tuple[float, float]]:
        """(N, 2) m."""
        return [(x, y) for _, x, y in (path[-1] for path in self.paths)]


def predict(simulation: Simulation, shot: Shot) -> Preview:
    """Play a shot on a copy of a resting table; the simulation itself does not change.

    Raises:
        ValueError: as `Simulation.strike`.
        StallError: as `Simulation.run`.
    """
    twin = simulation.copy()
    start = twin.time
    lay = [(start, x, y) for x, y in twin.positions.tolist()]
    twin.strike(shot.force, shot.offset, shot.ball)
    recorder = Recorder(len(lay))
    log = twin.run(start, recorder)
    while not twin.at_rest and twin.time < start + HORIZON and len(log) < MOST_EVENTS:
        log += twin.run(min(twin.time + max(SLICE, GROWTH * (twin.time - start)), start + HORIZON), recorder)
    events = list(log)
    end = events[-1].time if twin.at_rest else twin.time
    run = Run(twin.start_scene, recorder, events, start, end)
    paths = [[tuple(point) for point in run.path(ball).tolist()] for ball in run.scene.names]
    return Preview(start, end, twin.at_rest, events, [_from(point, path) for point, path in zip(lay, paths)])


def preview_json(
    preview: Preview, names: Sequence[str], radius: float, stamps: Stamps, request: tuple[int, int]
) -> str:
    """A preview as JSON for `preview/result`.

    Args:
        names: of the balls.
        radius: of the balls, m.
        stamps: of simulated times.
        request: (sec, nanosec), the stamp of the message that asked.
    """
    answer = answer_record("", preview.start, request)
    answer["complete"] = preview.complete
    answer["duration"] = preview.end - preview.start
    answer["names"] = list(names)
    answer["final_positions"] = dict(zip(names, preview.final_positions))
    answer["paths"] = dict(zip(names, preview.paths))
    answer["events"] = [collision_record(event, stamps.at(event.time), radius) for event in preview.events]
    return json.dumps(answer)


def _from(lay: tuple[float, float, float], path: list[tuple[float, float, float]]) -> list[tuple[float, float, float]]:
    return path if path[0] == lay else [lay, *path]
