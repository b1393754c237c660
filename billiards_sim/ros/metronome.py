# SPDX-License-Identifier: Apache-2.0
"""Ticks at a steady rate, without the cost of an executor's timer."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

LONGEST_DELAY = 0.02
"""s. Beats that are later are left out: the rate holds where a machine hiccups, and nothing comes in a long burst."""

BREATH = 1e-4
"""s that the lock is free between two beats at least, for others to take it where the beats fill all the time."""


class Metronome:
    """Calls a function at a rate, by the steady clock, on a thread of its own.

    An rclpy executor builds its wait set anew for every call of a timer, which takes longer than all else in a tick; a
    thread that sleeps costs a tenth of that. After a delay it makes up for what it missed, up to `LONGEST_DELAY`.

    Args:
        beat: what to call.
        lock: held during each call, and free while the metronome sleeps. Whoever else holds it is between two beats.

    Attributes:
        lost: s of beats that were left out since the start.
    """

    def __init__(self, beat: Callable[[], object], lock: Any) -> None:
        self._beat = beat
        self._changed = threading.Condition(lock)
        self._period = self._due = math.inf  # s; of the steady clock
        self._beats_since = math.inf  # s; when the beat under way was due, where that was told by `set_rate`
        self._rung = False
        self.lost = 0.0
        self._stopped = False
        self._thread: threading.Thread | None = None

    def set_rate(self, rate: float) -> None:
        """Beat at this rate, Hz: for the first time in a period from now, later in one from the last beat."""
        period = 1.0 / rate
        with self._changed:
            now = time.monotonic()
            self._due = now + period if math.isinf(self._period) else max(self._due - self._period + period, now)
            self._period = period
            self._changed.notify()

    def late(self) -> float:
        """s since the beat under way was due; 0 where it was rung, and between beats."""
        return max(time.monotonic() - self._beats_since, 0.0)

    def ring(self) -> None:
        """Beat as soon as the lock is free, beside the regular beats."""
        with self._changed:
            self._rung = True
            self._changed.notify()

    def start(self, fail: Callable[[Exception], object]) -> None:
        """Args:
        fail: told of an exception of the beat, on the metronome's thread, which then ends.
        """
        self._due = time.monotonic() + self._period
        self._thread = threading.Thread(target=self._run, args=(fail,), name="metronome", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """No beat comes after this. The caller does not hold the lock."""
        with self._changed:
            self._stopped = True
            self._changed.notify()
        if self._thread is not None:
            self._thread.join()

    def _run(self, fail: Callable[[Exception], object]) -> None:
        try:
            with self._changed:
                while not self._stopped:
                    self._wait_or_beat()
        except Exception as error:
            fail(error)

    def _wait_or_beat(self) -> None:
        wait = BREATH if self._rung else max(self._due - time.monotonic(), BREATH)
        self._changed.wait(min(wait, threading.TIMEOUT_MAX))
        now = time.monotonic()
        if self._stopped:
            return
        if self._rung:
            self._rung = False
            self._beat()
            return
        if now < self._due:
            return
        left_out = max(now - LONGEST_DELAY - (self._due + self._period), 0.0)
        self.lost += left_out
        self._beats_since = self._due + left_out
        self._due = self._beats_since + self._period
        self._beat()
        self._beats_since = math.inf
