# SPDX-License-Identifier: Apache-2.0
"""Exceptions from signal handlers, which may come at any time, and calls that give way: no event and no bit is lost."""

from __future__ import annotations

import contextlib
import dis
import itertools
import pickle
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np
import pytest
from checks import COMPILED, random_scene

import billiards_sim as bs
from billiards_sim.engine import machine
from billiards_sim.engine import simulation as simulation_module
from billiards_sim.engine.tables import get_field

RADIUS = bs.Physics().radius
TABLE = bs.Table()
ENGINE = str(Path(simulation_module.__file__).parent)


def broken_rack() -> bs.Simulation:
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.advance(0.25)
    simulation.strike((128.0, 1.5, 0.0), (0.002, 0.004))
    return simulation


def dense_cluster() -> bs.Simulation:
    """Touching balls at a rail, struck and spun: impacts solved together and sustained contacts."""
    pitch = 2.0 * RADIUS * (1.0 + 1e-15)
    length = 5 if COMPILED else 2
    row = [[0.6 + pitch * k, TABLE.y_min + RADIUS] for k in range(length)]
    next_row = [[0.6 + pitch * (k + 0.5), TABLE.y_min + RADIUS + pitch * 0.75**0.5] for k in range(length - 1)]
    spins = np.zeros((2 * length, 3))
    spins[:-1, 0] = 30.0 * np.arange(2 * length - 1)
    spins[:-1, 1] = 80.0 * (-1.0) ** np.arange(2 * length - 1)
    simulation = bs.Simulation(bs.Scene([[0.9, 0.6], *row, *next_row], angular_velocities=np.roll(spins, 1, axis=0)))
    simulation.strike((-25.0, -50.0, 0.0))
    return simulation


def elastic_rack() -> bs.Simulation:
    """A moment before the cue ball meets a rack whose contacts take time."""
    count = 16 if COMPILED else 4
    simulation = bs.Simulation(bs.Scene(bs.scenes.rack().positions[:count], physics=bs.Physics.pool()))
    simulation.shoot(8.0, 0.002)
    hit = next(event.time for event in simulation.copy().run() if event.kind == "ball_ball")
    simulation.run(until=hit - 1e-3)
    return simulation


def touching_rack() -> bs.Simulation:
    """Without friction nothing presses: one cluster of impacts."""
    simulation = bs.Simulation(bs.scenes.rack(0.0, physics=bs.Physics(sliding_friction=0.0)))
    simulation.strike((128.0, 1.5, 0.0))
    return simulation


def pressed_row() -> bs.Simulation:
    """Balls that spin presses together at a rail."""
    positions = [[0.6 + 2.0 * RADIUS * k, TABLE.y_min + RADIUS] for k in range(6)]
    spins = [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [294.0, -95.0, 0.0], [71.0, 1.0, 0.0], [300.0, -12.0, 0.0], [0.0] * 3]
    return bs.Simulation(bs.Scene(positions, angular_velocities=spins))


def two_balls() -> bs.Simulation:
    simulation = bs.Simulation(bs.scenes.glancing())
    simulation.advance(0.1)
    return simulation


def outcome(simulation: bs.Simulation, events: list[bs.Event]) -> tuple[Any, ...]:
    arrays = (simulation.positions, simulation.velocities, simulation.angular_velocities)
    return events, simulation.time, [values.tobytes() for values in arrays]


class Interrupted(Exception):
    """What a handler raises."""


CALLS: set[CodeType] = {bs.Simulation.run.__code__, bs.Simulation.advance.__code__}


def is_in_a_call(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code in CALLS:
            return True
        frame = frame.f_back
    return False


@pytest.fixture
def alarm() -> Iterator[Callable[[float, type[BaseException]], None]]:
    """Arms a timer that raises once, in the midst of a `run` or an `advance`."""

    def arm(delay: float, kind: type[BaseException]) -> None:
        def raise_within(_: int, frame: FrameType | None) -> None:
            if is_in_a_call(frame):
                raise kind

        signal.signal(signal.SIGALRM, raise_within)
        signal.setitimer(signal.ITIMER_REAL, delay)

    before = signal.getsignal(signal.SIGALRM)
    yield arm
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize("pieces", [False, True], ids=["run", "advance"])
@pytest.mark.parametrize("begin", [broken_rack, dense_cluster, elastic_rack])
def test_interrupted_runs_end_as_those_that_were_not(
    begin: Callable[[], bs.Simulation],
    pieces: bool,
    alarm: Callable[[float, type[BaseException]], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = begin()
    expected = outcome(whole, list(whole.run()))
    monkeypatch.setattr(
        simulation_module, "BATCH", 100 if COMPILED else 1000
    )  # many steps of Python between those of the kernels
    start = begin()

    def play(simulation: bs.Simulation, events: list[bs.Event]) -> None:
        while pieces and not simulation.at_rest:
            events.extend(simulation.advance(0.05))
        events.extend(simulation.run())

    began = time.perf_counter()
    play(start.copy(), [])
    duration = time.perf_counter() - began
    random = np.random.default_rng(1)
    interrupts = 0
    for attempt in range(3000):
        simulation, events = start.copy(), []
        kind = (KeyboardInterrupt, Interrupted)[attempt % 2]
        for delay in random.uniform(1e-6, duration, 2):
            alarm(delay, kind)
            try:
                play(simulation, events)
            except kind:
                interrupts += 1
                assert simulation.time >= (events[-1].time if events else 0.25 * (begin is broken_rack))
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        play(simulation, events)
        if pieces:  # the clock goes on to the end of a piece
            assert simulation.at_rest
            assert outcome(simulation, events)[::2] == expected[::2]
        else:
            assert outcome(simulation, events) == expected
        if interrupts >= (200 if COMPILED else 50):
            return
    pytest.fail(f"only {interrupts} interrupts")


HEARD = ("CALL", "PRECALL", "RESUME", "JUMP_BACKWARD", "JUMP_ABSOLUTE", "POP_JUMP_BACKWARD", "POP_JUMP_IF")
"""Instructions after which CPython hears signals."""


class Interrupter:
    """Counts the places, within the engine, where CPython would hear a signal, and raises at one of them."""

    def __init__(self, place: float) -> None:
        self.place = place
        self.places = 0

    def __enter__(self) -> Interrupter:
        sys.settrace(self._enter)
        return self

    def __exit__(self, *_: object) -> None:
        sys.settrace(None)

    def _enter(self, frame: FrameType, _: str, __: object) -> Callable[..., Any] | None:
        if not frame.f_code.co_filename.startswith(ENGINE):
            return None
        frame.f_trace_opcodes = True
        last = "RESUME"

        def look(frame: FrameType, event: str, _: object) -> Callable[..., Any]:
            nonlocal last
            if event == "opcode":
                if last.startswith(HEARD):
                    self.places += 1
                    if self.places > self.place:
                        self.place = float("inf")
                        raise Interrupted
                last = _instructions(frame.f_code).get(frame.f_lasti, "")
            return look

        return look


def _instructions(code: CodeType, known: dict[CodeType, dict[int, str]] = {}) -> dict[int, str]:  # noqa: B006
    if code not in known:
        known[code] = {step.offset: step.opname for step in dis.get_instructions(code)}
    return known[code]


@pytest.mark.parametrize("begin", [two_balls, dense_cluster])
@pytest.mark.parametrize("call", ["run", "advance", "budget"])
def test_no_place_for_an_exception_loses_an_event(
    begin: Callable[[], bs.Simulation], call: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    duration = 4.0 if begin is two_balls else 0.02 if COMPILED else 0.004
    monkeypatch.setattr(simulation_module, "BATCH", 40 if begin is two_balls else 1000)
    calls: dict[str, Callable[[bs.Simulation], Any]] = {
        "run": lambda simulation: simulation.run(until=start.time + duration),
        "advance": lambda simulation: simulation.advance(duration),
        "budget": lambda simulation: simulation.advance(duration, budget=0.0),
    }
    start = begin()
    whole = start.copy()
    expected = outcome(whole, list(whole.run(until=start.time + duration)))
    assert len(expected[0]) > 2
    simulation = start.copy()
    with Interrupter(float("inf")) as counter:
        calls[call](simulation)
    tries = 200 if COMPILED else 20
    for place in range(0, counter.places, max(1, counter.places // tries)):
        simulation, events = start.copy(), []
        with pytest.raises(Interrupted), Interrupter(place):
            calls[call](simulation)
        events.extend(simulation.advance(0.0))
        events.extend(simulation.run(until=start.time + duration))
        assert outcome(simulation, events) == expected


@pytest.mark.skipif(not COMPILED, reason="needs Numba, switched on")
@pytest.mark.parametrize("recorded", [False, True], ids=["run", "recorded"])
def test_no_place_for_an_exception_loses_an_event_at_the_change_over(
    recorded: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = two_balls()
    whole = start.copy()
    expected = outcome(whole, list(whole.run()))
    monkeypatch.setattr(simulation_module, "BATCH", 40)

    def play(simulation: bs.Simulation) -> Sequence[bs.Event]:
        # Machine code appears, and goes as if in another process, at every call.
        ready = itertools.cycle((False, True))
        monkeypatch.setattr(machine, "is_ready", lambda: next(ready))
        return bs.record(simulation).events if recorded else simulation.run()

    with Interrupter(float("inf")) as counter:
        play(start.copy())
    step = max(1, counter.places // 200)
    # Once what can be remembered is remembered there are fewer places: nothing comes at the last ones.
    for place in range(0, counter.places - step, step):
        simulation, events = start.copy(), []
        with contextlib.suppress(Interrupted), Interrupter(place):
            play(simulation)
            assert place > 0.9 * counter.places
            continue
        events.extend(simulation.advance(0.0))
        events.extend(play(simulation))
        assert outcome(simulation, events) == expected


@pytest.mark.parametrize("kind", ["copy", "snapshot", "strike", "pickle"])
def test_events_that_an_interrupted_call_left_behind_are_kept(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    call = machine.call

    def interrupted(*given: Any) -> int:
        call(*given)
        raise Interrupted

    start = bs.Simulation(bs.Scene([[0.5, 0.6], [2.0, 0.9]]))
    start.strike((20.0, 3.0, 0.0))
    whole = start.copy()
    expected = list(whole.run(until=0.5))
    simulation = start.copy()
    with monkeypatch.context() as patch, pytest.raises(Interrupted):
        patch.setattr(machine, "call", interrupted)
        simulation.run(until=0.5)
    if kind == "copy":
        simulation = simulation.copy()
    elif kind == "pickle":
        simulation = pickle.loads(pickle.dumps(simulation))
    elif kind == "snapshot":
        snapshot = simulation.snapshot()
        simulation.run()
        simulation.restore(snapshot)
    else:
        simulation.strike((10.0, 0.0, 0.0), ball="1")
    events = list(simulation.run(until=0.5))
    assert [event for event in events if "cue" in event.balls] == expected
    assert len(expected) > 1
    assert simulation.positions[0].tobytes() == whole.positions[0].tobytes()


@pytest.mark.parametrize("begin", [two_balls, broken_rack, dense_cluster, elastic_rack])
def test_calls_that_give_way_lead_to_the_same_end(
    begin: Callable[[], bs.Simulation], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = begin()
    expected = outcome(whole, list(whole.run()))
    monkeypatch.setattr(simulation_module, "BATCH", 100)
    sliced, events, calls = begin(), [], 0
    while not sliced.at_rest:
        before = sliced.time
        target = before + 0.5
        new = sliced.run(until=target, budget=0.0) if calls % 2 else sliced.advance(target - before, budget=0.0)
        assert before <= sliced.time <= target
        assert all(event.time <= sliced.time for event in new)
        events.extend(new)
        calls += 1
    assert calls > 10
    sliced.run()
    assert outcome(sliced, events)[::2] == expected[::2]


def test_a_call_with_time_enough_does_not_give_way() -> None:
    plain, bounded = bs.Simulation(random_scene(3)), bs.Simulation(random_scene(3))
    assert list(bounded.advance(0.7, budget=1e6)) == list(plain.advance(0.7))
    assert bounded.time == plain.time == 0.7
    assert list(bounded.run(budget=1e6)) == list(plain.run())
    assert bounded.at_rest


@pytest.mark.parametrize("budget", [-1e-9, float("nan"), float("inf"), True, "1", 1j])
def test_bad_budget_is_refused(budget: Any) -> None:
    simulation = bs.Simulation(bs.scenes.head_on())
    for call in (lambda: simulation.advance(0.1, budget=budget), lambda: simulation.run(budget=budget)):
        with pytest.raises(ValueError, match="budget must be a finite number >= 0"):
            call()
    assert simulation.time == 0.0


def test_an_interrupted_recording_leaves_all_to_be_recorded_again() -> None:
    start = bs.Simulation(bs.scenes.glancing())
    whole = bs.record(start.copy())
    simulation = start.copy()
    with Interrupter(float("inf")) as counter:
        bs.record(simulation)
    for place in range(0, counter.places, max(1, counter.places // 50)):
        simulation = start.copy()
        with pytest.raises(Interrupted), Interrupter(place):
            bs.record(simulation)
        again = bs.record(simulation)
        assert (again.start, again.end, list(again.events)) == (whole.start, whole.end, list(whole.events))
        assert again.positions([0.5, 1.5]).tobytes() == whole.positions([0.5, 1.5]).tobytes()


@pytest.mark.parametrize("begin", [touching_rack, dense_cluster])
def test_a_call_of_the_kernels_ends_after_the_work_it_is_allowed(
    begin: Callable[[], bs.Simulation], monkeypatch: pytest.MonkeyPatch
) -> None:
    # But for its last pass. So signals are heard however dense a cluster is.
    done = []
    call = machine.call

    def measured(entry: Any, state: Any, *given: Any) -> Any:
        before = get_field(state.clock, 0, "work")
        status = call(entry, state, *given)
        done.append(get_field(state.clock, 0, "work") - before)
        return status

    simulation = begin()
    monkeypatch.setattr(machine, "call", measured)
    monkeypatch.setattr(simulation_module, "BATCH", 1)
    simulation.run(until=1.0)
    largest_pass = max(done)
    # A pass predicts each ball with each other at most, and leaves a cell; what is much more are sweeps over contacts.
    assert largest_pass > 2 * len(simulation.start_scene) ** 2
    done.clear()
    monkeypatch.setattr(machine, "call", call)
    simulation = begin()
    monkeypatch.setattr(machine, "call", measured)
    monkeypatch.setattr(simulation_module, "BATCH", 200)
    simulation.run(until=1.0)
    assert len(done) > 3
    assert max(done) < 200 + largest_pass
