# SPDX-License-Identifier: Apache-2.0
"""Rollouts: shots by the thousand, each with the bits of a single run."""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import pytest
from checks import COMPILED, random_scene

import billiards_sim as bs
from billiards_sim.engine import player
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
    velocities[0] = spins[0, :2] = 0.0
    spins[0, 2] = 20.0
    in_play = np.arange(len(base)) != 1
    physics = bs.Physics.pool(cue_contact_time=0.01)
    scene = bs.Scene(base.positions, velocities, spins, in_play=in_play, physics=physics)
    shots = random_shots(5)
    result = bs.rollout(scene, shots)
    for index in range(len(shots)):
        simulation = alone(scene, shots, index)
        simulation.run()
        np.testing.assert_array_equal(result.positions[index], simulation.positions)
        assert result.duration[index] == simulation.time
    assert (result.pocket == -1).all()
    np.testing.assert_array_equal(result.in_play, np.tile(in_play, (5, 1)))


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
