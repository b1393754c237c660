# SPDX-License-Identifier: Apache-2.0
"""Recordings: any time of a run, with the bits of a simulation that was stopped there."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from checks import ROLLING, random_scene

import billiards_sim as bs
from billiards_sim.engine import recorder
from billiards_sim.engine import simulation as simulation_module
from billiards_sim.engine.record import CHORD

RADIUS = bs.Physics().radius
TABLE = bs.Table()


def broken_rack() -> bs.Simulation:
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.shoot(8.0, 0.01, 0.2, -0.3)
    return simulation


def pressed_row() -> bs.Simulation:
    """Balls in touch in a row at a rail, which spin presses together: sustained contacts in many short steps."""
    positions = [[0.6 + 2.0 * RADIUS * k, TABLE.y_min + RADIUS] for k in range(5)]
    spins = [[0.0, 0.0, 0.0], [0.0, 90.0, 5.0], [-40.0, 0.0, 0.0], [30.0, -90.0, 0.0], [0.0, 0.0, 60.0]]
    return bs.Simulation(bs.Scene(positions, angular_velocities=spins))


def on_their_way() -> bs.Simulation:
    simulation = bs.Simulation(random_scene(8))
    simulation.advance(0.4321)
    return simulation


def many_balls() -> bs.Simulation:
    return bs.Simulation(bs.scenes.random_balls(40, 3))


def late_break() -> bs.Simulation:
    """Long after the start: times of the table are rounded by 6e-11 s."""
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.advance(1e6 + 1.0 / 3.0)
    simulation.shoot(8.0, 0.01, 0.2, -0.3)
    simulation.advance(0.01)
    return simulation


def elastic_break() -> bs.Simulation:
    """Balls in touch go through a hundred arcs of some microseconds each; long after the start, too."""
    simulation = bs.Simulation(bs.scenes.eight_ball())
    simulation.advance(1e5 + 1.0 / 3.0)
    simulation.shoot(8.0, 0.01)
    return simulation


STARTS: tuple[Callable[[], bs.Simulation], ...] = (
    broken_rack,
    pressed_row,
    on_their_way,
    many_balls,
    late_break,
    elastic_break,
)


def instants(run: bs.Run, count: int = 60) -> Any:
    """Times of a run: the ends, some of its events and others at random, in order."""
    random = np.random.default_rng(5)
    events = [event.time for event in run.events]
    some = random.choice(events, min(count, len(events)), replace=False)
    return np.unique(np.concatenate(([run.start, run.end], some, random.uniform(run.start, run.end, count))))


@pytest.mark.parametrize("begin", STARTS)
def test_any_time_has_the_bits_of_a_simulation_stopped_there(begin: Callable[[], bs.Simulation]) -> None:
    simulation, stopped = begin(), begin()
    run = bs.record(simulation)
    times = instants(run)
    shuffled = np.random.default_rng(6).permutation(len(times))
    shown = [read(times[shuffled]) for read in (run.positions, run.velocities, run.angular_velocities)]
    for at in np.argsort(shuffled):
        stopped.run(until=times[shuffled[at]])
        for values, wanted in zip(shown, (stopped.positions, stopped.velocities, stopped.angular_velocities)):
            assert values[at].tobytes() == wanted.tobytes()


@pytest.mark.parametrize("begin", STARTS)
def test_recording_is_running(begin: Callable[[], bs.Simulation]) -> None:
    recorded, played = begin(), begin()
    for until in (recorded.time + 0.3, None):
        began = recorded.time
        run = bs.record(recorded, until)
        assert run.start == began
        assert list(run.events) == list(played.run(until))
        assert run.end == recorded.time == played.time
        assert recorded.positions.tobytes() == played.positions.tobytes()
        assert recorded.angular_velocities.tobytes() == played.angular_velocities.tobytes()
    assert recorded.at_rest


def test_a_run_that_nobody_records_writes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_module, "run_followed", lambda *_: pytest.fail("followed"))
    broken_rack().run()


def test_arcs_beyond_what_the_spool_holds_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = bs.record(broken_rack())
    monkeypatch.setattr(recorder, "SPOOL_ROWS", 1)
    pieces = bs.record(broken_rack())
    times = instants(whole)
    assert list(pieces.events) == list(whole.events)
    assert pieces.positions(times).tobytes() == whole.positions(times).tobytes()


@pytest.mark.parametrize("begin", [broken_rack, pressed_row])
def test_orientations_have_the_bits_of_a_simulation_that_tracks_them(begin: Callable[[], bs.Simulation]) -> None:
    def tracked() -> bs.Simulation:
        scene = dataclasses.replace(begin().start_scene, track_orientation=True)
        simulation = bs.Simulation(scene)
        if begin is broken_rack:
            simulation.shoot(8.0, 0.01, 0.2, -0.3)
        return simulation

    stopped = tracked()
    for run in (bs.record(begin()), bs.record(tracked())):
        times = instants(run, 30)
        shown = run.orientations(times)
        stopped = tracked()
        for at, time in enumerate(times.tolist()):
            stopped.run(until=time)
            assert shown[at].tobytes() == stopped.orientations.tobytes()
    assert np.abs(stopped.orientations[:, 3]).min() < 0.9


def test_orientations_go_on_from_where_a_tracked_simulation_is() -> None:
    scene = dataclasses.replace(random_scene(8), track_orientation=True)
    simulation, stopped = bs.Simulation(scene), bs.Simulation(scene)
    simulation.advance(0.4321)
    run = bs.record(simulation)
    times = instants(run, 20)
    shown = run.orientations(times)
    for at, time in enumerate(times.tolist()):
        stopped.run(until=time)
        assert shown[at] == pytest.approx(stopped.orientations, abs=1e-6 * (time - run.start) + 1e-15)


def test_a_ball_that_spins_on_the_spot_turns_from_the_start_of_the_recording() -> None:
    simulation = bs.Simulation(bs.Scene([[0.5, 0.5], [1.0, 0.5]], [[0.0, 0.0], [0.5, 0.0]], [[0, 0, 2.0], [0, 0, 0]]))
    simulation.advance(1.0)
    run = bs.record(simulation, until=1.75)
    assert run.orientations([1.0])[0, 0].tolist() == [0.0, 0.0, 0.0, 1.0]
    assert run.orientations([1.75])[0, 0] == pytest.approx([0.0, 0.0, math.sin(0.75), math.cos(0.75)], abs=1e-15)


@pytest.mark.parametrize("begin", STARTS)
def test_straight_lines_through_a_path_stay_near_the_ball_at_every_time(begin: Callable[[], bs.Simulation]) -> None:
    run = bs.record(begin())
    contacts = [event.time for event in run.events if event.kind == "ball_ball"][:20]
    close = np.clip(np.add.outer(contacts, np.linspace(-1e-3, 1e-3, 100)).ravel(), run.start, run.end)
    times = np.unique([*np.linspace(run.start, run.end, 20_000), *close])
    positions = run.positions(times)
    worst = 0.0
    for index, name in enumerate(run.scene.names):
        t, x, y = run.path(name).T
        assert t[0] == run.start
        assert (np.diff(t) > 0.0).all()
        drawn = np.column_stack((np.interp(times, t, x), np.interp(times, t, y)))
        worst = max(worst, float(np.hypot(*(drawn - positions[:, index]).T).max()))
        own = {event.time for event in run.events if name in event.balls}
        assert own <= set(t.tolist())
        assert run.positions(t)[:, index].tobytes() == np.column_stack((x, y)).tobytes()
    assert 0.5 * CHORD < worst <= CHORD * (1.0 + 1e-9)


@pytest.mark.parametrize("begin", STARTS)
def test_arcs_give_the_bits_of_positions(begin: Callable[[], bs.Simulation]) -> None:
    run = bs.record(begin())
    times = instants(run)
    shown = run.positions(times)
    for index, name in enumerate(run.scene.names):
        arcs = run.arcs(name)
        assert (np.diff(arcs[:, 0]) >= 0.0).all()
        for at, time in enumerate(times.tolist()):
            t, *parts = arcs[np.searchsorted(arcs[:, 0], time, side="right") - 1].tolist()
            (x, y, vx, vy, ax, ay), age = parts[:6], time - t
            place = [
                (vx + 0.5 * ax * age) * age + x + run.scene.table.centre[0],
                (vy + 0.5 * ay * age) * age + y + run.scene.table.centre[1],
            ]
            if run.start == 0.0:
                assert place == shown[at, index].tolist()
            else:  # on the clock of the table, which is coarser: two roundings at no more than 10 m/s
                assert place == pytest.approx(shown[at, index].tolist(), abs=20.0 * math.ulp(run.end))


def test_a_ball_that_is_not_in_play_has_no_arcs() -> None:
    scene = bs.Scene([[0.5, 0.5], [1.0, 0.5]], [[1.0, 0.0], [0.0, 0.0]], in_play=[True, False])
    run = bs.record(bs.Simulation(scene))
    assert run.arcs("1").shape == (0, 13)
    assert len(run.arcs("cue")) > 1
    with pytest.raises(ValueError, match="no ball is named '2'"):
        run.arcs("2")


def test_a_path_has_no_more_points_than_its_curve_needs() -> None:
    roll, spin = 1.0, 1.0 / RADIUS
    run = bs.record(
        bs.Simulation(bs.Scene([[0.3, 0.5], [0.5, 1.0]], [[roll, 0.0], [0.0, 0.0]], [[0, spin, 0], [0] * 3]))
    )
    (first, *_) = run.events
    # of a parabola with the acceleration a, a piece of the duration d bends by a/2 (d/2)^2
    pieces = math.ceil(first.time / math.sqrt(8.0 * CHORD / ROLLING))
    assert int(np.sum(run.path("cue")[:, 0] <= first.time)) == pieces + 1
    assert run.path("1").tolist() == [[0.0, 0.5, 1.0]]


def test_the_path_of_a_ball_in_touch_with_another_has_fewer_points_than_arcs() -> None:
    run = bs.record(elastic_break())
    points, arcs = (sum(len(of(name)) for name in run.scene.names) for of in (run.path, run.arcs))
    assert points < arcs
    assert arcs > 1000


def test_without_friction_a_path_has_its_corners_alone() -> None:
    physics = bs.Physics(sliding_friction=0.0, rolling_friction=0.0)
    run = bs.record(bs.Simulation(bs.Scene([[1.0, 0.5]], [[2.0, 0.7]], physics=physics)), until=5.0)
    path = run.path("cue")
    assert path[:, 0].tolist() == [0.0, *(event.time for event in run.events), 5.0]
    assert len(path) > 6


def test_a_ball_that_waits_is_where_it_waits_until_it_is_hit() -> None:
    run = bs.record(bs.Simulation(bs.scenes.head_on()))
    hit = next(event.time for event in run.events if event.kind == "ball_ball")
    path = run.path("1")
    assert path[:2].tolist() == [[0.0, 1.0, 0.5], [hit, *path[1, 1:].tolist()]]
    assert path[1, 1:] == pytest.approx([1.0, 0.5], abs=1e-15)
    assert path[-1, 0] == [event.time for event in run.events if event.kind == "rest" and "1" in event.balls][-1]


def test_a_recording_of_rest_is_one_instant() -> None:
    simulation = bs.Simulation(bs.scenes.rack())
    run = bs.record(simulation)
    assert (run.start, run.end, len(run.events)) == (0.0, 0.0, 0)
    assert run.positions([0.0])[0].tobytes() == simulation.positions.tobytes()
    assert run.path("8").shape == (1, 3)
    assert run.positions([]).shape == (0, 16, 2)


@pytest.mark.parametrize("bad", [-1e-9, 2.1, math.nan, math.inf])
def test_a_time_outside_of_the_run_is_refused(bad: float) -> None:
    run = bs.record(bs.Simulation(bs.scenes.head_on()), until=2.0)
    for read in (run.positions, run.velocities, run.angular_velocities, run.orientations):
        with pytest.raises(ValueError, match="times must lie in the run, 0 to 2 s, got"):
            read([1.0, bad])


@pytest.mark.parametrize("bad", [1.0, [[1.0]]])
def test_times_of_another_shape_are_refused(bad: Any) -> None:
    run = bs.record(bs.Simulation(bs.scenes.head_on()), until=2.0)
    with pytest.raises(ValueError, match=r"times must have shape \(T,\), got"):
        run.positions(bad)


@pytest.mark.parametrize("bad", [[True], ["1"], [1j], [[0.5], [0.5, 1.0]], "1"])
def test_times_that_are_no_numbers_are_refused(bad: Any) -> None:
    run = bs.record(bs.Simulation(bs.scenes.head_on()), until=2.0)
    with pytest.raises(ValueError, match=r"times must be numbers of shape \(T,\), got .*\Z"):
        run.positions(bad)


def test_a_path_of_nobody_is_refused() -> None:
    run = bs.record(bs.Simulation(bs.scenes.head_on()), until=2.0)
    with pytest.raises(ValueError, match="no ball is named '2'; the balls are cue, 1"):
        run.path("2")


def test_a_recording_that_cannot_end_is_refused_and_changes_nothing() -> None:
    physics = bs.Physics(rolling_friction=0.0)
    simulation = bs.Simulation(bs.Scene([[1.0, 0.5]], [[2.0, 0.7]], physics=physics))
    with pytest.raises(ValueError, match="give a time `until`"):
        bs.record(simulation)
    with pytest.raises(ValueError, match="until must be"):
        bs.record(simulation, until=-1.0)
    assert simulation.time == 0.0
    assert len(bs.record(simulation, until=1.0).events) > 0
