# SPDX-License-Identifier: Apache-2.0
"""Rollouts: shots by the thousand, each with the bits of a single run."""

from __future__ import annotations

import math
import os
import pickle
import re
import signal
import sys
import threading
import time
import tracemalloc
from collections.abc import Callable
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checks import COMPILED, random_scene

import billiards_sim as bs
from billiards_sim.engine import player
from billiards_sim.engine.kernels import batch
from billiards_sim.engine.kernels.state import NOBODY

RACK = bs.scenes.rack()
TWO_BALLS = bs.Scene([(0.6, 0.6), (1.2, 0.62)])
POTS = bs.Scene(
    [(0.9, 0.7), (2.2, 1.1), (1.3, 0.5)], names=("cue", "1", "2"), table=bs.Table.pool_9ft(), physics=bs.Physics.pool()
)
"""Balls on a pool table, one of them near a corner."""

MANY = 200 if COMPILED else 20


def random_shots(count: int, seed: int = 0, elevation: bool = True) -> bs.Shots:
    random = np.random.default_rng(seed)
    return bs.Shots(
        random.uniform(0.2, 6.0, count),
        random.uniform(-7.0, 7.0, count),
        random.uniform(-0.35, 0.35, count),
        random.uniform(-0.35, 0.35, count),
        random.uniform(0.0, 0.3, count) * (random.random(count) < 0.5) * elevation,
    )


def alone(scene: bs.Scene, shots: bs.Shots, index: int) -> bs.Simulation:
    simulation = bs.Simulation(scene)
    simulation.shoot(*shots.columns()[index].tolist())
    return simulation


def assert_same(one: bs.Rollout, other: bs.Rollout) -> None:
    for name in ("positions", "in_play", "pocket", "duration", "event_count", "first_hit", "error"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.reasons == other.reasons


@pytest.mark.parametrize("scene", [RACK, TWO_BALLS, POTS, bs.scenes.eight_ball()], ids=["rack", "two", "pots", "pool"])
@pytest.mark.parametrize("until", [None, 0.7])
def test_each_shot_has_the_bits_of_a_single_run(scene: bs.Scene, until: float | None) -> None:
    count = max(MANY // len(scene), 2)
    shots = random_shots(count)
    result = bs.rollout(scene, shots, until=until, events=True)
    for index in range(count):
        simulation = alone(scene, shots, index)
        events = simulation.run(until)
        np.testing.assert_array_equal(result.positions[index], simulation.positions)
        np.testing.assert_array_equal(result.in_play[index], simulation.in_play)
        assert result.duration[index] == simulation.time
        assert result.event_count[index] == len(events)
        assert result.events(index) == events
        pockets = {event.balls[0]: event.pocket for event in events if event.kind == "pocketed"}
        found = {name: result.pockets[pocket] for name, pocket in zip(scene.names, result.pocket[index]) if pocket >= 0}
        assert found == pockets
        hits = [event.balls for event in events if event.kind == "ball_ball" and "cue" in event.balls]
        hit = next(({*balls} - {"cue"} for balls in hits), set())
        assert {scene.names[i] for i in [result.first_hit[index]] if i != NOBODY} == hit
    assert not result.error.any()
    assert result.reasons == {}


def test_other_balls_may_move_and_spin_and_be_off_the_table() -> None:
    base = random_scene(5, 8)
    velocities, spins = base.velocities.copy(), base.angular_velocities.copy()
    velocities[0] = spins[0, :2] = spins[2] = 0.0
    velocities[2] = 1e-12, 0.0  # rests at once, which is an event
    spins[0, 2] = 20.0
    in_play = np.arange(len(base)) != 1
    physics = bs.Physics.pool(cue_contact_time=0.01)
    scene = bs.Scene(base.positions, velocities, spins, in_play=in_play, physics=physics)
    shots = random_shots(5)
    result = bs.rollout(scene, shots, events=True)
    for index in range(len(shots)):
        simulation = alone(scene, shots, index)
        assert result.events(index) == simulation.run()
        np.testing.assert_array_equal(result.positions[index], simulation.positions)
        assert result.duration[index] == simulation.time
    assert (result.pocket == -1).all()
    np.testing.assert_array_equal(result.in_play, np.tile(in_play, (5, 1)))


def test_any_ball_may_be_struck() -> None:
    shots = bs.Shots(2.0, np.linspace(0.0, 6.0, 20))
    result = bs.rollout(POTS, shots, ball="2", events=True)
    for index in range(20):
        simulation = bs.Simulation(POTS)
        simulation.shoot(2.0, float(shots.azimuth[index]), ball="2")
        assert result.events(index) == simulation.run()
        hits = [event.balls for event in result.events(index) if event.kind == "ball_ball" and "2" in event.balls]
        balls = hits[0] if hits else ("2",)
        assert {POTS.names[i] for i in [result.first_hit[index]] if i != NOBODY} == {*balls} - {"2"}
    assert (result.first_hit >= 0).any()


def test_a_ball_in_the_mouth_of_a_pocket_is_not_in_it() -> None:
    scene = bs.Scene([(2.60, 1.31)], table=POTS.table, physics=POTS.physics)
    shots = bs.Shots(1.0, math.pi / 4)
    assert bs.rollout(scene, shots, until=0.01).pocket.tolist() == [[-1]]
    assert bs.rollout(scene, shots).pockets[bs.rollout(scene, shots).pocket[0, 0]] == "x_max_y_max"


def test_a_ball_that_is_off_the_table_fell_into_no_pocket() -> None:
    scene = bs.Scene([(2.45, 1.16), (2.60, 1.31)], table=POTS.table, physics=POTS.physics)
    shots = bs.Shots([1.5, 1.5], math.pi / 4)
    result = bs.rollout(scene, shots, in_play=[[True, True], [True, False]], piece=2)
    assert result.pocketed("1").tolist() == [True, False]


@pytest.mark.skipif(COMPILED, reason="a constant of machine code")
@pytest.mark.parametrize("fits", [5, 6, 9])
def test_a_shot_may_take_several_calls_of_the_loop(monkeypatch: pytest.MonkeyPatch, fits: int) -> None:
    some = random_shots(10)
    shots = bs.Shots(np.where(np.arange(10) % 2, 0.005, 6.0), some.azimuth, some.side, some.up)  # many events and few
    expected = bs.rollout(POTS, shots, events=True)
    monkeypatch.setattr(batch, "SLICE", 20)
    monkeypatch.setattr(player, "EVENT_ROWS", sorted(expected.event_count.tolist())[fits])
    result = bs.rollout(POTS, shots, events=True)
    assert_same(result, expected)
    assert [result.events(m) for m in range(10)] == [expected.events(m) for m in range(10)]


@pytest.mark.parametrize("piece", [1, 100, 10_000])
@pytest.mark.parametrize("threads", [1, 2, 7])
def test_threads_and_pieces_change_no_bit(threads: int, piece: int) -> None:
    shots, noise = random_shots(MANY), bs.ShooterNoise(0.05, 0.01, 0.1, 0.1)
    options: dict[str, Any] = {"noise": noise, "samples": 2, "seed": 7}
    with ThreadPoolExecutor(threads) as executor:
        spread = bs.rollout(POTS, shots, **options, executor=executor, piece=piece)
    assert_same(spread, bs.rollout(POTS, shots, **options))


def test_processes_change_no_bit() -> None:
    shots, noise = random_shots(MANY), bs.ShooterNoise.tournament()
    with ProcessPoolExecutor(2, get_context("spawn")) as executor:
        spread = bs.rollout(POTS, shots, noise=noise, seed=3, events=True, executor=executor)
    here = bs.rollout(POTS, shots, noise=noise, seed=3, events=True)
    assert_same(spread, here)
    assert [spread.events(index) for index in range(len(shots))] == [here.events(index) for index in range(len(shots))]


def test_bad_shots_are_refused_together_before_any_is_played(monkeypatch: pytest.MonkeyPatch) -> None:
    shots = bs.Shots([1.0, -1.0, 2.0, math.nan, 3.0], 0.0, [0.0, 0.0, 0.9, 0.0, 0.0], elevation=[0, 0, 0, 0, 2.0])
    monkeypatch.setattr(player.Player, "play", None)
    with pytest.raises(bs.BadShots, match="4 of 5 shots cannot be played: 1: speed must be > 0") as raised:
        bs.rollout(POTS, shots)
    reasons = raised.value.reasons
    assert list(reasons) == [1, 2, 3, 4]
    for index, reason in reasons.items():
        with pytest.raises(ValueError, match=r".") as single:
            alone(POTS, shots, index)
        assert reason == str(single.value)


def test_bad_shots_are_marked_on_demand_and_the_others_unharmed() -> None:
    good = random_shots(6)
    speed = good.speed.copy()
    speed[[1, 4]] = 0.0, math.inf
    shots = bs.Shots(speed, good.azimuth, good.side, good.up, good.elevation)
    result = bs.rollout(POTS, shots, on_error="mask")
    np.testing.assert_array_equal(result.error, [0, 1, 0, 0, 1, 0])
    assert list(result.reasons) == [1, 4]
    assert "speed must be > 0" in result.reasons[1]
    assert np.isnan(result.positions[1]).all()
    assert np.isnan(result.duration[4])
    np.testing.assert_array_equal(result.positions[[0, 2, 3, 5]], bs.rollout(POTS, good).positions[[0, 2, 3, 5]])


def test_a_bad_shot_stays_bad_whatever_the_noise() -> None:
    shots = bs.Shots(2.0, 0.1, [0.501, 0.0])
    noise = bs.ShooterNoise(0.0, 0.0, 0.1, 0.1)
    result = bs.rollout(POTS, shots, noise=noise, samples=50, seed=1, on_error="mask")
    assert (result.error[0] == 1).all()
    assert not result.error[1].any()
    assert {reason for (shot, _), reason in result.reasons.items() if shot == 0} == {result.reasons[0, 0]}
    assert "0.014316075" in result.reasons[0, 0]  # 0.501 radii, as it was given


NOISE = bs.ShooterNoise(speed=0.03, azimuth=0.002, side=0.02, up=0.01)


def test_errors_have_the_deviations_that_are_asked_for() -> None:
    count = 40_000
    drawn = NOISE.samples(np.tile([2.0, 0.3, 0.1, -0.2, 0.0], (2, 1)), 0, count, 5)
    expected = np.array([[2.0, 0.3, 0.1, -0.2], [0.06, 0.002, 0.02, 0.01]])
    means, deviations = drawn[..., :4].mean(axis=1), drawn[..., :4].std(axis=1)
    assert (abs(means - expected[0]) < 5.0 * expected[1] / math.sqrt(count)).all()
    assert (abs(deviations / expected[1] - 1.0) < 5.0 / math.sqrt(2.0 * count)).all()
    assert (drawn[..., 4] == 0.0).all()
    correlations = np.corrcoef(drawn[..., :4].reshape(-1, 4).T) - np.eye(4)
    assert abs(correlations).max() < 5.0 / math.sqrt(2.0 * count)


def test_errors_depend_on_seed_and_index_alone() -> None:
    shots = random_shots(10)
    result = bs.rollout(POTS, shots, noise=NOISE, samples=4, seed=11)
    fewer = bs.rollout(POTS, shots[:3], noise=NOISE, samples=2, seed=11)
    np.testing.assert_array_equal(fewer.positions, result.positions[:3, :2])
    other = bs.rollout(POTS, shots, noise=NOISE, samples=4, seed=12)
    assert (other.positions[..., 0, :] != result.positions[..., 0, :]).all()
    assert len(np.unique(result.positions[..., 0, 0])) == 40  # no two samples or shots have the same errors


def test_a_sample_has_the_bits_of_a_single_run() -> None:
    shots = random_shots(4)
    result = bs.rollout(POTS, shots, noise=NOISE, samples=3, seed=2, events=True)
    sampled = NOISE.samples(shots.columns(), 0, 3, 2)
    for shot, sample in np.ndindex(4, 3):
        simulation = bs.Simulation(POTS)
        simulation.shoot(*sampled[shot, sample].tolist())
        assert result.events(shot, sample) == simulation.run()
        np.testing.assert_array_equal(result.positions[shot, sample], simulation.positions)
    assert result.positions.shape == (4, 3, 3, 2)
    assert result.pocket.shape == (4, 3, 3)
    assert result.first_hit.shape == (4, 3)


def test_no_noise_is_no_noise() -> None:
    shots = random_shots(5)
    assert_same(bs.rollout(POTS, shots, noise=bs.ShooterNoise(0.0, 0.0, 0.0, 0.0)), bs.rollout(POTS, shots))


def test_without_a_seed_errors_are_others_each_time_and_can_be_made_again() -> None:
    shots = random_shots(3)
    one, other = (bs.rollout(POTS, shots, noise=NOISE) for _ in range(2))
    assert one.entropy != other.entropy
    assert (one.positions != other.positions).any()
    assert_same(bs.rollout(POTS, shots, noise=NOISE, seed=one.entropy), one)


def test_a_tip_that_noise_takes_off_the_ball_is_a_miscue_and_not_played() -> None:
    shots = bs.Shots(2.0, np.linspace(0.0, 6.0, 30), side=0.45)
    noise = bs.ShooterNoise(0.0, 0.0, 0.05, 0.0)
    result = bs.rollout(POTS, shots, noise=noise, seed=4)
    slips = noise.samples(shots.columns(), 0, 1, 4)[:, 0, 2] > POTS.physics.miscue_limit
    assert 0 < slips.sum() < 30
    np.testing.assert_array_equal(result.error, np.where(slips, 2, 0))
    np.testing.assert_array_equal(np.isnan(result.positions).all(axis=(1, 2)), slips)
    assert list(result.reasons) == np.flatnonzero(slips).tolist()
    assert all("the tip slips off" in reason for reason in result.reasons.values())
    assert result.in_play[slips].all()
    assert (result.event_count > 0).tolist() == (~slips).tolist()


def test_the_tournament_noise_is_in_the_units_of_a_shot() -> None:
    noise = bs.ShooterNoise.tournament(2.0, cue_speed=1.5)
    assert noise.azimuth == math.radians(0.25)
    assert noise.side * bs.Physics.pool().radius == noise.up * 0.028575 == pytest.approx(1e-3, rel=1e-15)
    assert noise.speed * 1.5 == pytest.approx(0.15, rel=1e-15)


def test_shots_that_take_long_are_played_to_their_end(monkeypatch: pytest.MonkeyPatch) -> None:
    shots = random_shots(4)
    expected = bs.rollout(POTS, shots, events=True)
    monkeypatch.setattr(player, "MOST_WORK", 1)
    longer = bs.rollout(POTS, shots, events=True)
    assert_same(longer, expected)
    assert [longer.events(m) for m in range(4)] == [expected.events(m) for m in range(4)]


def test_events_beyond_the_room_for_them_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    shots = random_shots(12)
    expected = bs.rollout(POTS, shots, events=True)
    counts = sorted(expected.event_count.tolist())
    for room in (counts[0] - 1, counts[5], counts[-1], 2 * counts[-1]):
        monkeypatch.setattr(player, "EVENT_ROWS", room)
        result = bs.rollout(POTS, shots, events=True)
        assert_same(result, expected)
        assert [result.events(m) for m in range(12)] == [expected.events(m) for m in range(12)]


def test_a_shot_that_stalls_is_marked_with_a_file_and_the_others_unharmed(monkeypatch: pytest.MonkeyPatch) -> None:
    shots = random_shots(5)
    expected = bs.rollout(POTS, shots)
    longest = int(expected.event_count.argmax())

    def stalls(simulation: bs.Simulation, until: float | None = None) -> Any:
        events = run(simulation, until)
        if len(events) == expected.event_count[longest]:
            raise bs.StallError("no progress", simulation._origin(), events)
        return events

    run = bs.Simulation.run
    monkeypatch.setattr(player, "MOST_WORK", 1)
    monkeypatch.setattr(bs.Simulation, "run", stalls)
    result = bs.rollout(POTS, shots)
    monkeypatch.undo()
    others = np.arange(5) != longest
    np.testing.assert_array_equal(result.error, np.where(others, 0, 3))
    np.testing.assert_array_equal(result.positions[others], expected.positions[others])
    assert np.isnan(result.positions[longest]).all()
    (path,) = re.findall(r"\S+\.yaml", result.reasons[longest])
    scene = bs.load_scene(path)
    Path(path).unlink()
    again = bs.Simulation(scene)
    assert scene.shot is not None
    again.strike(scene.shot.force, scene.shot.offset, scene.shot.ball)
    again.run()
    np.testing.assert_array_equal(again.positions, expected.positions[longest])


class Watched(Executor):
    """Another executor, after whose first pieces something happens."""

    def __init__(self, executor: Executor, then: Callable[[], None], after: int = 2) -> None:
        self._executor, self._then, self._left = executor, then, after
        self._lock = threading.Lock()
        self.happened = False

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Future[Any]:
        future = self._executor.submit(function, *arguments, **options)
        future.add_done_callback(self._count)
        return future

    def _count(self, future: Future[Any]) -> None:
        with self._lock:
            self._left -= 1
            due, self.happened = self._left <= 0 and not self.happened, self.happened or self._left <= 0
        if due:
            self._then()


def test_what_a_broken_executor_has_played_is_kept() -> None:
    shots = random_shots(MANY)
    expected = bs.rollout(POTS, shots, events=True)

    def end_all() -> None:
        for process in list(processes._processes.values()):
            os.kill(process.pid, signal.SIGKILL)

    with (
        ProcessPoolExecutor(2, get_context("spawn")) as processes,
        pytest.raises(bs.BrokenRollout, match=rf"of {MANY} shots are missing.*BrokenProcessPool") as raised,
    ):
        bs.rollout(POTS, shots, events=True, executor=Watched(processes, end_all), piece=max(MANY // 50, 1))
    missing, result = raised.value.missing, raised.value.result
    assert 0 < len(missing) < MANY
    assert (result.error[missing] == 4).all()
    assert np.isnan(result.positions[missing]).all()
    there = np.setdiff1d(np.arange(MANY), missing)
    assert not result.error[there].any()
    np.testing.assert_array_equal(result.positions[there], expected.positions[there])
    assert all(result.events(m) == expected.events(m) for m in there.tolist())
    assert str(raised.value).startswith(f"{len(missing)} of {MANY} shots are missing, {missing[0]}, ")


def test_an_executor_that_is_shut_down_plays_nothing() -> None:
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(bs.BrokenRollout, match=r"^3 of 3 shots are missing, 0, 1, 2; .*shutdown") as raised:
        bs.rollout(POTS, random_shots(3), executor=executor)
    assert raised.value.missing.tolist() == [0, 1, 2]


def test_a_cluster_that_loses_a_worker_changes_no_bit() -> None:
    distributed = pytest.importorskip("distributed")
    shots = random_shots(MANY)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        pids = list(client.run(os.getpid).values())
        assert len({*pids, os.getpid()}) == 3
        executor = Watched(client.get_executor(pure=False), lambda: os.kill(pids[0], signal.SIGKILL))
        spread = bs.rollout(POTS, shots, noise=NOISE, seed=1, executor=executor, piece=max(MANY // 50, 1))
        assert executor.happened
    assert_same(spread, bs.rollout(POTS, shots, noise=NOISE, seed=1))


def random_starts(count: int) -> tuple[Any, Any]:
    """Where three balls lie, some of them off the table, some in touch with each other or with a rail."""
    random = np.random.default_rng(3)
    table, radius = POTS.table, POTS.physics.radius
    low, high = np.array([table.x_min, table.y_min]) + radius, np.array([table.x_max, table.y_max]) - radius
    positions = np.stack([random.uniform(low, [1.0, high[1]], (count, 2)) for _ in range(3)], axis=1)
    positions += np.array([(0.0, 0.0), (0.9, 0.0), (1.5, 0.0)]) * (high[0] - 1.0) / 1.6
    positions[::5, 1] = positions[::5, 0] + [2.0 * radius, 0.0]
    positions[1::5, 0, 0] = low[0]
    in_play = np.ones((count, 3), dtype=bool)
    in_play[2::5, 2] = False
    return positions, in_play


def test_each_shot_may_begin_elsewhere() -> None:
    count = 20
    positions, in_play = random_starts(count)
    shots = random_shots(count)
    given = positions.copy()
    given[~in_play] = 7.0  # whatever
    result = bs.rollout(POTS, shots, positions=given, in_play=in_play, noise=NOISE, samples=2, seed=1, piece=7)
    sampled = NOISE.samples(shots.columns(), 0, 2, 1)
    for shot, sample in np.ndindex(count, 2):
        scene = replace(POTS, positions=positions[shot], in_play=in_play[shot])
        simulation = bs.Simulation(scene)
        simulation.shoot(*sampled[shot, sample].tolist())
        simulation.run()
        np.testing.assert_array_equal(result.positions[shot, sample], simulation.positions)
        np.testing.assert_array_equal(result.in_play[shot, sample], simulation.in_play)
        assert result.duration[shot, sample] == simulation.time


def test_long_shots_may_begin_elsewhere(monkeypatch: pytest.MonkeyPatch) -> None:
    positions, in_play = random_starts(5)
    shots = random_shots(5)
    expected = bs.rollout(POTS, shots, positions=positions, in_play=in_play)
    monkeypatch.setattr(player, "MOST_WORK", 1)
    assert_same(bs.rollout(POTS, shots, positions=positions, in_play=in_play), expected)


def test_balls_that_cannot_lie_there_are_refused_together() -> None:
    positions = np.tile(POTS.positions, (6, 1, 1))
    in_play = np.ones((6, 3), dtype=bool)
    positions[1, 0] = positions[1, 1]
    positions[2, 2] = 0.0, 0.0
    positions[3, 1] = math.nan, 1.0
    in_play[4, 0] = False
    shots = bs.Shots([1.0] * 5 + [-1.0], 0.0)
    with pytest.raises(bs.BadShots, match="5 of 6 shots cannot be played") as raised:
        bs.rollout(POTS, shots, positions=positions, in_play=in_play)
    reasons = raised.value.reasons
    assert list(reasons) == [1, 2, 3, 4, 5]
    for shot, word in enumerate(["overlap", "'2' at", "must be finite", "'cue' is not in play", "speed"], 1):
        assert word in reasons[shot]
    masked = bs.rollout(POTS, shots, positions=positions, in_play=in_play, on_error="mask")
    assert masked.error.tolist() == [0, 1, 1, 1, 1, 1]
    np.testing.assert_array_equal(masked.positions[0], bs.rollout(POTS, shots[:1]).positions[0])
    np.testing.assert_array_equal(masked.in_play, in_play)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"shots": [1.0]}, "shots must be Shots"),
        ({"scene": "rack"}, "scene must be Scene"),
        ({"until": -1.0}, "until must be a finite number >= 0"),
        ({"noise": 0.1}, "noise must be a ShooterNoise or None"),
        ({"samples": 0}, "samples must be a whole number >= 1"),
        ({"samples": 3}, "3 samples without noise would all be the same"),
        ({"seed": -1}, "seed must be a whole number >= 0"),
        ({"seed": True}, "seed must be a whole number >= 0"),
        ({"on_error": "ignore"}, "on_error must be one of raise, mask"),
        ({"piece": 0}, "piece must be a whole number >= 1"),
        ({"executor": 3}, "executor must be a concurrent.futures.Executor or None, got 3"),
        ({"ball": "9"}, "no ball is named '9'"),
        ({"ball": "9", "in_play": [[True] * 3]}, "no ball is named '9'"),
        ({"positions": [[0.0, 0.0]]}, r"positions must have shape \(1, 3, 2\)"),
        ({"positions": "here"}, "positions must be numbers"),
        ({"in_play": [[1, 1, 1]]}, r"in_play must be truth values of shape \(1, 3\)"),
        ({"scene": replace(POTS, velocities=[(0, 0), (1, 0), (0, 0)]), "in_play": [[True] * 3]}, "nothing moves or"),
        ({"scene": replace(POTS, velocities=[(1, 0), (0, 0), (0, 0)])}, "'cue' must rest to be struck"),
        ({"scene": replace(POTS, in_play=[False, True, True])}, "'cue' is not in play"),
        ({"scene": bs.Scene(TWO_BALLS.positions, physics=bs.Physics(rolling_friction=0.0))}, "balls never rest"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_bad_argument_is_refused(options: dict[str, Any], said: str) -> None:
    given = {"scene": POTS, "shots": bs.Shots(1.0, 0.0), **options}
    with pytest.raises(ValueError, match=said):
        bs.rollout(given.pop("scene"), given.pop("shots"), **given)


def test_balls_that_never_rest_are_played_until_a_time() -> None:
    scene = bs.Scene(TWO_BALLS.positions, physics=bs.Physics(rolling_friction=0.0))
    assert bs.rollout(scene, bs.Shots(1.0, 0.0), until=2.0).duration.tolist() == [2.0]


def test_shots_are_arrays_of_one_length() -> None:
    shots = bs.Shots(2, [0.1, 0.2, 0.3], up=0.1)
    assert len(shots) == 3
    assert shots.speed.tolist() == [2.0] * 3
    assert shots[1].azimuth.tolist() == [0.2]
    assert shots[[True, False, True]].columns().tolist() == [[2.0, 0.1, 0.0, 0.1, 0.0], [2.0, 0.3, 0.0, 0.1, 0.0]]
    assert len(bs.Shots(1.0, 0.0)) == 1
    assert len(bs.Shots([], [])) == 0
    with pytest.raises(ValueError, match="read-only"):
        shots.speed[0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        pickle.loads(pickle.dumps(shots)).up[0] = 1.0
    for bad, said in [
        (([1.0, 2.0], [0.0] * 3), "one length"),
        (("fast", 0.0), "speed of shots"),
        (([[1.0]], 0.0), "M"),
    ]:
        with pytest.raises(ValueError, match=said):
            bs.Shots(*bad)


def test_no_shots_have_no_result() -> None:
    result = bs.rollout(POTS, bs.Shots([], []))
    assert result.positions.shape == (0, 3, 2)
    assert len(result) == 0


def test_pockets_are_asked_for_by_name() -> None:
    shots = bs.Shots(3.0, np.linspace(0.1, 0.5, 60))
    result = bs.rollout(POTS, shots, events=True)
    for ball in ("cue", "1"):
        falls = [
            next((e.pocket for e in result.events(m) if e.kind == "pocketed" and e.balls == (ball,)), None)
            for m in range(60)
        ]
        assert result.pocketed(ball).tolist() == [fall is not None for fall in falls]
        for pocket in result.pockets:
            assert result.pocketed(ball, pocket).tolist() == [fall == pocket for fall in falls]
    assert 0 < result.pocketed("1").sum() < 60
    with pytest.raises(ValueError, match="no ball is named '8'"):
        result.pocketed("8")
    with pytest.raises(ValueError, match="no pocket is named 'y'"):
        result.pocketed("1", "y")


def test_events_are_kept_on_demand_alone() -> None:
    with pytest.raises(ValueError, match="events=True"):
        bs.rollout(POTS, bs.Shots(1.0, 0.0)).events(0)


def test_progress_is_shown_where_it_is_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("tqdm")
    bs.rollout(POTS, random_shots(20), piece=1)
    assert capsys.readouterr().err == ""
    bs.rollout(POTS, random_shots(20), piece=1, progress=True)
    assert "20/20" in capsys.readouterr().err


def test_progress_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tqdm", None)
    with pytest.raises(ImportError, match=r"billiards_sim\[progress\]"):
        bs.rollout(POTS, random_shots(2), progress=True)


def test_the_memory_is_that_of_the_result() -> None:
    count = 50 * MANY
    shots = bs.Shots(1.0, np.linspace(0.0, 1.0, count))
    bs.rollout(TWO_BALLS, shots[:100], until=0.01)
    tracemalloc.start()
    try:
        result = bs.rollout(TWO_BALLS, shots, until=0.01)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    names = ("positions", "in_play", "pocket", "duration", "event_count", "first_hit", "error")
    size = sum(getattr(result, name).nbytes for name in names)
    assert peak - size < 200 * count + 1_000_000  # 200 MB for a million, and what a piece takes


@pytest.mark.parametrize("own", [True, False])
def test_an_interrupt_ends_a_rollout(monkeypatch: pytest.MonkeyPatch, own: bool) -> None:
    played: list[int] = []

    def interrupted(piece: Any) -> Any:
        played.append(piece.first)
        if len(played) == 3:
            raise KeyboardInterrupt
        time.sleep(0.05)  # so that the rest is not over before it is heard
        return player.play_piece(piece)

    monkeypatch.setattr("billiards_sim.engine.rollout.play_piece", interrupted)
    with ThreadPoolExecutor(1) as executor:
        with pytest.raises(KeyboardInterrupt):
            bs.rollout(POTS, random_shots(50), piece=1, executor=None if own else executor)
        if own:
            count = len(played)
            time.sleep(0.2)
            assert len(played) == count  # nothing goes on behind
    assert len(played) < 50


def test_who_has_not_played_to_the_end_plays_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: Any) -> None:
        raise MemoryError

    with ThreadPoolExecutor(1) as executor:
        first = bs.rollout(POTS, random_shots(3), executor=executor)
        monkeypatch.setattr(player.Player, "_play_rows", fails)
        with pytest.raises(bs.BrokenRollout, match="MemoryError"):
            bs.rollout(POTS, random_shots(3), executor=executor)
        assert executor.submit(lambda: player._idle.player).result() is None
        monkeypatch.undo()
        assert_same(bs.rollout(POTS, random_shots(3), executor=executor), first)


class Strange(Executor):
    """Whose `submit` does something else."""

    def __init__(self, submit: Callable[[], Any]) -> None:
        self._submit = submit

    def submit(self, function: Callable[..., Any], /, *arguments: Any, **options: Any) -> Any:
        return self._submit()


def done(result: Any) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_result(result)
    return future


def refuse() -> None:
    raise ValueError("no more")


@pytest.mark.parametrize(
    ("submit", "said"),
    [
        (refuse, "ValueError: no more"),
        (lambda: 3, "TypeError: submit of the executor must return a Future, got 3"),
        (lambda: done(None), "TypeError: the executor must return what it was given to play, got None"),
        (
            lambda: done(player.Played.blank(np.ones((1, 2), np.bool_), 0, False)),
            "must return what it was given to play",
        ),
    ],
)
def test_an_executor_that_plays_nothing_of_ours_is_told(submit: Callable[[], Any], said: str) -> None:
    with pytest.raises(bs.BrokenRollout, match=said) as caught:
        bs.rollout(TWO_BALLS, bs.Shots(1.0, [0.1, 0.2]), executor=Strange(submit))
    assert caught.value.missing.tolist() == [0, 1]
    assert (caught.value.result.error == 4).all()


def test_the_errors_of_a_rollout_can_be_sent_elsewhere() -> None:
    shots = bs.Shots([1.0, -1.0], 0.1)
    with pytest.raises(bs.BadShots) as bad:
        bs.rollout(TWO_BALLS, shots)
    with pytest.raises(bs.BrokenRollout) as broken:
        bs.rollout(TWO_BALLS, shots[:1], executor=Strange(refuse))
    one, other = (pickle.loads(pickle.dumps(caught.value)) for caught in (bad, broken))
    assert (str(one), one.reasons) == (str(bad.value), bad.value.reasons)
    assert (str(other), other.missing.tolist()) == (str(broken.value), [0])


@pytest.mark.parametrize("wrong", [{"cue_speed": 0.0}, {"level": -1.0}, {"level": "high"}, {"cue_speed": math.nan}])
def test_a_level_of_noise_that_is_none_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        bs.ShooterNoise.tournament(**wrong)
