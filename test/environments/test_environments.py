# SPDX-License-Identifier: Apache-2.0
"""One table as an environment: what an action does, what it is worth, what is refused."""

from __future__ import annotations

import math
import subprocess
import sys
import warnings
from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import billiards_sim as bs  # noqa: E402
from billiards_sim.engine.kernels.state import NOBODY  # noqa: E402
from billiards_sim.gym import PoolEnv, PoolVectorEnv, SumToThreeEnv  # noqa: E402
from billiards_sim.gym.tables import Tables  # noqa: E402
from billiards_sim.gym.tasks import Pool, Room, SumToThree  # noqa: E402
from billiards_sim.outline import outline  # noqa: E402

POOL_TABLE, POOL = bs.Table.pool_9ft(), bs.Physics.pool()
CORNER = np.array([POOL_TABLE.x_max, POOL_TABLE.y_max])
STRAIGHT = {"positions": [CORNER - 0.5, CORNER - 0.15]}
"""The object ball between the cue ball and a corner pocket."""

SQUARE = {"physics": POOL.pool(youngs_modulus=0.0, cue_end_mass=0.0, ball_friction=0.0, ball_friction_slow=0.0)}
"""Nothing takes a ball off the line of aim or of centres."""


def seen(table: bs.Table, positions: Any, in_play: Any) -> Any:
    """The observation, from the definition."""
    reach = np.array([table.length, table.width]) / 2 + (table.jaw_depth if table.mouths else 0.0)
    rows = []
    for position, there in zip(positions, in_play):
        rows += [*((position - np.array(table.centre)) / reach), 1.0] if there else [0.0, 0.0, 0.0]
    return np.array(rows, np.float32)


@pytest.mark.parametrize("name", ["Pool", "SumToThree"])
def test_gymnasiums_checker_finds_nothing(name: str) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("PIL")
    matplotlib.use("agg")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        environment = gymnasium.make(f"billiards_sim.gym:billiards_sim/{name}-v0")
        check_env(environment.unwrapped)


def test_the_engine_does_not_import_gymnasium_and_says_what_is_missing() -> None:
    code = """
import sys, billiards_sim, billiards_sim.engine.rollout
assert "gymnasium" not in sys.modules
sys.modules["gymnasium"] = None
sys.modules["gymnasium.envs.registration"] = None
try:
    import billiards_sim.gym
except ImportError as error:
    print(error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "billiards_sim.gym needs Gymnasium: pip install 'billiards_sim[gym]'\n"


@pytest.mark.parametrize("env", [PoolEnv(balls=3), SumToThreeEnv(random_start=True)], ids=["pool", "sum"])
def test_a_step_has_the_bits_of_a_simulation(env: Any) -> None:
    scene = env._tables._task.scene
    radius, speeds = scene.physics.radius, {PoolEnv: (0.3, 4.5), SumToThreeEnv: (0.3, 3.0)}[type(env)]
    random = np.random.default_rng(3)
    moved = 0
    for seed in range(5):
        env.reset(seed=seed)
        places, in_play = env._tables.positions[0].copy(), env._tables.in_play[0].copy()
        for _ in range(3):
            action = random.uniform(-1.0, 1.0, 4)
            observation, _, ended, _, info = env.step(action)
            apart = (places - places[0])[1:]
            nearest = min((math.hypot(*row), *row) for row, there in zip(apart.tolist(), in_play[1:]) if there)
            azimuth = math.atan2(nearest[2], nearest[1]) + math.asin(action[0] * (2.0 * radius / nearest[0]))
            before = bs.Scene(places, table=scene.table, physics=scene.physics, in_play=in_play)
            simulation = bs.Simulation(before)
            offset = math.sqrt(0.5) * 0.5
            low, high = speeds
            speed = low + (action[1] + 1.0) / 2.0 * (high - low)
            simulation.shoot(speed, azimuth, side=offset * action[2], up=offset * action[3])
            simulation.run()
            places, in_play = simulation.positions, simulation.in_play
            np.testing.assert_array_equal(env._tables.positions[0], places)
            np.testing.assert_array_equal(observation, seen(scene.table, places, in_play))
            assert info["duration"] == simulation.time
            assert info["error"] == 0
            moved += 1
            if ended:
                break
    assert moved > 5


@pytest.mark.parametrize("offset", [-0.99, -0.5, 0.0, 0.3, 0.9])
def test_the_azimuth_of_an_action_is_the_sine_of_the_cut_angle(offset: float) -> None:
    tables = Tables(Pool(balls=2, **SQUARE), 1)
    positions = [POOL_TABLE.head_spot, (1.1, 0.9), POOL_TABLE.foot_spot]
    tables.begin(0, np.random.default_rng(), {"positions": positions})
    shot = tables.shots([0], np.array([[offset, 0.0, 0.0, 0.0]]), [np.random.default_rng()])[0]
    simulation = bs.Simulation(tables.scene(0))
    simulation.shoot(*shot.tolist())
    hit = next(event for event in simulation.run() if event.kind == "ball_ball")
    assert set(hit.balls) == {"cue", "1"}  # the nearest
    normal = np.array(hit.normal) * (1.0 if hit.balls[0] == "cue" else -1.0)  # from the other ball to the cue ball
    along = np.array([math.cos(shot[1]), math.sin(shot[1])])
    assert along[0] * normal[1] - along[1] * normal[0] == pytest.approx(offset, abs=1e-9)


def test_a_pot_is_worth_one_and_ends_the_game_of_one_ball() -> None:
    env = PoolEnv()
    env.reset(options=STRAIGHT)
    observation, reward, terminated, truncated, info = env.step(np.array([0.0, -0.3, 0.0, -0.9], np.float32))
    assert (reward, terminated, truncated) == (1.0, True, False)
    assert info["first_hit"] == 1
    np.testing.assert_array_equal(observation[3:], [0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="the game of table 0 is over"):
        env.step(np.zeros(4))


def test_a_game_goes_on_while_a_ball_is_left() -> None:
    env = PoolEnv(balls=2)
    env.reset(options={"positions": [*STRAIGHT["positions"], (0.5, 0.5)]})
    assert env.step(np.array([0.0, -0.3, 0.0, -0.9]))[1:3] == (1.0, False)


def test_a_scratch_is_worth_minus_one_and_ends_the_game_whatever_else_falls() -> None:
    env = PoolEnv()
    env.reset(options=STRAIGHT)
    observation, reward, terminated, _, _ = env.step(np.array([0.0, 0.3, 0.0, 1.0]))
    assert (reward, terminated) == (-1.0, True)
    assert not observation.any()


def test_what_does_not_fall_is_worth_nothing() -> None:
    env = PoolEnv()
    env.reset(options=STRAIGHT)
    assert env.step(np.array([0.9, -0.9, 0.0, 0.0]))[1:4] == (0.0, False, False)


def test_sum_to_three_counts_the_cushions_of_both_balls() -> None:
    env = SumToThreeEnv()
    random = np.random.default_rng(5)
    counted = []
    for _ in range(60):
        env.reset()
        tables = env._tables
        action = random.uniform(-1.0, 1.0, 4)
        shot = tables.shots([0], action[np.newaxis], [random])[0]
        simulation = bs.Simulation(tables.scene(0))
        simulation.shoot(*shot.tolist())
        events = simulation.run()
        cushions = sum(event.rail is not None for event in events)
        hit = any(len(event.balls) == 2 for event in events)
        _, reward, terminated, _, info = env.step(action)
        assert info["cushions"] == cushions
        assert reward == (1.0 if hit and cushions == 3 else 0.0)
        assert not terminated
        counted.append(cushions)
    assert min(counted) < 3 < max(counted)
    assert counted.count(3) > 5


def test_three_cushions_without_the_other_ball_do_not_score() -> None:
    task = SumToThree()
    speeds = np.linspace(0.5, 2.0, 40)
    result = bs.rollout(task.scene, bs.Shots(speeds, math.pi / 2), events=True)  # across, past the other ball
    assert (result.first_hit == NOBODY).all()
    verdict = task.judge(result, np.ones((40, 2), bool))
    assert 3 in verdict.infos["cushions"]
    assert not verdict.rewards.any()


BAD_ACTIONS = [
    ([1.5, 0.0, 0.0, 0.0], "azimuth of the action for table 0 must be >= -1 and <= 1, got 1.5"),
    ([0.0, 0.0, math.nan, 0.0], "side of the action for table 0 must be >= -1 and <= 1, got nan"),
    ([0.0, 0.0], r"actions must have shape \(4,\), got \(2,\)"),
    ("left", r"actions must be numbers of shape \(4,\), got 'left'"),
]


@pytest.mark.parametrize(("action", "reason"), BAD_ACTIONS)
def test_a_bad_action_is_refused_and_changes_nothing(action: Any, reason: str) -> None:
    env, other = PoolEnv(noise=bs.ShooterNoise.tournament()), PoolEnv(noise=bs.ShooterNoise.tournament())
    for one in (env, other):
        one.reset(seed=2)
    with pytest.raises(ValueError, match=reason):
        env.step(action)
    good = np.array([0.1, 0.2, 0.3, 0.4])
    np.testing.assert_array_equal(env.step(good)[0], other.step(good)[0])


BAD_OPTIONS = [
    ({"balls": 3}, "options of reset are positions and in_play, got balls"),
    ({"in_play": [True, True]}, "options of reset need positions beside in_play"),
    ({"positions": [(1.0, 1.0), (1.0, 1.01)]}, "overlap by 0.0471"),
    ({"positions": [(1.0, 1.0), (0.5, 0.5)], "in_play": [True, False]}, "must leave the cue ball and another one"),
    ({"positions": [(1.0, 1.0)]}, "2 names for 1 balls"),
]


@pytest.mark.parametrize(("options", "reason"), BAD_OPTIONS)
def test_bad_options_are_refused_and_change_nothing(options: dict[str, Any], reason: str) -> None:
    env = PoolEnv()
    env.reset(seed=2)
    before = env._tables.observations()
    with pytest.raises(ValueError, match=reason):
        env.reset(options=options)
    np.testing.assert_array_equal(env._tables.observations(), before)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: PoolEnv(balls=0), "balls must be a whole number from 1 to 15, got 0"),
        (lambda: PoolEnv(table="pool_9ft"), "table must be Table, got 'pool_9ft'"),
        (lambda: SumToThreeEnv(physics=None), "physics must be Physics, got None"),
        (lambda: PoolEnv().reset(options=3), "options of reset must be a dict or None, got 3"),
        (lambda: PoolVectorEnv(2).reset(seed=1.5), "seed must be a whole number, a list of 2, or None, got 1.5"),
        (lambda: PoolEnv(balls=True), "balls must be a whole number"),
        (lambda: PoolEnv(table=bs.Table()), "the table of pool must have pockets"),
        (lambda: PoolEnv(noise=0.1), "noise must be a ShooterNoise or None, got 0.1"),
        (lambda: PoolEnv(physics=POOL.pool(rolling_friction=0.0)), "rolling_friction"),
        (lambda: PoolEnv(render_mode="ansi"), "render_mode must be None or one of human, rgb_array, got 'ansi'"),
        (lambda: SumToThreeEnv(table=POOL_TABLE), "the table of sum to three must not have pockets"),
        (lambda: SumToThreeEnv(random_start=1), "random_start must be a bool, got 1"),
        (lambda: SumToThreeEnv(table=bs.Table(length=0.12, width=0.07)), "reaches 0.00075 m into a rail"),
        (lambda: Room(15, bs.Table(length=0.3, width=0.3), POOL), "15 balls of radius 0.028575 m find no room"),
    ],
)
def test_what_cannot_be_played_is_refused_when_it_is_made(make: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        make()


def test_random_starts_are_legal_and_follow_the_seed() -> None:
    task = Pool(balls=15)
    random, same = np.random.default_rng(1), np.random.default_rng(1)
    starts = [task.start(random) for _ in range(50)]
    for start in starts:
        bs.Scene(start, table=POOL_TABLE, physics=POOL)  # raises where they cannot lie like that
        np.testing.assert_array_equal(task.start(same), start)
    spread = np.concatenate(starts)
    half = 0.5 * np.array([POOL_TABLE.length, POOL_TABLE.width]) - POOL.radius
    uniform = half / math.sqrt(3.0)  # standard deviation
    np.testing.assert_allclose((spread - POOL_TABLE.centre).std(axis=0), uniform, rtol=0.1)


def test_noise_is_that_of_the_shooter() -> None:
    noise = bs.ShooterNoise(speed=0.05, azimuth=0.01, side=0.02, up=0.04)
    count = 2000
    tables, exact = Tables(Pool(noise=noise), 1), Tables(Pool(), 1)
    for one in (tables, exact):
        one.begin(0, np.random.default_rng(), STRAIGHT)
    random, action = np.random.default_rng(0), np.array([[0.2, 0.5, 0.1, -0.1]])
    meant = exact.shots([0], action, [random])[0]
    played = np.array([tables.shots([0], action, [random])[0] for _ in range(count)])
    errors = (played - meant)[:, :4] / [meant[0], 1.0, 1.0, 1.0]
    np.testing.assert_allclose(errors.std(axis=0), [0.05, 0.01, 0.02, 0.04], rtol=0.1)
    np.testing.assert_allclose(errors.mean(axis=0), 0.0, atol=0.04 * 4 / math.sqrt(count))
    assert np.abs(np.corrcoef(errors.T) - np.eye(4)).max() < 0.1
    np.testing.assert_array_equal(played[:, 4], 0.0)


def test_a_miscue_moves_nothing_and_is_told() -> None:
    env = PoolEnv(noise=bs.ShooterNoise(0.0, 0.0, 0.3, 0.3))
    before, _ = env.reset(seed=1, options=STRAIGHT)
    found = set()
    for _ in range(20):
        observation, reward, terminated, _, info = env.step(np.array([0.5, -1.0, 1.0, 1.0]))
        found.add(info["error"])
        if info["error"]:
            np.testing.assert_array_equal(observation, before)
            assert (reward, terminated, info["duration"], info["first_hit"]) == (0.0, False, 0.0, NOBODY)
        before = observation
    assert 2 in found


def test_a_picture_shows_the_balls_where_they_lie() -> None:
    pytest.importorskip("PIL")
    env = PoolEnv(render_mode="rgb_array")
    env.reset(options={"positions": [(1.0, 1.0), (2.0, 0.5)]})
    picture = env.render()
    (left, right), (low, _) = outline(POOL_TABLE).outer
    row, column = np.nonzero((picture > 200).all(axis=2) & (picture[..., :1] < 255).all(axis=2))
    scale = picture.shape[1] / (right - left)
    x, y = np.median(column) / scale + left, (picture.shape[0] - np.median(row)) / scale + low
    assert math.hypot(x - 1.0, y - 1.0) < 0.5 * POOL.radius  # white
    env.step(np.array([0.0, 0.0, 0.0, 0.0]))
    assert (env.render() != picture).any()


def test_without_a_display_human_says_so_once_and_goes_on(capsys: pytest.CaptureFixture[str]) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("PIL")
    from billiards_sim.gym import rendering

    matplotlib.use("agg")
    rendering._tell_once.cache_clear()
    for _ in range(2):
        env = PoolEnv(render_mode="human")
        env.reset(seed=1)
        env.step(np.zeros(4))
        assert env.render() is None
        env.close()
        env.close()
    assert capsys.readouterr().err == "billiards_sim: no display: nothing is shown (matplotlib's backend is agg)\n"


class Clock:
    """Stands for time itself: it goes on while a picture is shown."""

    def __init__(self) -> None:
        self.now = 0.0
        self.shown: list[tuple[Any, float]] = []

    def show(self, picture: Any, duration: float) -> None:
        self.shown.append((picture, duration))
        self.now += duration


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """That of a window, which is not there."""
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("PIL")
    from billiards_sim.gym import rendering

    matplotlib.use("agg")
    clock = Clock()
    monkeypatch.setattr(rendering.Window, "_show", lambda _, picture, duration: clock.show(picture, duration))
    monkeypatch.setattr(rendering.time, "monotonic", lambda: clock.now)
    return clock


def play_for_humans(env: PoolEnv) -> float:
    """A slow shot at two balls; how long it takes, s."""
    env.reset(options={"positions": [(1.0, 1.0), (1.2, 1.0)]})
    env._shown._there = True
    return float(env.step(np.array([0.0, -1.0, 0.0, 0.0]))[4]["duration"])


def test_a_window_shows_the_shot_in_its_own_time(clock: Clock) -> None:
    env = PoolEnv(render_mode="human")
    duration = play_for_humans(env)
    assert sum(seconds for _, seconds in clock.shown) == pytest.approx(duration, abs=0.05)
    assert len(clock.shown) == pytest.approx(30.0 * duration, abs=2.0)
    last = env._shown.picture(env._tables.scene(0), duration)
    assert (
        np.abs(clock.shown[-1][0].astype(int) - last).max(axis=2) > 60
    ).mean() < 1e-3  # but for how balls are turned
    env.close()


def test_a_window_opens_once_and_shows_the_latest_picture_pixel_by_pixel(monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("PIL")
    from matplotlib.figure import Figure

    matplotlib.use("agg")
    opened: list[Figure] = []
    monkeypatch.setattr(Figure, "show", lambda figure: opened.append(figure))
    env = PoolEnv(render_mode="human")
    env.reset(seed=1)
    env._shown._there = True
    for seed in (1, 2):
        env.reset(seed=seed)
        (figure,) = opened
        figure.canvas.draw()
        shown = np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)
        expected = env._shown.picture(env._tables.scene(0), 0.0)
        assert (np.abs(shown - expected).max(axis=2) > 0).mean() < 5e-4  # a ball has 8e-4
    env.close()
    assert not matplotlib.pyplot.get_fignums()


def test_a_window_leaves_out_what_it_is_too_late_for(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    from billiards_sim.gym import rendering

    slow = 5.0 / 30.0  # s that a picture takes to paint

    def paint(self: Any, pose: Any) -> Any:
        clock.now += slow
        return pose.time

    monkeypatch.setattr(rendering.Painter, "frame", paint)
    env = PoolEnv(render_mode="human")
    duration = play_for_humans(env)
    assert clock.now == pytest.approx(duration, abs=4.0 * slow)
    assert len(clock.shown) == pytest.approx(duration / slow, abs=4.0)
    assert clock.shown[-1][0] == pytest.approx(duration)  # the balls at rest are never left out
    env.close()
