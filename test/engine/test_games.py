# SPDX-License-Identifier: Apache-2.0
"""Games as they begin: which ball lies where by the rules, on which table."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.engine.scenes import BUILT_IN

POOL_GAMES = {"eight_ball": 15, "nine_ball": 9, "ten_ball": 10, "straight_pool": 15}
RACKED: dict[str, Callable[..., bs.Scene]] = {name: BUILT_IN[name] for name in (*POOL_GAMES, "snooker")}
REDS = [f"red{number}" for number in range(1, 16)]


def place(scene: bs.Scene, name: str) -> Any:
    return scene.positions[scene.names.index(name)]


def racked(scene: bs.Scene) -> list[str]:
    return REDS if scene.name == "snooker" else [name for name in scene.names if name != "cue"]


def gaps(scene: bs.Scene, names: list[str]) -> Any:
    """m, between the surfaces of each two of some balls, in order."""
    places = np.array([place(scene, name) for name in names])
    one, other = np.triu_indices(len(names), 1)
    return np.sort(np.hypot(*(places[one] - places[other]).T)) - 2.0 * scene.physics.radius


@pytest.mark.parametrize("name", BUILT_IN)
def test_a_scene_is_called_as_it_is_found(name: str) -> None:
    assert BUILT_IN[name]().name == name


@pytest.mark.parametrize("name", POOL_GAMES)
def test_pool_is_played_on_a_9_ft_table_with_the_physics_of_pool(name: str) -> None:
    scene = BUILT_IN[name]()
    assert (scene.table, scene.physics) == (bs.Table.pool_9ft(), bs.Physics.pool())
    assert scene.names == ("cue", *(str(number) for number in range(1, POOL_GAMES[name] + 1)))
    assert not scene.velocities.any()
    head_x, middle_y = scene.table.head_spot
    assert place(scene, "cue")[1] == middle_y
    assert place(scene, "cue")[0] < head_x - scene.physics.radius  # behind the head string
    assert min(scene.positions[1:, 0]) == scene.table.foot_spot[0]


@pytest.mark.parametrize("name, neighbours", [("eight_ball", 30), ("nine_ball", 16), ("ten_ball", 18)])
def test_racks_have_the_gap_between_all_neighbours(name: str, neighbours: int) -> None:
    scene = BUILT_IN[name](3e-4)
    between = gaps(scene, racked(scene))
    assert between[:neighbours] == pytest.approx(3e-4, abs=2e-15)
    assert between[neighbours] > 0.02


def test_eight_ball_is_racked_by_the_rules() -> None:
    scene = bs.scenes.eight_ball()
    third_row = 2.0 * math.sqrt(0.75) * (2.0 * scene.physics.radius + 1e-4)
    assert place(scene, "8") == pytest.approx(np.add(scene.table.foot_spot, (third_row, 0.0)), abs=1e-12)
    corners = corner_balls(scene)
    assert {number < 8 for number in corners} == {True, False}


def corner_balls(scene: bs.Scene) -> list[int]:
    """Of the last row, at low and at high y."""
    back = max(place(scene, name)[0] for name in racked(scene))
    row = [name for name in racked(scene) if place(scene, name)[0] == back]
    return [int(pick(row, key=lambda name: place(scene, name)[1])) for pick in (min, max)]


def test_nine_ball_is_racked_by_the_rules() -> None:
    scene = bs.scenes.nine_ball(0.0)
    assert place(scene, "1").tolist() == list(scene.table.foot_spot)
    diamond = np.array([place(scene, name) for name in racked(scene)])
    assert place(scene, "9") == pytest.approx(diamond.mean(axis=0), abs=1e-12)
    reach = 4.0 * math.sqrt(0.75) * 2.0 * scene.physics.radius
    assert np.ptp(diamond, axis=0) == pytest.approx([reach, 4.0 * scene.physics.radius], abs=1e-12)


def test_ten_ball_is_racked_by_the_rules() -> None:
    scene = bs.scenes.ten_ball()
    assert place(scene, "1").tolist() == list(scene.table.foot_spot)
    triangle = np.array([place(scene, name) for name in racked(scene)])
    assert place(scene, "10") == pytest.approx(triangle.mean(axis=0), abs=1e-12)
    assert sorted(corner_balls(scene)) == [2, 3]


def test_snooker_is_laid_out_by_the_rules() -> None:
    scene = bs.scenes.snooker(2e-4)
    table, radius = scene.table, scene.physics.radius
    assert (table, scene.physics) == (bs.Table.snooker_12ft(), bs.Physics.snooker())
    middle_y = table.centre[1]
    baulk = table.x_min + 0.737
    assert place(scene, "brown") == pytest.approx([baulk, middle_y])
    assert place(scene, "yellow") == pytest.approx([baulk, middle_y - 0.292])  # right of one who looks up the table
    assert place(scene, "green") == pytest.approx([baulk, middle_y + 0.292])
    assert place(scene, "blue") == pytest.approx(table.centre)
    assert place(scene, "black") == pytest.approx([table.x_max - 0.324, middle_y])
    pink = place(scene, "pink")
    assert pink == pytest.approx([0.5 * (table.centre[0] + table.x_max), middle_y])
    reds = np.array([place(scene, name) for name in REDS])
    apex = reds[np.argmin(reds[:, 0])]
    assert apex == pytest.approx([pink[0] + 2.0 * radius + 2e-4, middle_y], abs=1e-12)
    assert gaps(scene, REDS)[:30] == pytest.approx(2e-4, abs=2e-15)
    cue = place(scene, "cue")
    assert cue[0] <= baulk and math.dist(cue, place(scene, "brown")) <= 0.292


def test_three_cushion_begins_by_the_rules() -> None:
    scene = bs.scenes.three_cushion()
    assert (scene.table, scene.physics) == (bs.Table.carom_10ft(), bs.Physics.carom())
    assert scene.names == ("cue", "yellow", "red")
    assert place(scene, "yellow") == pytest.approx(scene.table.head_spot)
    assert place(scene, "red") == pytest.approx(scene.table.foot_spot)
    assert place(scene, "cue") == pytest.approx(np.subtract(scene.table.head_spot, (0.0, 0.1825)))


@pytest.mark.parametrize("name", RACKED)
def test_a_loose_rack_has_wider_gaps_and_is_the_same_for_the_same_seed(name: str) -> None:
    make = RACKED[name]
    tight, loose, same, other = make(1e-4), make(1e-4, 1e-3), make(1e-4, 1e-3, 1), make(1e-4, 1e-3, 2)
    assert np.array_equal(loose.positions, same.positions)
    assert not np.array_equal(loose.positions, other.positions)
    assert not np.array_equal(loose.positions, tight.positions)
    for scene in (loose, other):
        between = gaps(scene, list(scene.names))
        assert between[0] >= 1e-4 - 1e-12
        neighbours = between[between < 5e-3]
        assert neighbours.max() <= 1e-4 + 2e-3
        assert np.ptp(neighbours) > 3e-4
    colours = [ball for ball in loose.names if ball not in racked(loose)]
    for ball in colours:
        assert np.array_equal(place(loose, ball), place(tight, ball))


@pytest.mark.parametrize("name", RACKED)
@pytest.mark.parametrize("field", ["gap", "looseness"])
@pytest.mark.parametrize("bad", [-1e-6, math.nan, math.inf, "1", None])
def test_bad_gaps_are_refused(name: str, field: str, bad: Any) -> None:
    with pytest.raises(ValueError, match=f"{field} must be a finite number >= 0"):
        RACKED[name](**{field: bad})


def test_the_pink_does_not_touch_the_reds() -> None:
    with pytest.raises(ValueError, match="gap must be > 0: the pink does not touch the reds"):
        bs.scenes.snooker(0.0)


@pytest.mark.parametrize("name", [*RACKED, "three_cushion"])
def test_a_game_can_be_begun(name: str) -> None:
    simulation = bs.Simulation(BUILT_IN[name]())
    target = place(simulation.start_scene, "yellow" if name == "three_cushion" else racked(simulation.start_scene)[0])
    away = target - place(simulation.start_scene, "cue")
    simulation.shoot(6.0, math.atan2(away[1], away[0]) + 0.003)
    events = simulation.run()
    assert simulation.at_rest
    assert sum(event.kind == "ball_ball" for event in events) > (0 if name == "three_cushion" else 10)
