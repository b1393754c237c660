# SPDX-License-Identifier: Apache-2.0
"""The simulation as its users see it: time, events, errors, determinism; and the laws of impact."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checks import COMPILED, extremes, random_scene
from hypothesis import given, settings
from hypothesis import strategies as st

import billiards_sim as bs
from billiards_sim.engine import simulation as simulation_module

RADIUS = bs.Physics().radius
TABLE = bs.Table()


def break_shot(simulation: bs.Simulation) -> None:
    simulation.strike((128.0, 0.0, 0.0))


def test_advance_in_pieces_gives_the_bits_of_one_run() -> None:
    whole = bs.Simulation(bs.scenes.rack())
    break_shot(whole)
    events = whole.run()
    pieces = bs.Simulation(bs.scenes.rack())
    break_shot(pieces)
    collected = []
    while not pieces.at_rest:
        collected.extend(pieces.advance(0.01))
    assert collected == list(events)
    assert len(collected) > 100
    assert np.array_equal(pieces.positions, whole.positions)
    assert np.array_equal(pieces.angular_velocities, whole.angular_velocities)


@settings(max_examples=25)
@given(st.integers(0, 10_000), st.lists(st.floats(0.0, 1.0), max_size=8))
def test_any_cuts_give_the_bits_of_one_run(seed: int, cuts: list[float]) -> None:
    whole, pieces = bs.Simulation(random_scene(seed)), bs.Simulation(random_scene(seed))
    events = whole.run(until=8.0)
    collected = [event for cut in cuts for event in pieces.advance(cut)]
    collected.extend(pieces.run(until=8.0))
    assert collected == list(events)
    assert np.array_equal(pieces.positions, whole.positions)
    assert np.array_equal(pieces.velocities, whole.velocities)


def test_many_small_steps_end_where_one_step_does() -> None:
    steps, one = bs.Simulation(bs.scenes.glancing()), bs.Simulation(bs.scenes.glancing())
    for _ in range(1000):
        steps.advance(0.001)
    one.advance(1.0)
    assert steps.time == one.time == 1.0
    assert np.array_equal(steps.positions, one.positions)


def test_clock_stops_where_it_is_told() -> None:
    simulation = bs.Simulation(bs.scenes.head_on())
    simulation.advance(0.25)
    assert simulation.time == 0.25
    simulation.run(until=1.1)
    assert simulation.time == 1.1
    events = simulation.run()
    assert simulation.at_rest
    assert simulation.time == events[-1].time
    simulation.advance(1e6)
    assert simulation.time == events[-1].time + 1e6


NO_NUMBERS = (True, "1", 1j, np.array([1.0]))


@pytest.mark.parametrize("duration", [-1e-9, math.nan, math.inf, None, *NO_NUMBERS])
def test_bad_duration_is_refused(duration: Any) -> None:
    simulation = bs.Simulation(bs.scenes.head_on())
    with pytest.raises(ValueError, match="duration must be"):
        simulation.advance(duration)
    assert simulation.time == 0.0


@pytest.mark.parametrize("until", [0.4, math.nan, math.inf, *NO_NUMBERS])
def test_bad_until_is_refused(until: Any) -> None:
    simulation = bs.Simulation(bs.scenes.head_on())
    simulation.advance(0.5)
    with pytest.raises(ValueError, match="until must be a finite time >= now, 0.5 s"):
        simulation.run(until=until)
    assert simulation.time == 0.5


@pytest.mark.parametrize("friction", ["sliding_friction", "rolling_friction"])
def test_run_that_cannot_end_is_refused_unless_it_is_given_an_end(friction: str) -> None:
    scene = bs.Scene([[1.0, 0.5]], [[1.0, 0.3]], physics=bs.Physics(**{friction: 0.0}))
    simulation = bs.Simulation(scene)
    with pytest.raises(ValueError, match=f"never rest.*{friction} 0"):
        simulation.run()
    assert simulation.time == 0.0
    simulation.run(until=10.0)
    assert simulation.time == 10.0


def test_arrays_are_copies() -> None:
    simulation = bs.Simulation(bs.scenes.head_on())
    for name in ("positions", "velocities", "angular_velocities"):
        getattr(simulation, name)[:] = 7.0
    assert simulation.positions == pytest.approx(bs.scenes.head_on().positions, abs=1e-15)
    assert simulation.velocities.tolist() == [[5.0, 0.0], [0.0, 0.0]]


def test_kinetic_energy_is_linear_and_rotational() -> None:
    simulation = bs.Simulation(bs.Scene([[1.0, 0.5]], [[3.0, 4.0]], [[10.0, -20.0, 30.0]]))
    inertia = 0.4 * 0.16 * RADIUS**2
    assert simulation.kinetic_energy == pytest.approx(0.5 * 0.16 * 25.0 + 0.5 * inertia * 1400.0, rel=1e-15)


def test_events_are_a_sequence() -> None:
    simulation = bs.Simulation(bs.scenes.head_on())
    events = simulation.run()
    assert len(events) == 10
    assert events[0].kind == "ball_ball"
    assert events[-1] == list(events)[9]
    assert list(events[2:4]) == [events[2], events[3]]
    assert events[0] in events
    with pytest.raises(IndexError):
        events[10]
    assert list(events[:5] + events[5:]) == list(events)


def test_ball_ball_event_describes_the_impact() -> None:
    scene = bs.Scene([[1.0, 0.5], [1.5, 0.53]], [[2.0, 0.0], [0.0, 0.0]])
    simulation = bs.Simulation(scene)
    event = simulation.run()[0]
    assert (event.kind, event.balls, event.rail) == ("ball_ball", ("cue", "1"), None)
    before, after = bs.Simulation(scene), bs.Simulation(scene)
    before.run(until=event.time - 1e-9)
    after.run(until=event.time)
    positions = after.positions
    assert np.hypot(*(positions[0] - positions[1])) == pytest.approx(2.0 * RADIUS, abs=1e-15)
    assert event.point == pytest.approx(positions.mean(axis=0), abs=1e-15)
    normal = (positions[0] - positions[1]) / (2.0 * RADIUS)
    assert event.normal == pytest.approx(normal, abs=1e-14)
    approach = -float((before.velocities[0] - before.velocities[1]) @ normal)
    assert event.approach_speed == pytest.approx(approach, abs=1e-7)
    impulse = scene.physics.mass * (after.velocities[0] - before.velocities[0])
    assert event.impulse * normal == pytest.approx(impulse, abs=1e-8)
    assert np.array_equal(after.angular_velocities[1], [0.0, 0.0, 0.0])


@pytest.mark.parametrize(
    "velocity, rail, normal, point",
    [
        ((-2.0, 0.0), "x_min", (1.0, 0.0), (TABLE.x_min, 0.6)),
        ((2.0, 0.0), "x_max", (-1.0, 0.0), (TABLE.x_max, 0.6)),
        ((0.0, -2.0), "y_min", (0.0, 1.0), (1.2, TABLE.y_min)),
        ((0.0, 2.0), "y_max", (0.0, -1.0), (1.2, TABLE.y_max)),
    ],
)
def test_rail_event_describes_the_impact(velocity, rail, normal, point) -> None:
    scene = bs.Scene([[1.2, 0.6]], [velocity], physics=bs.Physics(sliding_friction=0.0))
    simulation = bs.Simulation(scene)
    event = simulation.run(until=1.0)[0]
    assert (event.kind, event.balls, event.rail, event.normal) == ("ball_rail", ("cue",), rail, normal)
    assert event.point == pytest.approx(point, abs=1e-15)
    assert event.approach_speed == 2.0
    assert event.impulse == pytest.approx(0.16 * 1.7 * 2.0, rel=1e-15)
    assert simulation.velocities[0] == pytest.approx(-0.7 * np.array(velocity), rel=1e-15)


def test_rail_leaves_spin_and_the_velocity_along_it() -> None:
    scene = bs.Scene([[2.0, 0.6]], [[3.0, 0.5]], [[5.0, 6.0, 7.0]], physics=bs.Physics(sliding_friction=0.0))
    simulation = bs.Simulation(scene)
    simulation.run(until=0.2)
    assert simulation.velocities[0] == pytest.approx([-2.1, 0.5], rel=1e-15)
    assert simulation.angular_velocities.tolist() == [[5.0, 6.0, 7.0]]


@pytest.mark.parametrize("speed", [1e-3, 1.0, 100.0, 1e8])
@pytest.mark.parametrize("aside", [0.0, 0.3, 0.9, 0.999])
def test_no_ball_is_tunnelled_through_at_any_speed(speed: float, aside: float) -> None:
    physics = bs.Physics(sliding_friction=0.0)
    positions = [[0.5, 0.6], [1.5, 0.6 + aside * 2.0 * RADIUS]]
    simulation = bs.Simulation(bs.Scene(positions, [[speed, 0.0], [0.0, 0.0]], physics=physics))
    travel = 1.0 - 2.0 * RADIUS * math.sqrt(1.0 - aside**2)
    event = simulation.run(until=1.2 * travel / speed)[0]
    assert event.kind == "ball_ball"
    assert event.time == pytest.approx(travel / speed, rel=1e-12)
    assert event.approach_speed == pytest.approx(speed * math.sqrt(1.0 - aside**2), rel=1e-9)


@pytest.mark.parametrize("speed", [1e-3, 1.0, 100.0, 1e8])
def test_no_rail_is_tunnelled_through_at_any_speed(speed: float) -> None:
    physics = bs.Physics(sliding_friction=0.0, rail_restitution=1.0)
    simulation = bs.Simulation(bs.Scene([[1.2, 0.6]], [[speed, 0.7 * speed]], physics=physics))
    length = TABLE.length - 2.0 * RADIUS
    events = simulation.run(until=20.0 * length / speed)
    assert sum(event.rail in ("x_min", "x_max") for event in events) == 20
    assert TABLE.x_min + RADIUS <= simulation.positions[0, 0] + 1e-12 <= TABLE.x_max - RADIUS + 2e-12


def test_touching_balls_at_rest_stay_where_they_are() -> None:
    simulation = bs.Simulation(bs.scenes.rack(gap=0.0))
    start = simulation.positions
    assert simulation.at_rest
    assert list(simulation.advance(10.0)) == []
    assert np.array_equal(simulation.positions, start)


def test_touching_ball_that_moves_away_or_along_collides_with_nobody() -> None:
    for velocity in ([-1.0, 0.0], [0.0, 1.0], [-1.0, 1.0]):
        simulation = bs.Simulation(bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS, 0.6]], [velocity, [0.0, 0.0]]))
        assert all(event.kind != "ball_ball" for event in simulation.run(until=0.1)), velocity


def test_touching_ball_that_approaches_collides_at_once() -> None:
    simulation = bs.Simulation(bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS, 0.6]], [[1.0, 1.0], [0.0, 0.0]]))
    event = simulation.advance(1e-15)[0]
    assert event.kind == "ball_ball"
    assert simulation.velocities == pytest.approx(np.array([[0.0, 1.0], [1.0, 0.0]]), abs=1e-14)


@pytest.mark.parametrize("overlap", [1e-16, 1e-12, 9e-10])
def test_overlap_within_the_tolerance_is_a_touch(overlap: float) -> None:
    away = bs.Simulation(bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS - overlap, 0.6]], [[-1.0, 0.0], [0.0, 0.0]]))
    assert all(event.kind != "ball_ball" for event in away.run(until=0.5))
    into = bs.Simulation(bs.Scene([[1.0, 0.6], [1.0 + 2.0 * RADIUS - overlap, 0.6]], [[1.0, 0.0], [0.0, 0.0]]))
    assert into.advance(1e-15)[0].kind == "ball_ball"


@settings(max_examples=60)
@given(st.integers(0, 10**6))
def test_impacts_keep_momentum_and_energy(seed: int) -> None:
    # On cloth without friction, the balls alone: momentum and energy only change at rails.
    base = random_scene(seed)
    physics = bs.Physics(sliding_friction=0.0, rolling_friction=0.0, rail_restitution=1.0)
    simulation = bs.Simulation(bs.Scene(base.positions, base.velocities, base.angular_velocities, physics=physics))
    energy = simulation.kinetic_energy
    momentum = simulation.velocities.sum(axis=0)
    for event in simulation.run(until=0.3):
        if event.kind == "ball_rail":
            momentum = momentum + event.impulse / physics.mass * np.array(event.normal)
    assert simulation.velocities.sum(axis=0) == pytest.approx(momentum, abs=1e-12)
    assert simulation.kinetic_energy == pytest.approx(energy, rel=1e-12)


def test_random_scenes_keep_the_laws_until_rest() -> None:
    for seed in range(1000 if COMPILED else 50):
        worst = extremes(random_scene(seed))
        assert worst.overlap <= 1e-9, seed
        assert worst.outside <= 1e-9, seed
        assert worst.energy_rise <= 1e-12, seed


def test_breaks_keep_the_laws_until_rest() -> None:
    for seed in range(100 if COMPILED else 8):
        random = np.random.default_rng(seed)
        angle, size = random.uniform(-0.02, 0.02), random.uniform(40.0, 200.0)
        side, up = random.uniform(-0.4, 0.4, 2) * RADIUS
        force = (size * math.cos(angle), size * math.sin(angle), 0.0)
        worst = extremes(bs.scenes.rack(), lambda simulation: simulation.strike(force, (side, up)))  # noqa: B023
        assert worst.overlap <= 1e-9, seed
        assert worst.outside <= 1e-9, seed
        assert worst.energy_rise <= 1e-12, seed


def test_head_on_break_is_the_same_on_every_run() -> None:
    runs = []
    for _ in range(2):
        simulation = bs.Simulation(bs.scenes.rack())
        break_shot(simulation)
        runs.append((list(simulation.run()), simulation.positions.tobytes()))
    assert runs[0] == runs[1]


def test_copy_goes_its_own_way_and_leaves_the_original() -> None:
    original = bs.Simulation(bs.scenes.rack())
    break_shot(original)
    original.advance(0.3)
    twin = original.copy()
    before = original.positions
    twin_events = twin.run()
    assert np.array_equal(original.positions, before)
    assert original.time == 0.3
    assert list(original.run()) == list(twin_events)
    assert np.array_equal(original.positions, twin.positions)


def test_scene_is_the_present_state() -> None:
    start = bs.scenes.rack()
    simulation = bs.Simulation(start)
    break_shot(simulation)
    simulation.advance(0.4)
    scene = simulation.scene()
    assert simulation.start_scene is start
    assert scene.positions.tolist() == simulation.positions.tolist() != start.positions.tolist()
    assert scene.velocities.tolist() == simulation.velocities.tolist()
    assert scene.angular_velocities.tolist() == simulation.angular_velocities.tolist()
    assert (scene.names, scene.table, scene.physics, scene.shot) == (start.names, start.table, start.physics, None)
    again = bs.Simulation(scene)
    again.advance(0.2)
    simulation.advance(0.2)
    assert again.positions == pytest.approx(simulation.positions, abs=1e-9)


def test_snapshot_is_restored_to_the_bit_as_often_as_wanted() -> None:
    simulation = bs.Simulation(bs.scenes.rack())
    start = simulation.snapshot()
    outcomes = []
    for force in (80.0, 128.0, 80.0):
        simulation.restore(start)
        assert simulation.time == 0.0
        assert simulation.at_rest
        simulation.strike((force, 1.0, 0.0))
        outcomes.append((list(simulation.run()), simulation.positions.tobytes()))
    assert outcomes[0] == outcomes[2] != outcomes[1]


def test_snapshot_keeps_a_shot_that_no_call_has_reported_yet() -> None:
    simulation = bs.Simulation(bs.scenes.rack())
    break_shot(simulation)
    assert simulation.copy().advance(0.01)[0].kind == "shot"
    assert simulation.advance(0.01)[0].kind == "shot"


def test_snapshot_of_another_scene_is_refused() -> None:
    with pytest.raises(ValueError, match="another scene"):
        bs.Simulation(bs.scenes.head_on()).restore(bs.Simulation(bs.scenes.glancing()).snapshot())


def test_stall_is_an_error_with_a_scene_file_that_leads_there_again(monkeypatch: pytest.MonkeyPatch) -> None:
    # With a budget of five steps the burst of impacts in a rack counts as a stall.
    monkeypatch.setattr(simulation_module, "BATCH", 1)
    monkeypatch.setattr(simulation_module, "EVENT_BUDGET", 5)
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.strike((80.0, 1.0, 0.0), (0.001, 0.002))
    with pytest.raises(bs.StallError, match="no progress.*reproduces it") as stall:
        simulation.run()
    assert simulation.time >= stall.value.events[-1].time > 0.1
    assert stall.value.path is not None
    scene = bs.load_scene(stall.value.path)
    Path(stall.value.path).unlink()
    assert scene.shot is not None
    again = bs.Simulation(scene)
    again.strike(scene.shot.force, scene.shot.offset, scene.shot.ball)
    with pytest.raises(bs.StallError) as repeated:
        again.run()
    Path(str(repeated.value.path)).unlink()
    assert list(repeated.value.events) == list(stall.value.events)
    assert np.array_equal(again.positions, simulation.positions)


def test_stall_without_a_shot_gives_the_scene_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_module, "BATCH", 1)
    monkeypatch.setattr(simulation_module, "EVENT_BUDGET", 5)
    rows = [[0.3 + (2.0 * RADIUS + 1e-4) * index, 0.6] for index in range(9)]
    scene = bs.Scene(rows, [[3.0, 0.0]] + [[0.0, 0.0]] * 8)
    with pytest.raises(bs.StallError) as stall:
        bs.Simulation(scene).run()
    Path(str(stall.value.path)).unlink()
    assert stall.value.scene is scene


def test_stall_tells_plain_times(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_module, "BATCH", 1)
    monkeypatch.setattr(simulation_module, "EVENT_BUDGET", 5)
    simulation = bs.Simulation(bs.scenes.rack())
    break_shot(simulation)
    with pytest.raises(
        bs.StallError, match=r"^no progress: 5 steps from \d\.\d+ to \d\.\d+ s since the last shot"
    ) as stall:
        simulation.run()
    Path(str(stall.value.path)).unlink()


def test_stall_is_noticed_across_calls_that_give_way(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulation_module, "BATCH", 1)
    monkeypatch.setattr(simulation_module, "EVENT_BUDGET", 5)
    simulation = bs.Simulation(bs.scenes.rack())
    break_shot(simulation)
    with pytest.raises(bs.StallError) as stall:
        for _ in range(200):
            simulation.advance(1.0, budget=0.0)
    Path(str(stall.value.path)).unlink()
    assert 0.1 < simulation.time < 0.3


@pytest.mark.parametrize("friction, spin", [(1e-6, 10.0), (0.2, 1e9)])
def test_ball_that_is_held_where_it_is_while_time_goes_on_is_no_stall(
    friction: float, spin: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Its spin into the rail lasts R w / (5/2 mu g), 1e4 to 6e6 s, in steps of a second at most.
    monkeypatch.setattr(simulation_module, "BATCH", 10)
    monkeypatch.setattr(simulation_module, "EVENT_BUDGET", 100)
    scene = bs.Scene(
        [[TABLE.x_max - RADIUS, 0.6]], None, [[0.0, spin, 0.0]], physics=bs.Physics(sliding_friction=friction)
    )
    simulation = bs.Simulation(scene)
    simulation.run(until=2000.0)
    assert simulation.positions[0, 0] == pytest.approx(TABLE.x_max - RADIUS, abs=1e-9)
    assert simulation.angular_velocities[0, 1] == pytest.approx(spin - 2.5 * friction * 9.81 / RADIUS * 2000.0)


def test_balls_that_are_slow_are_given_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    # Two balls that roll along a rail, apart, at a micrometre a second: no step leads them anywhere near a radius.
    monkeypatch.setattr(simulation_module, "BATCH", 1)
    monkeypatch.setattr(simulation_module, "EVENT_BUDGET", 2)
    physics = bs.Physics(rolling_friction=1e-9)
    speed = 1e-6
    scene = bs.Scene([[0.5, 0.6], [0.9, 0.6]], [[speed, 0.0]] * 2, [[0.0, speed / RADIUS, 0.0]] * 2, physics=physics)
    simulation = bs.Simulation(scene)
    simulation.run()
    assert simulation.at_rest
    assert simulation.positions[0, 0] - 0.5 == pytest.approx(speed**2 / (2.0 * 1e-9 * 9.81), rel=1e-6)
