# SPDX-License-Identifier: Apache-2.0
"""Ticks by a clock that somebody else moves, as with `use_sim_time`."""

from __future__ import annotations


class FollowedClock:
    """Says when a tick is due: whenever the clock has passed a multiple of the period since the last one."""

    def __init__(self) -> None:
        self._last: int | None = None  # ns, what the clock showed at the last tick

    def due(self, now: int, period: int) -> bool:
        """Whether there is something to do at this reading. A clock at 0 has not been set yet.

        Args:
            now: what the clock shows, ns.
            period: of the ticks, ns.
        """
        if self._last is None:
            return now > 0
        return now < self._last or now // period > self._last // period

    def tick(self, now: int) -> int | None:
        """ns since the last tick, negative where the clock has gone back; None at its first reading."""
        last, self._last = self._last, now if now > 0 else None
        return None if last is None else now - last
