# SPDX-License-Identifier: Apache-2.0
"""The events of a shot in words, as they come on `collisions`."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any


class Commentary:
    """Follows one shot from its `shot` event until every ball that moved rests.

    Attributes:
        counts: events by kind.
        first_time: of the shot, s; NaN before it.
        last_time: of the last event, s.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.first_time = math.nan
        self.last_time = math.nan
        self._moving: set[str] = set()

    @property
    def finished(self) -> bool:
        """Whether the last event has been taken."""
        return self.counts["shot"] > 0 and not self._moving

    def take(self, event: dict[str, Any]) -> str:
        """Note an event; returns the line that tells of it, or nothing for the end of slip or of motion.

        What comes before the shot belongs to an earlier one.
        """
        kind = event["kind"]
        if not self.counts["shot"] and kind != "shot":
            return ""
        self.counts[kind] += 1
        self.last_time = event["time"]
        if kind == "shot":
            self.first_time = event["time"]
        if kind == "rest":
            self._moving.difference_update(event["balls"])
        else:
            self._moving.update(event["balls"])
        text = describe(event)
        return f"  {event['time'] - self.first_time:7.4f} s  {text}" if text else ""


def describe(event: dict[str, Any]) -> str:
    """A collision or a shot in words; nothing for the end of slip or of motion."""
    balls = event["balls"]
    if event["kind"] == "shot":
        return f"the cue hits ball {balls[0]} with {event['impulse']:.3g} N s"
    if event["kind"] == "ball_ball":
        return f"ball {balls[0]} and ball {balls[1]} at {event['approach_speed']:.3g} m/s"
    if event["kind"] == "ball_rail":
        return f"ball {balls[0]} and rail {event['rail']} at {event['approach_speed']:.3g} m/s"
    return ""
