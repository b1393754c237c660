# SPDX-License-Identifier: Apache-2.0
"""Balls that fall into pockets, for pictures and movies: the engine ends with the fall, eyes want to see it."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.events import Event
from billiards_sim.engine.scene import Scene
from billiards_sim.outline import outline

DURATION = 0.18
"""s from the lip to the bottom: what a free fall by a ball's diameter and a half and a bounce take about."""

PLACES = 3
"""Balls side by side in a pocket; further ones lie on them."""


@dataclass(frozen=True)
class Fall:
    """Of a ball.

    Attributes:
        time: s, of the event.
        start: (2,) m, where it was then, frame `table`.
        place: (2,) m, where it comes to lie.
    """

    time: float
    start: NDArray[np.float64]
    place: NDArray[np.float64]

    def at(self, time: float) -> tuple[NDArray[np.float64], float]:
        """(2,) m where the ball is at a time, s, after the event, and how far it has fallen, 0 to 1."""
        share = min(max((time - self.time) / DURATION, 0.0), 1.0)
        return self.start + share * (self.place - self.start), share * share


def falls(scene: Scene, events: Iterable[Event]) -> dict[int, Fall]:
    """The falls of a run, by the places of the balls in the scene, in order."""
    mouths = {mouth.name: mouth for mouth in scene.table.mouths}
    holes = dict(zip(mouths, outline(scene.table).holes, strict=True))
    centre, radius = np.array(scene.table.centre), scene.physics.radius
    found: dict[int, Fall] = {}
    count: Counter[str] = Counter()
    for event in events:
        if event.pocket is None:
            continue
        mouth = mouths[event.pocket]
        room = max(mouth.pocket.slate_radius - radius, 0.0)
        across, up = np.sign(mouth.centre).tolist()  # outwards, where the first one rolls
        angle = math.atan2(up, across) + 2.0 * math.pi * count[event.pocket] / PLACES
        count[event.pocket] += 1
        place = np.array(mouth.centre) + centre + room * np.array((math.cos(angle), math.sin(angle)))
        hole = holes[event.pocket]
        place = np.clip(place, hole.min(axis=0) + radius, hole.max(axis=0) - radius)  # it may be cut at its back
        found[scene.names.index(event.balls[0])] = Fall(event.time, np.array(event.point), place)
    return found
