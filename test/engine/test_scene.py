# SPDX-License-Identifier: Apache-2.0
"""Scenes: what is refused, and the built-in ones."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

import billiards_sim as bs

RADIUS = bs.Physics().radius
GOOD = [[0.5, 0.5], [1.0, 0.5]]


@pytest.mark.parametrize(
    "arguments, complaint",
    [
        ({"positions": []}, "at least one ball"),
        ({"positions": 3.0}, "at least one ball"),
        ({"positions": [[0.5, 0.5, 0.0]]}, r"positions must have shape \(1, 2\), got \(1, 3\)"),
        ({"positions": [["a", "b"]]}, r"positions must be numbers of shape \(1, 2\)"),
        ({"positions": [["0.5", "0.5"]]}, r"positions must be numbers of shape \(1, 2\), got \[\['0.5', '0.5'\]\]"),
        ({"positions": [[True, 0.5]]}, r"positions must be numbers of shape \(1, 2\), got \[\[True, 0.5\]\]"),
        ({"positions": [[0.5 + 0j, 0.5]]}, r"positions must be numbers of shape \(1, 2\)"),
        ({"positions": np.array([[0.5 + 1j, 0.5]])}, r"positions must be numbers of shape \(1, 2\)"),
        ({"positions": np.array([[True, True]])}, r"positions must be numbers of shape \(1, 2\)"),
        ({"positions": np.array([["0.5", "0.5"]])}, r"positions must be numbers of shape \(1, 2\)"),
        ({"positions": np.array([["0.5", "0.5"], ["1", "0.5"]])}, r"got array\(\[\['0.5', '0.5'\], \['1', '0.5'\]\]"),
        ({"positions": [[0.5, 0.5], [1.0]]}, r"positions must be numbers of shape \(2, 2\)"),
        ({"positions": [[10**400, 0.5]]}, r"positions must be numbers of shape \(1, 2\)"),
        ({"positions": [[0.5, math.nan]]}, "positions of ball 'cue' must be finite.*nan"),
        ({"positions": GOOD, "velocities": [[0.0, 0.0]]}, r"velocities must have shape \(2, 2\), got \(1, 2\)"),
        ({"positions": GOOD, "velocities": [[0, 0], [0, math.inf]]}, "velocities of ball '1' must be finite.*inf"),
        ({"positions": GOOD, "angular_velocities": [[0, 0]] * 2}, r"angular_velocities must have shape \(2, 3\)"),
        (
            {"positions": GOOD, "velocities": [[3e8, 0], [0, 0]]},
            "speed of ball 'cue' must be <= 2.9.*e.08 m/s, got 300000000",
        ),
        ({"positions": GOOD, "angular_velocities": [[0, 0, 0], [1e11, 0, 0]]}, "spin times radius of ball '1'"),
        ({"positions": GOOD, "names": ["a"]}, "1 names for 2 balls"),
        ({"positions": GOOD, "names": ["a", "a"]}, "two balls are named 'a'"),
        ({"positions": GOOD, "names": ["a", ""]}, "non-empty"),
        ({"positions": GOOD, "names": ["a", 7]}, "non-empty strings, got 7"),
        ({"positions": GOOD, "names": ["a", "\ud800"]}, r"free of control characters and surrogates, got '.ud800'"),
        ({"positions": GOOD, "names": ["a", "b\n"]}, r"free of control characters and surrogates, got 'b.n'"),
        ({"positions": GOOD, "names": ["a", "\u2028"]}, "free of control characters"),
        ({"positions": GOOD, "names": ["a", 101 * "b"]}, "at most 100 characters, got 101"),
        ({"positions": GOOD, "name": "\ud800"}, "name must be free of control characters and surrogates"),
        ({"positions": GOOD, "name": 3}, "name must be a str, got 3"),
        ({"positions": GOOD, "shot": bs.Shot((1, 0, 0), ball=9999 * "7")}, r"shot.ball '7+\.\.\. is not in the scene"),
        ({"positions": [[0.5, 0.5], [0.55, 0.5]]}, "'cue' and '1' overlap by 0.00715 m"),
        ({"positions": [[0.07, 0.5]]}, "'cue' reaches 0.009375 m into a rail: its x is 0.07"),
        ({"positions": [[0.5, 5.0]]}, "'cue' reaches .* into a rail: its y is 5"),
        ({"positions": GOOD, "physics": 3}, "physics must be a Physics"),
        ({"positions": GOOD, "shot": bs.Shot((1, 0, 0), ball="7")}, "shot.ball '7' is not in the scene"),
        ({"positions": [[0.07, 0.07]], "table": bs.Table(length=0.05)}, "do not fit"),
    ],
)
def test_bad_scene_is_refused_with_the_ball_and_the_figure(arguments, complaint) -> None:
    with pytest.raises(ValueError, match=complaint) as refusal:
        bs.Scene(**arguments)
    assert "\n" not in str(refusal.value)


def test_numbers_of_any_kind_are_positions() -> None:
    for positions in ([[1, Fraction(1, 2)]], np.array([[1, 0.5]], dtype=np.float32), [np.array([1.0, 0.5])]):
        assert bs.Scene(positions).positions.tolist() == [[1.0, 0.5]]


def test_touching_balls_are_a_scene() -> None:
    bs.Scene([[1.0, 0.5], [1.0 + 2.0 * RADIUS, 0.5]])
    bs.Scene([[0.0508 + RADIUS, 0.5]])


@pytest.mark.parametrize(
    "owner, field, value, complaint",
    [
        (bs.Physics, "mass", 0.0, r"physics.mass must be a number >= 1e-06, <= 1e\+06 \(kg\), got 0.0"),
        (bs.Physics, "rail_restitution", 1.5, "physics.rail_restitution must be a number >= 0, <= 1"),
        (bs.Physics, "sliding_friction", -0.1, "physics.sliding_friction must be a number >= 0"),
        (bs.Physics, "radius", 1e-160, r"physics.radius must be a number >= 1e-06, .*\(m\), got 1e-160"),
        (bs.Physics, "gravity", math.nan, "physics.gravity must be a number >= 1e-06"),
        (bs.Table, "length", "long", r"table.length must be a number > 0.*\(m\), got 'long'"),
        (bs.Physics, "mass", True, "physics.mass must be a number >= 1e-06.*got True"),
        (bs.Physics, "mass", 1j, "physics.mass must be a number >= 1e-06.*got 1j"),
        (bs.Physics, "mass", np.bool_(True), "physics.mass must be a number >= 1e-06"),
        (bs.Table, "width", math.inf, "table.width must be a number > 0"),
    ],
)
def test_constant_out_of_bounds_is_refused(owner, field, value, complaint) -> None:
    with pytest.raises(ValueError, match=complaint):
        owner(**{field: value})


@pytest.mark.parametrize("force", [("1", "0", "0"), (True, 0.0, 0.0), (1j, 0.0, 0.0), "100", 1.0, (1.0, 0.0), None])
def test_a_force_of_anything_but_three_numbers_is_refused(force) -> None:
    with pytest.raises(ValueError, match="force must be 3 numbers, got"):
        bs.Simulation(bs.Scene(GOOD)).strike(force)
    with pytest.raises(ValueError, match="shot.force must be 3 numbers, got"):
        bs.Shot(force)


def test_of_many_names_a_message_lists_the_first() -> None:
    scene = bs.scenes.random_balls(40, table=bs.Table(length=5.0, width=5.0))
    with pytest.raises(ValueError, match="no ball is named 'x'; the balls are cue, 1, .*, 29 and 10 more$"):
        bs.Simulation(scene).strike((1.0, 0.0, 0.0), ball="x")


def test_integers_are_taken_as_floats() -> None:
    assert isinstance(bs.Table(length=2).length, float)


def test_scene_arrays_are_copies_that_cannot_be_written() -> None:
    given = np.array(GOOD)
    scene = bs.Scene(given)
    given[0, 0] = 0.7
    assert scene.positions[0, 0] == 0.5
    with pytest.raises(ValueError, match="read-only"):
        scene.positions[0, 0] = 0.7


def test_default_names() -> None:
    assert bs.scenes.rack().names == ("cue", *map(str, range(1, 16)))


@pytest.mark.parametrize("gap", [0.0, 1e-4, 1e-3])
def test_rack_is_a_triangle_on_the_foot_spot(gap: float) -> None:
    scene = bs.scenes.rack(gap)
    table = scene.table
    assert scene.positions[0] == pytest.approx(table.head_spot)
    rack = scene.positions[1:]
    apex = rack[np.argmin(rack[:, 0])]
    assert apex == pytest.approx(table.foot_spot)
    third_row = table.foot_spot[0] + 2.0 * math.sqrt(0.75) * (2.0 * RADIUS + gap)
    assert scene.positions[8] == pytest.approx([third_row, table.foot_spot[1]], abs=1e-12)  # the 8 in the middle
    distances = np.hypot(*(rack[:, np.newaxis] - rack).T)[np.triu_indices(15, 1)]
    neighbours = np.sort(distances)[:30]
    assert neighbours == pytest.approx(np.full(30, 2.0 * RADIUS + gap), abs=2e-15)
    back = np.flatnonzero(rack[:, 0] > rack[:, 0].max() - 1e-9) + 1
    corners = back[[np.argmin(scene.positions[back, 1]), np.argmax(scene.positions[back, 1])]]
    assert {bool(number < 8) for number in corners} == {True, False}  # a solid and a stripe


def test_rack_is_mirror_symmetric_to_the_last_bit() -> None:
    scene = bs.scenes.rack(0.0)
    aside = scene.positions[1:, 1] - scene.table.centre[1]
    assert sorted(zip(scene.positions[1:, 0], aside, strict=True)) == sorted(
        zip(scene.positions[1:, 0], -aside, strict=True)
    )


WPA_9FT = bs.Table(length=2.54, width=1.27, rail_thickness=0.127)


@pytest.mark.parametrize("name, make", bs.scenes.BUILT_IN.items(), ids=bs.scenes.BUILT_IN)
def test_built_in_scenes_are_laid_out_for_the_table_and_the_physics_given(name, make) -> None:
    physics = bs.Physics(mass=0.17, radius=0.03)
    table = bs.Table(length=3.6, width=1.8, rail_thickness=0.127) if name == "snooker" else WPA_9FT
    scene = make(table=table, physics=physics)
    assert (scene.table, scene.physics) == (table, physics)
    same = make(table=make().table, physics=make().physics)
    assert np.array_equal(same.positions, make().positions)
    assert np.array_equal(same.velocities, make().velocities)


def test_the_rack_stands_on_the_foot_spot_of_another_table() -> None:
    scene = bs.scenes.rack(table=WPA_9FT, physics=bs.Physics(radius=0.03))
    assert scene.positions[0] == pytest.approx([0.127 + 0.635, 0.127 + 0.635], abs=1e-12)
    assert scene.positions[1] == pytest.approx([0.127 + 1.905, 0.127 + 0.635], abs=1e-12)
    assert np.hypot(*(scene.positions[9] - scene.positions[1])) == pytest.approx(0.0601, abs=1e-12)


def test_random_balls_fill_another_table() -> None:
    positions = bs.scenes.random_balls(200, table=bs.Table(length=20.0, width=10.0)).positions
    assert positions[:, 0].max() > 15.0
    assert positions[:, 1].max() > 7.5


@pytest.mark.parametrize("make", bs.scenes.BUILT_IN.values(), ids=bs.scenes.BUILT_IN)
def test_a_table_too_small_for_a_built_in_scene_is_refused(make) -> None:
    with pytest.raises(ValueError, match="ball"):
        make(table=bs.Table(length=0.5, width=0.05))


@pytest.mark.parametrize("gap", [-1e-6, math.nan, math.inf, "1"])
def test_bad_gap_is_refused(gap) -> None:
    with pytest.raises(ValueError, match="gap must be a finite number >= 0"):
        bs.scenes.rack(gap)


def test_random_balls_are_the_same_for_the_same_seed() -> None:
    one, same, other = (bs.scenes.random_balls(20, seed) for seed in (1, 1, 2))
    assert np.array_equal(one.positions, same.positions)
    assert np.array_equal(one.velocities, same.velocities)
    assert not np.array_equal(one.positions, other.positions)
    assert np.abs(one.velocities).max() <= 7.0
    assert (one.velocities < 0.0).any() and (one.velocities > 0.0).any()


@pytest.mark.parametrize("count, complaint", [(0, "count must be"), (2.5, "count must be"), (100_000, "no room")])
def test_impossible_count_is_refused(count, complaint) -> None:
    with pytest.raises(ValueError, match=complaint):
        bs.scenes.random_balls(count)
