# SPDX-License-Identifier: Apache-2.0
"""A short version of the soak: random, dense and touching scenes, and breaks, checked until rest."""

from __future__ import annotations

import pytest
from checks import COMPILED
from soak import (
    broken_laws,
    run_break,
    run_elastic_break,
    run_elastic_scene,
    run_game,
    run_pool_break,
    run_pool_scene,
    run_scene,
    run_shot,
)

SHARE = 20 if COMPILED else 1


@pytest.mark.parametrize("first", range(0, 5 * SHARE, 5))
def test_scenes_keep_the_laws_until_rest(first: int) -> None:
    for seed in range(first, first + 5):
        assert broken_laws(run_scene(seed)) == [], seed


@pytest.mark.parametrize("first", range(0, 5 * SHARE, 5))
def test_breaks_of_every_kind_keep_the_laws_until_rest(first: int) -> None:
    for seed in range(first, first + 5):
        assert broken_laws(run_break(seed)) == [], seed


@pytest.mark.parametrize("first", range(0, 5 * SHARE, 5))
def test_scenes_and_breaks_with_every_effect_keep_the_laws_until_rest(first: int) -> None:
    for seed in range(first, first + 5):
        assert broken_laws(run_pool_scene(seed)) == [], seed
        assert broken_laws(run_pool_break(seed)) == [], seed


@pytest.mark.parametrize("first", range(0, 5 * SHARE, 5))
def test_elastic_scenes_and_breaks_keep_the_laws_until_rest(first: int) -> None:
    for seed in range(first, first + 5):
        assert broken_laws(run_elastic_scene(seed)) == [], seed
        assert broken_laws(run_elastic_break(seed)) == [], seed


@pytest.mark.parametrize("first", range(0, 5 * SHARE, 5))
def test_breaks_of_games_and_shots_at_pockets_keep_the_laws_until_rest(first: int) -> None:
    for seed in range(first, first + 5):
        assert broken_laws(run_game(seed)) == [], seed
        assert broken_laws(run_shot(seed)) == [], seed


@pytest.mark.parametrize("seed", [203, 353])
def test_clusters_at_a_rail_gain_no_energy(seed: int) -> None:
    # Rails give less back than balls do; solved together they would give more than was there.
    assert broken_laws(run_scene(seed)) == []


def test_ball_that_hardly_moves_sets_off_without_pressing_into_its_neighbour() -> None:
    # Pushed, nearly at rest: its direction turns within the step.
    assert broken_laws(run_break(13482)) == []


@pytest.mark.parametrize("seed", [1131, 2365])
def test_slow_elastic_contacts_beside_fast_ones_leave_no_overlap(seed: int) -> None:
    # Balls between a rail and one that presses somebody else had no room to part.
    assert broken_laws(run_elastic_scene(seed)) == []
