# SPDX-License-Identifier: Apache-2.0
"""The events of a shot in words, as they come on `collisions`."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

SLIGHT = 1e-3
"""m/s. A ball that a contact leaves so slow rolls 5 um on the default cloth: nobody sees it, and a cluster has many."""


class Commentary:
    """Follows one shot from its `shot` event until every ball that moved rests or is pocketed.

    Slight contacts in a row are told together.

    Attributes:
        counts: events by kind.
        pocketed: pockets by the names of the balls that fell into them, in order.
        fastest: m/s, at which two balls met.
        first_time: of the shot, s; NaN before it.
        last_time: of the last event, s.
    """

    def __init__(self) -> None:
        self.counts: Counter[str] = Counter()
        self.first_time = math.nan
        self.last_time = math.nan
        self.pocketed: dict[str, str] = {}
        self.fastest = 0.0
        self._moving: set[str] = set()
        self._slight: list[float] = []  # s, times of slight contacts that are not told yet

    @property
    def finished(self) -> bool:
        """Whether the last event has been taken."""
        return self.counts["shot"] > 0 and not self._moving

    def take(self, event: dict[str, Any]) -> list[str]:
        """Note an event; returns the lines to be told now. What comes before the shot belongs to an earlier one."""
        kind = event["kind"]
        if not self.counts["shot"] and kind != "shot":
            return []
        self.counts[kind] += 1
        self.last_time = event["time"]
        if kind == "ball_ball":
            self.fastest = max(self.fastest, event["approach_speed"])
        if kind == "shot":
            self.first_time = event["time"]
        if kind == "pocketed":
            self.pocketed[event["balls"][0]] = event["pocket"]
        if kind in ("rest", "pocketed"):
            self._moving.difference_update(event["balls"])
        else:
            self._moving.update(event["balls"])
        if kind in ("ball_ball", "ball_rail") and event["approach_speed"] < SLIGHT:
            self._slight.append(event["time"])
            return []
        text = describe(event)
        lines = self.held_back() if text or self.finished else []
        return [*lines, self._line(event["time"], text)] if text else lines

    def held_back(self) -> list[str]:
        """The line of the slight contacts that are not told yet, if there are any."""
        times, self._slight = self._slight, []
        if not times:
            return []
        text = f"1 contact below {SLIGHT:g} m/s"
        if len(times) > 1:
            text = f"{len(times)} contacts below {SLIGHT:g} m/s within {times[-1] - times[0]:.4f} s"
        return [self._line(times[0], text)]

    def _line(self, time: float, text: str) -> str:
        return f"  {time - self.first_time:7.4f} s  {text}"


def describe(event: dict[str, Any]) -> str:
    """A collision, a ball that falls or a shot in words; nothing for the end of slip or of motion."""
    balls = event["balls"]
    if event["kind"] == "shot":
        return f"the cue hits ball {balls[0]} with {event['impulse']:.3g} N s"
    if event["kind"] == "ball_ball":
        return f"ball {balls[0]} and ball {balls[1]} at {event['approach_speed']:.3g} m/s"
    if event["kind"] == "ball_rail":
        return f"ball {balls[0]} and rail {event['rail']} at {event['approach_speed']:.3g} m/s"
    if event["kind"] == "pocketed":
        return f"ball {balls[0]} falls into pocket {event['pocket']} at {event['approach_speed']:.3g} m/s"
    return ""
