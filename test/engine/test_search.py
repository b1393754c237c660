# SPDX-License-Identifier: Apache-2.0
"""The search for shots: it finds the aim that friction has moved, values it honestly, and draws the same every time."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from checks import COMPILED

import billiards_sim as bs
from billiards_sim.engine.goals import Potting
from billiards_sim.engine.potting import Direction, pots
from billiards_sim.engine.search import _uphill, as_it_succeeds

TABLE = bs.Table.pool_9ft()
POOL = bs.Physics.pool()
NOISE = bs.ShooterNoise.tournament()
CUT = bs.Scene([(1.5, 0.9), (2.1, 1.0)], names=("cue", "1"), table=TABLE, physics=POOL)
"""A half-ball cut into x_max_y_max, and other ways."""

BUDGET = 20_000 if COMPILED else 500
SAMPLES = 200 if COMPILED else 20

COMPILED_ONLY = pytest.mark.skipif(not COMPILED, reason="thousands of shots take seconds interpreted")


def pot(scene: bs.Scene = CUT, **arguments: Any) -> bs.Found:
    goal = bs.goals.pocket(scene, "1", "x_max_y_max")
    options = {"budget": BUDGET, "samples": SAMPLES, "best": 2, "noise": NOISE, **arguments}
    return bs.search(scene, goal, **options)


def test_the_aim_that_throw_has_moved_is_found() -> None:
    far = bs.Scene([(1.0, 0.4), (1.4, 0.75)], names=("cue", "1"), table=TABLE, physics=POOL)
    ghost = next(start for start in pots(far, "1", "x_max_y_max") if start.kind == "direct")
    assert not bs.rollout(far, bs.Shots(np.linspace(0.9, 1.1, 10), ghost.azimuth)).pocketed("1").any()
    found = pot(far, noise=None, directions=[ghost], speeds=(0.9, 1.1))
    assert found.values.tolist()[:1] == [1.0]
    assert bs.rollout(far, found.shots[:1]).pocketed("1", "x_max_y_max").all()
    assert abs(found.shots.azimuth[0] - ghost.azimuth) < ghost.window


def test_the_shots_that_are_found_hold_under_noise() -> None:
    found = pot()
    again = bs.rollout(CUT, found.shots, noise=NOISE, samples=400 if COMPILED else 50, seed=99)
    rates = (again.pocketed("1", "x_max_y_max") & ~again.pocketed("cue")).mean(axis=1)
    assert found.values[0] >= (0.9 if COMPILED else 0.6)
    # Both are means of independent draws: five standard errors of their difference.
    spread = np.sqrt(found.errors**2 + rates * (1.0 - rates) / again.error.shape[1]) + 1.0 / SAMPLES
    assert (np.abs(rates - found.values) < 5.0 * spread).all()


def near_a_place(result: bs.Rollout) -> Any:
    """m, negative, from where the cue ball is to end."""
    return -np.hypot(*np.moveaxis(result.positions[..., 0, :] - (1.9, 0.9), -1, 0))


@COMPILED_ONLY
def test_shots_are_refined_beyond_what_the_sweep_tries() -> None:
    # The best of the sweep comes within 22 mm.
    alone = bs.Scene([(1.0, 0.6)], table=bs.Table(), physics=bs.Physics())
    for seed in (0, 2):
        found = bs.search(alone, near_a_place, budget=80_000, speeds=(0.3, 2.0), best=2, seed=seed)
        assert found.values[0] > -0.015


def test_the_top_of_a_quadratic_is_found_where_it_is_near() -> None:
    away = np.random.default_rng(1).standard_normal((100, 3))
    top = np.array((0.4, -0.7, 0.1))
    assert _uphill(away, 5.0 - ((away - top) ** 2).sum(axis=1)) == pytest.approx(top, abs=1e-9)
    assert _uphill(away, 5.0 - ((away - 9.0 * top) ** 2).sum(axis=1)).tolist() == [1.0, -1.0, pytest.approx(0.9)]
    assert _uphill(away, away @ (1.0, -1.0, 2.0)).tolist() == [1.0, -1.0, 1.0]
    assert _uphill(away, ((away - top) ** 2).sum(axis=1)).tolist() == [-1.0, 1.0, -1.0]  # away from a valley
    assert _uphill(away, np.full(100, 0.3)).tolist() == [0.0, 0.0, 0.0]


def test_chance_alone_leads_nowhere_on_average() -> None:
    random = np.random.default_rng(1)
    steps = [_uphill(random.standard_normal((400, 4)), 1.0 * (random.random(400) < 0.9)) for _ in range(300)]
    assert np.mean(steps, axis=0) == pytest.approx(np.zeros(4), abs=5.0 / math.sqrt(300))
    assert np.abs(steps).mean() < 0.7  # of |x| for x normal, cut at 1, the mean is 0.63


def test_the_best_come_first_and_the_values_are_those_of_the_result() -> None:
    found = pot()
    goal = bs.goals.pocket(CUT, "1", "x_max_y_max")
    assert found.scores.shape == found.result.error.shape == (len(found), SAMPLES)
    np.testing.assert_array_equal(found.scores, goal(found.result))
    np.testing.assert_array_equal(found.values, found.scores.mean(axis=1))
    np.testing.assert_allclose(found.errors, found.scores.std(axis=1) / math.sqrt(SAMPLES))
    assert (np.diff(found.values) <= 0.0).all()


@COMPILED_ONLY
def test_the_shots_found_go_in_directions_that_noise_does_not_blur() -> None:
    goal = bs.goals.pocket(CUT, "1", "x_max_y_max")
    found = bs.search(CUT, lambda result: goal(result), noise=NOISE, budget=BUDGET, best=3)
    azimuths = found.shots.azimuth
    assert len(found) >= 2
    away = [abs(math.remainder(a - b, 2.0 * math.pi)) for i, a in enumerate(azimuths) for b in azimuths[:i]]
    assert min(away) > 2.0 * NOISE.azimuth


BETWEEN = bs.Scene([(1.3208, 0.8), (2.35, 1.2), (0.29, 1.2)], names=("cue", "1", "2"), table=TABLE, physics=POOL)
"""Two balls before a pocket each, as mirror images, and the cue ball as far from both."""


@COMPILED_ONLY
def test_of_balls_before_a_pocket_each_both_are_found() -> None:
    found = bs.search(BETWEEN, bs.goals.pocket(BETWEEN), noise=NOISE, budget=BUDGET, samples=SAMPLES, best=2)
    assert found.values.min() > 0.9
    easy = (found.result.pocketed("1", "x_max_y_max"), found.result.pocketed("2", "x_min_y_max"))
    shares = [fell.mean(axis=1) > 0.9 for fell in easy]
    assert sorted(np.transpose(shares).tolist()) == [[False, True], [True, False]]


@COMPILED_ONLY
@pytest.mark.parametrize("noise", [None, NOISE])
def test_no_two_of_the_shots_pot_the_same_ball_in_the_same_way(noise: bs.ShooterNoise | None) -> None:
    goal = bs.goals.pocket(BETWEEN)
    found = bs.search(BETWEEN, goal, noise=noise, budget=2 * BUDGET, samples=SAMPLES, best=5)
    shown = [as_it_succeeds(BETWEEN, found.shots[[row]], goal, noise, 0) for row in range(len(found))]
    ways = [goal.way(bs.rollout(BETWEEN, shot, events=True).events(0)) for shot in shown]
    assert len(set(ways)) == len(ways) >= 4
    assert {way.ball for way in ways} == {"1", "2"}
    assert not {way.kind for way in ways} & {"miss", "scratch"}


def test_a_shot_that_fails_as_it_is_meant_is_shown_by_one_that_succeeds() -> None:
    goal = bs.goals.pocket(CUT, "1", "x_max_y_max")
    azimuths = np.linspace(0.0, 0.5, 400)
    fell = goal(bs.rollout(CUT, bs.Shots(1.5, azimuths))) > 0.0
    at = int(np.argmax(fell))
    good, beside = (bs.Shots(1.5, azimuths[index]) for index in (at, at - 1))
    assert (as_it_succeeds(CUT, good, goal, NOISE, 0).columns() == good.columns()).all()
    assert (as_it_succeeds(CUT, beside, goal, None, 0).columns() == beside.columns()).all()
    shown = as_it_succeeds(CUT, beside, goal, NOISE, 0)
    assert goal(bs.rollout(CUT, shown)).tolist() == [1.0]
    assert abs(shown.azimuth[0] - beside.azimuth[0]) < 6.0 * NOISE.azimuth


def test_the_same_seed_finds_the_same_to_the_bit() -> None:
    small = {"budget": 300, "samples": 5, "best": 1}
    one = pot(**small, seed=3)
    with ThreadPoolExecutor(3) as executor:
        other = pot(**small, seed=3, executor=executor)
    np.testing.assert_array_equal(one.shots.columns(), other.shots.columns())
    np.testing.assert_array_equal(one.result.positions, other.result.positions)
    assert not np.array_equal(one.result.positions, pot(**small, seed=4).result.positions)


def test_the_cue_ball_is_kept_where_the_goal_says_so() -> None:
    middle = np.array((TABLE.x_max, TABLE.y_max)) - 0.04
    way = np.array((math.cos(0.7), math.sin(0.7)))
    straight = bs.Scene([middle - 0.9 * way, middle - 0.35 * way], names=("cue", "1"), table=TABLE, physics=POOL)
    start = [next(start for start in pots(straight, "1", "x_max_y_max") if start.kind == "direct")]
    kept = bs.search(
        straight, bs.goals.pocket(straight, "1"), noise=NOISE, directions=start, budget=BUDGET, samples=SAMPLES
    )
    assert kept.values[0] > 0.8
    follow = bs.rollout(straight, bs.Shots(2.5, start[0].azimuth, 0.0, 0.4))
    assert follow.pocketed("cue").all()  # as a shot with follow would end
    assert bs.goals.pocket(straight, "1")(follow).tolist() == [0.0]
    assert bs.goals.pocket(straight, "1", keep_cue=False)(follow).tolist() == [1.0]


def ways(scene: bs.Scene, found: bs.Found, ball: str) -> list[str]:
    """In which a ball falls in each of the shots: what it and the cue ball met on the way, in order."""
    told = []
    for events in map(bs.rollout(scene, found.shots, events=True).events, range(len(found))):
        fall = next(index for index, event in enumerate(events) if event.kind == "pocketed" and ball in event.balls)
        hits = [event for event in events[:fall] if event.kind in ("ball_ball", "ball_rail")]
        told.append(" ".join(event.kind.removeprefix("ball_") + "".join(sorted(event.balls)) for event in hits))
    return told


@COMPILED_ONLY
def test_where_a_ball_bars_the_way_there_are_combinations_and_kicks() -> None:
    # 16 degrees to each side of ball 2 are barred, and ball 1 can be hit within 4.
    barred = bs.Scene([(1.0, 0.762), (2.0, 0.762), (1.2, 0.762)], names=("cue", "1", "2"), table=TABLE, physics=POOL)
    assert {start.kind for start in pots(barred, "1")} == {"combination", "kick"}
    for kind, begin in (("combination", "ball2cue ball12"), ("kick", "railcue ball1cue")):
        starts = [start for start in pots(barred, "1") if start.kind == kind]
        found = bs.search(barred, bs.goals.pocket(barred, "1"), directions=starts, budget=30_000)
        assert found.values.tolist() == [1.0] * len(found)
        assert any(way.startswith(begin) for way in ways(barred, found, "1"))
    found = bs.search(barred, bs.goals.pocket(barred, "1", first="1"), budget=30_000)
    assert found.values[0] == 1.0
    assert all(way.startswith("railcue") for way in ways(barred, found, "1"))


def test_a_goal_of_ones_own_is_searched_for_all_round() -> None:
    alone = bs.Scene([(1.0, 0.6)], table=bs.Table(), physics=bs.Physics())
    found = bs.search(alone, near_a_place, budget=4 * BUDGET if COMPILED else 2_000, speeds=(0.3, 2.0), best=2)
    assert found.values[0] > (-0.02 if COMPILED else -0.05)  # m
    assert not found.errors.any()


def test_speeds_and_tip_stay_within_their_bounds() -> None:
    found = pot(speeds=(1.5, 1.6))
    assert ((found.shots.speed >= 1.5) & (found.shots.speed <= 1.6)).all()
    # Three standard deviations inside the miscue limit, less than 0.3 % of tips slip off.
    assert (np.hypot(found.shots.side, found.shots.up) <= POOL.miscue_limit - 3.0 * NOISE.side + 1e-12).all()


@COMPILED_ONLY
def test_the_budget_bounds_what_is_played() -> None:
    few, many = (pot(budget=budget, samples=10, best=1).played for budget in (BUDGET // 2, 2 * BUDGET))
    assert few < many < 4 * BUDGET


def test_a_score_that_is_nan_counts_as_nothing_where_the_shot_was_not_played() -> None:
    rough = bs.ShooterNoise(0.0, 0.0, 0.4, 0.0)

    def height(result: bs.Rollout) -> Any:
        return result.positions[..., 0, 1]  # nan where the tip slipped off

    start = [Direction(0.5, 0.1, math.nan)]
    found = bs.search(CUT, height, noise=rough, directions=start, budget=300, samples=60, best=1)
    slipped = found.result.error > 0
    assert slipped.any()
    assert (found.scores[slipped] == 0.0).all()
    assert (found.scores[~slipped] > 0.0).all()


@pytest.mark.parametrize(
    "goal, said",
    [
        (lambda result: np.zeros(3), r"goal must give scores of shape \(\d+,\), got \(3,\)"),
        (lambda result: 1.0, r"goal must give scores of shape \(\d+,\), got \(\)"),
        (lambda result: np.full(result.error.shape, math.nan), r"goal gives nan for (\d+) of \1 shots"),
        (lambda result: np.where(result.first_hit < 0, -math.inf, 1.0), "goal gives -inf for"),
        (lambda result: None, "goal must give numbers, got None"),
        (lambda result: "high", "goal must give numbers, got 'high'"),
        (lambda result: 1j * result.error, "goal must give numbers, got "),
        (bs.goals.pocket(CUT, struck="1"), "goal is for shots of ball '1', and ball 'cue' is struck"),
        (Potting(first="2"), "no ball is named '2'; the balls are cue, 1"),
        (Potting(ball="2"), "no ball is named '2'; the balls are cue, 1"),
        ("3", "goal must be a function"),
    ],
)
def test_a_goal_that_is_none_is_refused(goal: Any, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        bs.search(CUT, goal, budget=100)


@pytest.mark.parametrize(
    "arguments, said",
    [
        ({"samples": 0}, "samples must be a whole number >= 1, got 0"),
        ({"best": 1.5}, "best must be a whole number >= 1, got 1.5"),
        ({"seed": -1}, "seed must be a whole number >= 0, got -1"),
        ({"budget": 5}, "budget must be a whole number >= 100, got 5"),
        ({"noise": 0.1}, "noise must be a ShooterNoise or None, got 0.1"),
        ({"speeds": (2.0, 1.0)}, "speeds must be > 0, in order"),
        ({"speeds": 3.0}, "speeds must be two numbers"),
        ({"directions": []}, r"directions must be `Direction`s, one at least, or None; got \[\]"),
        ({"directions": [0.3]}, "directions must be `Direction`s"),
        ({"directions": 3}, "directions must be `Direction`s"),
        ({"directions": [Direction(math.nan, 0.1, 0.1)]}, "directions must have a finite azimuth"),
        ({"directions": [Direction(0.0, math.inf, 0.1)]}, "a window from 0 to pi rad"),
        ({"directions": [Direction(0.0, 0.1, -0.1)]}, "a tolerance >= 0 or nan, got 0, 0.1 and -0.1"),
        ({"ball": "x"}, "x"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        pot(**arguments)


@pytest.mark.parametrize(
    "arguments, said",
    [
        ({"ball": "9"}, "no ball is named '9'; the balls are cue, 1"),
        ({"pocket": "left"}, "no pocket is named 'left'; the pockets are x_min_y_min"),
        ({"ball": "cue"}, "the ball to be potted must be another than 'cue'"),
        ({"first": "cue"}, "the ball to be met first must be another than 'cue'"),
        ({"first": "2"}, "no ball is named '2'"),
    ],
)
def test_a_goal_for_what_is_not_there_is_refused(arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        bs.goals.pocket(CUT, **arguments)


def test_a_table_without_pockets_has_nothing_to_pot_into() -> None:
    with pytest.raises(ValueError, match="has no pockets"):
        bs.goals.pocket(bs.scenes.head_on())


def test_the_struck_ball_alone_has_nothing_to_pot() -> None:
    gone = bs.Scene([(1.0, 0.5), (1.5, 0.8)], table=TABLE, in_play=[True, False])
    with pytest.raises(ValueError, match="there is no ball to pot but 'cue', which is struck"):
        bs.goals.pocket(gone)


def test_the_ball_that_must_be_met_first_counts() -> None:
    three = bs.Scene([(1.5, 0.9), (2.1, 1.0), (0.8, 0.5)], names=("cue", "1", "2"), table=TABLE, physics=POOL)
    found = pot(three, noise=None)
    assert bs.goals.pocket(three, "1")(found.result)[0] == 1.0
    assert bs.goals.pocket(three, "1", first="1")(found.result)[0] == 1.0
    assert bs.goals.pocket(three, "1", first="2")(found.result)[0] == 0.0
    assert bs.goals.pocket(three)(found.result)[0] == 1.0
    assert bs.goals.pocket(three, "2")(found.result)[0] == 0.0
