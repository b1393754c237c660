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


class Rehearsal:
    """A metronome whose time is that of its own waiting."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 100.0
        self.beats: list[float] = []
        self.metronome = Metronome(lambda: self.beats.append(self.now), threading.RLock())
        monkeypatch.setattr(metronome.time, "monotonic", lambda: self.now)
        monkeypatch.setattr(metronome.threading.Condition, "wait", lambda _, timeout: self._wait(timeout))
        self._end = 0.0

    def _wait(self, timeout: float) -> bool:
        self.now = min(self.now + timeout, self._end)
        return False

    def play(self, until: float) -> None:
        self._end = until
        while self.now < until:
            self.metronome._wait_or_beat()


@pytest.fixture
def rehearsal(monkeypatch: pytest.MonkeyPatch) -> Rehearsal:
    return Rehearsal(monkeypatch)


def test_a_rate_that_is_set_again_and_again_does_not_move_the_beat(rehearsal: Rehearsal) -> None:
    for number in range(500):
        rehearsal.metronome.set_rate(1.0)
        rehearsal.play(100.0 + (number + 1) / 130.0)
    assert rehearsal.beats == pytest.approx([101.0, 102.0, 103.0])


def test_a_new_rate_counts_from_the_last_beat(rehearsal: Rehearsal) -> None:
    rehearsal.metronome.set_rate(1.0)
    rehearsal.play(101.5)
    rehearsal.metronome.set_rate(0.5)
    rehearsal.play(104.5)
    assert rehearsal.beats == pytest.approx([101.0, 103.0])
    rehearsal.metronome.set_rate(100.0)  # long due: one beat now, and none of those that might have been
    rehearsal.play(104.525)
    assert rehearsal.beats == pytest.approx([101.0, 103.0, 104.5, 104.51, 104.52], abs=2.0 * metronome.BREATH)
    assert rehearsal.metronome.lost == 0.0


def test_rates_that_alternate_leave_the_beats_between_theirs(rehearsal: Rehearsal) -> None:
    for number in range(260):
        rehearsal.metronome.set_rate((50.0, 100.0)[number % 2])
        rehearsal.play(100.0 + (number + 1) / 130.0)
    assert 100 <= len(rehearsal.beats) <= 200  # in 2 s


def test_a_ring_is_a_beat_beside_the_others(rehearsal: Rehearsal) -> None:
    rehearsal.metronome.set_rate(1.0)
    rehearsal.play(100.25)
    rehearsal.metronome.ring()
    rehearsal.play(102.5)
    assert rehearsal.beats == pytest.approx([100.25, 101.0, 102.0], abs=2.0 * metronome.BREATH)


def test_a_beat_knows_how_late_it_is(rehearsal: Rehearsal) -> None:
    late: list[float] = []
    rehearsal.metronome._beat = lambda: late.append(rehearsal.metronome.late())
    rehearsal.metronome.set_rate(10.0)
    rehearsal.play(100.105)
    rehearsal.now += 0.105  # two beats later, of which one was due before
    rehearsal.play(100.25)
    rehearsal.metronome.ring()
    rehearsal.play(100.26)
    rehearsal.now += 60.0  # a long delay is not made up for: the beats that are left out do not count
    rehearsal.play(160.27)
    on_time, delayed, rung, left_out = late[0], late[1], late[2], late[3]
    assert (on_time, delayed, rung) == pytest.approx((0.0, 0.01, 0.0), abs=2.0 * metronome.BREATH)
    assert left_out <= metronome.LONGEST_DELAY + 0.1 + 2.0 * metronome.BREATH
    assert rehearsal.metronome.late() == 0.0


def test_a_ring_wakes_a_metronome_that_sleeps() -> None:
    count = Counter(2)
    one = Metronome(count, threading.RLock())
    with beating(one):
        for number in (1, 2):
            one.ring()
            deadline = time.monotonic() + TIMEOUT
            while len(count.times) < number and time.monotonic() < deadline:
                time.sleep(0.001)
        assert count.reached.is_set()


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
