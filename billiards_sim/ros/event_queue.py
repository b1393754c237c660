# SPDX-License-Identifier: Apache-2.0
"""Events on their way to `collisions`: one message a tick, as much as a tick can carry."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from billiards_sim.engine.events import Event
from billiards_sim.ros.messages import VERSION, Stamps, collision_record

EVENTS_A_TICK = 200
"""Most events in a message: some 5 ms of work. A dense cluster can have thousands, which would hold up the ticks; they
wait for the next ticks."""

MOST_WAITING = 20_000
"""Events that wait at most: those of the longest shot, and a second of ticks at 100 Hz. Beyond, the oldest go."""


@dataclass(frozen=True)
class _Batch:
    events: Sequence[Event]
    stamps: Stamps
    radius: float  # m, of the balls


class EventQueue:
    """Events in order. Each message that is taken has the next number; so has each that is dropped.

    Attributes:
        dropped: events that were dropped since the start.
    """

    def __init__(self) -> None:
        self.dropped = 0
        self._batches: deque[_Batch] = deque()
        self._count = 0
        self._sequence = 0

    def __len__(self) -> int:
        return self._count

    def add(self, events: Sequence[Event], stamps: Stamps, radius: float) -> None:
        """Append what happened.

        Args:
            stamps: of the simulated times of these events.
            radius: of the balls, m.
        """
        self._batches.append(_Batch(events, stamps, radius))
        self._count += len(events)
        lost = math.ceil(max(self._count - MOST_WAITING, 0) / EVENTS_A_TICK)  # messages
        if lost:
            self.dropped += sum(len(batch.events) for batch in self._cut(lost * EVENTS_A_TICK))
            self._sequence += lost

    def take(self) -> dict[str, Any]:
        """The next message for JSON, with the oldest events, at most `EVENTS_A_TICK`."""
        self._sequence += 1
        records = [
            collision_record(event, batch.stamps.at(event.time), batch.radius)
            for batch in self._cut(EVENTS_A_TICK)
            for event in batch.events
        ]
        return {"version": VERSION, "sequence": self._sequence, "events": records}

    def _cut(self, most: int) -> list[_Batch]:
        # The oldest events, which leave the queue.
        found = []
        while most > 0 and self._batches:
            batch = self._batches.popleft()
            rest = batch.events[most:]
            if len(rest):
                self._batches.appendleft(_Batch(rest, batch.stamps, batch.radius))
                batch = _Batch(batch.events[:most], batch.stamps, batch.radius)
            found.append(batch)
            most -= len(batch.events)
            self._count -= len(batch.events)
        return found
