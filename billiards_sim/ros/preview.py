# SPDX-License-Identifier: Apache-2.0
"""What a shot would do: played out on a copy of the table, with bounded work."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

from billiards_sim.engine.events import Event
from billiards_sim.engine.scene import Shot
from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros.messages import Stamps, answer_record, collision_record

SLICE = 0.05
"""s of simulated time between the points of a path at the start, beside those of the events: a ball that slides after
a hard collision curves for some half a second."""

GROWTH = 0.1
"""Later slices in shares of the time since the shot: slow balls roll straight, and few slices are quick."""

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
        paths: of each ball the points (x, y), m, that its centre passes; a single one for a ball that stays.
    """

    start: float
    end: float
    complete: bool
    events: Sequence[Event]
    paths: Sequence[Sequence[tuple[float, float]]]

    @property
    def final_positions(self) -> list[tuple[float, float]]:
        """(N, 2) m."""
        return [path[-1] for path in self.paths]


def predict(simulation: Simulation, shot: Shot) -> Preview:
    """Play a shot on a copy of a resting table; the simulation itself does not change.

    Raises:
        ValueError: as `Simulation.strike`.
        StallError: as `Simulation.advance`.
    """
    twin = simulation.copy()
    names = twin.start_scene.names
    radius = twin.start_scene.physics.radius
    paths = [[(x, y)] for x, y in twin.positions.tolist()]
    twin.strike(shot.force, shot.offset, shot.ball)
    _extend(paths, twin)
    events: list[Event] = []
    start = twin.time
    end = start
    while not twin.at_rest and twin.time - start < HORIZON and len(events) < MOST_EVENTS:
        elapsed = twin.time - start
        new = list(twin.advance(min(max(SLICE, GROWTH * elapsed), HORIZON - elapsed)))
        for event in new:
            for ball, centre in zip(event.balls, _centres(event, radius)):
                paths[names.index(ball)].append(centre)
        _extend(paths, twin)
        events += new
        end = events[-1].time if twin.at_rest else twin.time
    return Preview(start, end, twin.at_rest, events, paths)


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
    answer["final_positions"] = dict(zip(names, preview.final_positions))
    answer["events"] = [collision_record(event, stamps.at(event.time), radius) for event in preview.events]
    return json.dumps(answer)


def _extend(paths: list[list[tuple[float, float]]], simulation: Simulation) -> None:
    for path, (x, y) in zip(paths, simulation.positions.tolist()):
        if path[-1] != (x, y):
            path.append((x, y))


def _centres(event: Event, radius: float) -> list[tuple[float, float]]:
    # Of the event's balls. The normal points from the second ball, or from the rail, to the first.
    x, y = event.point
    if event.kind == "shot":
        return []  # its point is the tip of the cue
    if event.kind not in ("ball_ball", "ball_rail"):
        return [(x, y)]
    across, along = event.normal
    return [(x + side * radius * across, y + side * radius * along) for side in (1.0, -1.0)]
