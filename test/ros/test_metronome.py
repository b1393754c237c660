# SPDX-License-Identifier: Apache-2.0
"""The metronome, by events: nothing here waits for a time that a busy machine may not keep."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from billiards_sim.ros import metronome
from billiards_sim.ros.metronome import Metronome

TIMEOUT = 20.0
"""s"""


class Counter:
    """A beat that counts, and tells when it has come to a number."""

    def __init__(self, enough: int) -> None:
        self.times: list[float] = []
        self.reached = threading.Event()
        self._enough = enough

    def __call__(self) -> None:
        self.times.append(time.monotonic())
        if len(self.times) >= self._enough:
            self.reached.set()


def fail(error: Exception) -> None:
    raise AssertionError from error


@contextmanager
def beating(one: Metronome, fail: Callable[[Exception], None] = fail) -> Iterator[None]:
    one.start(fail)
    try:
        yield
    finally:
        one.stop()


def test_beats_do_not_come_before_they_are_due() -> None:
    count = Counter(10)
    one = Metronome(count, threading.RLock())
    began = time.monotonic()
    one.set_rate(200.0)
    with beating(one):
        assert count.reached.wait(TIMEOUT)
    assert all(at >= began + 0.005 * number for number, at in enumerate(count.times, start=1))


def test_no_beat_comes_after_stop() -> None:
    count = Counter(3)
    one = Metronome(count, threading.RLock())
    one.set_rate(1000.0)
    with beating(one):
        assert count.reached.wait(TIMEOUT)
    assert "metronome" not in {thread.name for thread in threading.enumerate()}
    Metronome(count, threading.RLock()).stop()  # nor does one that never began


def test_a_new_rate_does_not_wait_for_the_beat_before() -> None:
    count = Counter(5)
    one = Metronome(count, threading.RLock())
    one.set_rate(0.001)
    with beating(one):
        one.set_rate(1000.0)
        assert count.reached.wait(TIMEOUT)


def test_without_a_rate_nothing_beats_and_it_stops() -> None:
    count = Counter(1)
    with beating(Metronome(count, threading.RLock())):
        pass
    assert count.times == []


def test_beats_wait_for_the_lock_and_others_get_it_between_beats_that_take_too_long() -> None:
    lock = threading.RLock()
    count = Counter(3)

    def slow() -> None:
        count()
        time.sleep(0.002)  # longer than the period: the metronome is always late

    one = Metronome(slow, lock)
    one.set_rate(1000.0)
    with beating(one):
        assert count.reached.wait(TIMEOUT)
        for _ in range(20):
            assert lock.acquire(timeout=TIMEOUT)
            held = len(count.times)
            time.sleep(0.003)
            assert len(count.times) == held
            lock.release()


def test_a_short_delay_is_made_up_for_and_a_long_one_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    period = 0.005
    clock = [0.0]
    beats: list[float] = []

    def wait(_: object, timeout: float) -> bool:
        clock[0] += timeout
        return False

    def beat() -> None:
        beats.append(clock[0])
        clock[0] += {3: 2.5 * period, 10: 1.0}.get(len(beats), 0.0)

    monkeypatch.setattr(metronome.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(metronome.threading.Condition, "wait", wait)
    one = Metronome(beat, threading.RLock())
    one.set_rate(1.0 / period)
    assert one.lost == 0.0
    while len(beats) < 30:
        one._wait_or_beat()
    on_time = [number * period for number in range(1, 31)]
    assert beats[:3] == pytest.approx(on_time[:3])
    assert beats[5:10] == pytest.approx(on_time[5:10])  # after a burst
    late = beats[10] - metronome.LONGEST_DELAY
    assert one.lost == pytest.approx(late - on_time[11])
    assert late > 1.0
    assert beats[20:] == pytest.approx([late + number * period for number in range(9, 19)])


def test_an_error_of_a_beat_is_told_and_ends_the_beats() -> None:
    told: list[Exception] = []
    done = threading.Event()

    def tell(error: Exception) -> None:
        told.append(error)
        done.set()

    def beat() -> None:
        raise ZeroDivisionError("once")

    one = Metronome(beat, threading.RLock())
    one.set_rate(1000.0)
    with beating(one, tell):
        assert done.wait(TIMEOUT)
    assert [str(error) for error in told] == ["once"]
