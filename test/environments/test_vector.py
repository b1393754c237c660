# SPDX-License-Identifier: Apache-2.0
"""Many tables at a time: the bits of as many single ones."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.vector import AutoresetMode, SyncVectorEnv  # noqa: E402

import billiards_sim as bs  # noqa: E402
from billiards_sim.gym import PoolVectorEnv, SumToThreeVectorEnv  # noqa: E402

KINDS = [
    ("Pool", {"balls": 2, "noise": bs.ShooterNoise(0.1, 0.02, 0.1, 0.1)}),
    ("Pool", {}),
    ("SumToThree", {"random_start": True}),
]
SHOTS = 4


def assert_same(one: Any, other: Any) -> None:
    """Of infos: the same keys, values and types."""
    assert one.keys() == other.keys()
    for key, value in one.items():
        if isinstance(value, dict):
            assert_same(value, other[key])
        elif value.dtype == object:
            assert [row is None for row in value] == [row is None for row in other[key]]
            for row, same in zip(value, other[key]):
                np.testing.assert_array_equal(row, same)
        else:
            assert value.dtype == other[key].dtype, key
            np.testing.assert_array_equal(value, other[key], err_msg=key)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
@pytest.mark.parametrize(("name", "options"), KINDS)
def test_each_table_has_the_bits_of_a_single_environment(
    name: str, options: dict[str, Any], mode: AutoresetMode
) -> None:
    count = 6
    identity = f"billiards_sim.gym:billiards_sim/{name}-v0"
    vector = gymnasium.make_vec(identity, count, max_episode_steps=SHOTS, autoreset_mode=mode, **options)
    assert vector.metadata["autoreset_mode"] == mode
    singles = SyncVectorEnv(
        [lambda: gymnasium.make(identity, max_episode_steps=SHOTS, **options) for _ in range(count)],
        autoreset_mode=mode,
    )
    assert vector.single_action_space == singles.single_action_space
    assert vector.single_observation_space == singles.single_observation_space
    for one, other in zip(vector.reset(seed=3), singles.reset(seed=3)):
        np.testing.assert_array_equal(one, other)
    vector.action_space.seed(1)
    rewarded = ended = 0
    for _ in range(25):
        actions = vector.action_space.sample()
        found, expected = vector.step(actions), singles.step(actions)
        for one, other in zip(found[:4], expected[:4]):
            np.testing.assert_array_equal(one, other)
        assert_same(found[4], expected[4])
        assert found[0] in vector.observation_space
        rewarded += np.count_nonzero(found[1])
        ended += int((found[2] | found[3]).sum())
    assert rewarded > 0
    assert ended > count
    for one, other in zip(vector.reset(seed=[9, 8, 7, 6, 5, 4]), singles.reset(seed=[9, 8, 7, 6, 5, 4])):
        np.testing.assert_array_equal(one, other)


def test_gymnasium_takes_it_for_a_vector_with_an_episode_of_ten_shots() -> None:
    vector = gymnasium.make_vec("billiards_sim.gym:billiards_sim/SumToThree-v0", 3)
    assert isinstance(vector, SumToThreeVectorEnv)
    vector.reset(seed=1)
    truncated = [vector.step(np.zeros((3, 4)))[3].all() for _ in range(11)]
    assert truncated == [False] * 9 + [True, False]


def test_a_bad_action_is_refused_for_all_and_changes_nothing() -> None:
    vector, other = PoolVectorEnv(3), PoolVectorEnv(3)
    for one in (vector, other):
        one.reset(seed=1)
    actions = np.zeros((3, 4))
    bad = actions.copy()
    bad[1, 3] = -1.01
    with pytest.raises(ValueError, match="up of the action for table 1 must be >= -1 and <= 1, got -1.01"):
        vector.step(bad)
    for one, same in zip(vector.step(actions)[:4], other.step(actions)[:4]):
        np.testing.assert_array_equal(one, same)


def test_the_action_for_a_table_that_is_laid_anew_does_not_matter() -> None:
    vector = SumToThreeVectorEnv(2, max_episode_steps=1)
    start, _ = vector.reset(seed=1)
    assert vector.step(np.zeros((2, 4)))[3].all()
    observations, rewards, terminated, truncated, infos = vector.step(np.full((2, 4), np.nan))
    np.testing.assert_array_equal(observations, start)
    assert not rewards.any() and not terminated.any() and not truncated.any()
    assert infos == {}


def test_observations_are_not_written_to_later() -> None:
    vector = PoolVectorEnv(2, autoreset_mode="SameStep", max_episode_steps=1)
    first, _ = vector.reset(seed=1)
    kept = first.copy()
    second = vector.step(np.zeros((2, 4)))[0]
    kept_second = second.copy()
    vector.step(np.zeros((2, 4)))
    np.testing.assert_array_equal(first, kept)
    np.testing.assert_array_equal(second, kept_second)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: PoolVectorEnv(0), "num_envs must be a whole number >= 1, got 0"),
        (lambda: PoolVectorEnv(2, max_episode_steps=0), "max_episode_steps must be a whole number >= 1, got 0"),
        (lambda: PoolVectorEnv(2, autoreset_mode="Disabled"), "autoreset_mode must be NextStep or SameStep"),
        (lambda: PoolVectorEnv(2, render_mode="human"), "render_mode must be None or rgb_array, got 'human'"),
        (lambda: PoolVectorEnv(2).reset(seed=[1]), "seed must be a number or a list of 2, got 1"),
        (lambda: PoolVectorEnv(2).step(np.zeros((2, 4))), "reset must be called before step"),
    ],
)
def test_what_cannot_be_is_refused(make: Any, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        make()


def test_there_is_a_picture_of_each_table() -> None:
    pytest.importorskip("PIL")
    pytest.importorskip("tqdm")
    vector = PoolVectorEnv(2, render_mode="rgb_array")
    vector.reset(seed=1)
    one, other = vector.render() or ()
    assert one.shape == other.shape
    assert (one != other).any()
