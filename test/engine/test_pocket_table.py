# SPDX-License-Identifier: Apache-2.0
"""Tables with pockets: what makes one, what lies on it, and balls that are laid down again."""

from __future__ import annotations

import copy
import math
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import billiards_sim as bs

INCH = 0.0254
POOL_9FT = bs.Table.pool_9ft()
X_MIN, Y_MIN = POOL_9FT.x_min, POOL_9FT.y_min
RADIUS = bs.Physics().radius
CORNER: dict[str, float] = {
    "mouth": 4.5 * INCH,
    "cut_angle": math.radians(142.0),
    "shelf": 1.625 * INCH,
    "point_radius": 0.003,
    "slate_radius": 0.062,
}
SIDE: dict[str, float] = {
    "mouth": 5.0 * INCH,
    "cut_angle": math.radians(104.0),
    "shelf": 0.1875 * INCH,
    "point_radius": 0.003,
    "slate_radius": 0.0645,
}


def corner_table(**changed: float) -> bs.Table:
    return bs.Table(length=2.54, width=1.27, corner_pocket=bs.Pocket(**{**CORNER, **changed}))


def side_table(**changed: float) -> bs.Table:
    return bs.Table(length=2.54, width=1.27, side_pocket=bs.Pocket(**{**SIDE, **changed}))


@pytest.mark.parametrize(
    "table, length, width, nose_height",
    [
        (bs.Table.pool_9ft(), 100 * INCH, 50 * INCH, 0.635),
        (bs.Table.pool_8ft(), 92 * INCH, 46 * INCH, 0.635),
        (bs.Table.pool_7ft(), 78 * INCH, 39 * INCH, 0.635),
        (bs.Table.snooker_12ft(), 3.569, 1.778, 0.7),
        (bs.Table.carom_10ft(), 2.84, 1.42, 37.0 / 61.5),
    ],
)
def test_tables_of_real_games_have_their_measures(
    table: bs.Table, length: float, width: float, nose_height: float
) -> None:
    assert (table.length, table.width) == pytest.approx((length, width), rel=1e-15)
    assert table.nose_height == nose_height
    assert len(table.mouths) == (0 if table == bs.Table.carom_10ft() else 6)
    radius = {3.569: 0.02625, 2.84: 0.03075}.get(length, RADIUS)
    assert len(bs.Scene([table.centre], table=table, physics=bs.Physics(radius=radius))) == 1


def test_pockets_of_a_pool_table_are_the_wpas() -> None:
    assert POOL_9FT.corner_pocket == bs.Pocket(**CORNER)
    assert POOL_9FT.side_pocket == bs.Pocket(**SIDE)
    assert POOL_9FT.jaw_depth == 2.0 * INCH


def test_single_values_of_a_real_table_can_be_changed() -> None:
    table = bs.Table.pool_9ft(nose_height=0.6, side_pocket=None)
    assert table == replace(POOL_9FT, nose_height=0.6, side_pocket=None)
    assert [mouth.name for mouth in table.mouths] == ["x_min_y_min", "x_min_y_max", "x_max_y_min", "x_max_y_max"]


def test_a_table_without_pockets_has_none() -> None:
    assert bs.Table().mouths == ()
    assert (bs.Table().corner_pocket, bs.Table().side_pocket) == (None, None)


@pytest.mark.parametrize("make", [corner_table, side_table])
@pytest.mark.parametrize(
    "field, value",
    [
        ("mouth", 0.0),
        ("mouth", math.nan),
        ("cut_angle", 1.5),
        ("cut_angle", 3.1),
        ("shelf", -1e-9),
        ("point_radius", 0.0),
        ("slate_radius", -1.0),
        ("slate_radius", math.inf),
    ],
)
def test_values_out_of_bounds_are_refused(make: Any, field: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"pocket.{field} must be a number .*, got "):
        make(**{field: value})


def test_other_than_a_pocket_is_refused() -> None:
    with pytest.raises(ValueError, match="table.corner_pocket must be a Pocket or None, got 0.1"):
        bs.Table(corner_pocket=0.1)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "make, complaint",
    [
        (lambda: corner_table(cut_angle=2.9), r"jaws of table.corner_pocket cross: mouth 0.1143 m, cut_angle 2.9 rad"),
        (lambda: side_table(cut_angle=2.6), r"jaws of table.side_pocket cross: mouth 0.127 m"),
        (lambda: corner_table(mouth=0.9), r"table.width 1.27 m leaves no nose between its pockets"),
        (lambda: side_table(mouth=2.6), r"table.length 2.54 m leaves no nose between its pockets"),
        (
            lambda: bs.Table(
                length=2.0,
                width=2.0,
                corner_pocket=bs.Pocket(1.0, 2.0, 0.1, 0.01, 1.0),
                side_pocket=bs.Pocket(0.6, 2.0, 0.1, 0.01, 1.0),
            ),
            "table.length 2 m leaves no nose",
        ),
        (lambda: corner_table(point_radius=0.3), r"jaws of table.corner_pocket do not begin: its points reach 0.0635"),
    ],
)
def test_pockets_that_do_not_fit_are_refused(make: Any, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        make()


@pytest.mark.parametrize(
    "table, complaint",
    [
        (
            corner_table(mouth=2.0 * RADIUS),
            r"pocket x_min_y_min: its mouth of 0.05715 m must be wider than a ball of 0.05715",
        ),
        (side_table(mouth=0.05), r"pocket y_min: its mouth of 0.05 m must be wider than a ball of 0.05715 m"),
        (
            side_table(slate_radius=0.02),
            r"pocket y_min: a ball of radius 0.028575 m that runs along a jaw must fall before the jaw ends",
        ),
        (
            corner_table(cut_angle=1.6),
            r"pocket x_min_y_min: a ball .* must fall before the jaw ends, there it is 0.0851767",
        ),
        (corner_table(shelf=0.016), r"pocket x_min_y_min: its circle of radius 0.062 m reaches into the playing area"),
    ],
)
def test_pockets_that_do_not_take_the_balls_are_refused(table: bs.Table, complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        bs.Scene([[1.0, 0.5]], table=table)


def test_the_reasons_hold_for_the_balls_that_are_there() -> None:
    small = bs.Physics(radius=0.02)
    assert bs.Scene([[1.0, 0.5]], table=side_table(mouth=0.05), physics=small).table.side_pocket is not None


@pytest.mark.parametrize(
    "place, complaint",
    [
        ((0.01, 0.01), r"lies in the pocket x_min_y_min: 0.0602671 m from the middle of the circle .* 0.062 m"),
        ((1.27, -0.01), r"lies in the pocket y_min: 0.0592625 m from the middle of the circle"),
        ((1.27, -0.09), r"lies in the pocket y_min"),
        ((1.27, -0.5), r"reaches 0.0879222 m into y_min_jaw_x_min"),
        ((-0.3, -0.3), r"reaches 0.\d* m into x_min_y_min_jaw|lies in the pocket x_min_y_min"),
        ((0.07, 0.02), r"reaches [\d.]* m into x_min_y_min_(jaw|point)_y_min"),
        ((0.02, 0.07), r"reaches [\d.]* m into x_min_y_min_(jaw|point)_x_min"),
        ((1.225, 0.01), r"reaches [\d.]* m into y_min_(jaw|point)_x_min"),
        ((1.315, 0.01), r"reaches [\d.]* m into y_min_(jaw|point)_x_max"),
        ((1.315, 1.26), r"reaches [\d.]* m into y_max_(jaw|point)_x_max"),
        ((0.5, 0.02), r"reaches 0.008575 m into the rail y_min"),
        ((2.53, 0.6), r"reaches 0.018575 m into the rail x_max"),
    ],
)
def test_a_ball_in_a_pocket_or_in_its_rubber_is_no_scene(place: tuple[float, float], complaint: str) -> None:
    at = rf"ball 'cue' at \({X_MIN + place[0]:.9g}, {Y_MIN + place[1]:.9g}\) "
    with pytest.raises(ValueError, match=at + f"({complaint})"):
        bs.Scene([[X_MIN + place[0], Y_MIN + place[1]]], table=POOL_9FT)


@pytest.mark.parametrize("place", [(0.02, 0.02), (1.27, 0.005), (0.0316, 0.0816), (1.27, 1.262), (RADIUS, 0.6)])
def test_a_ball_may_lie_in_a_mouth(place: tuple[float, float]) -> None:
    simulation = bs.Simulation(bs.Scene([[X_MIN + place[0], Y_MIN + place[1]]], table=POOL_9FT))
    assert list(simulation.advance(5.0)) == []
    assert simulation.in_play.all()


def after_a_scratch() -> bs.Simulation:
    """The cue ball has fallen, the other one rests."""
    scene = bs.Scene([[X_MIN + 1.27, Y_MIN + 0.3], [X_MIN + 0.6, Y_MIN + 0.6]], table=POOL_9FT)
    simulation = bs.Simulation(scene)
    simulation.shoot(2.0, -0.5 * math.pi)
    assert simulation.run()[-1].pocket == "y_min"
    return simulation


def test_a_pocketed_ball_can_come_back() -> None:
    simulation = after_a_scratch()
    time, other = simulation.time, simulation.positions[1].tobytes()
    simulation.place({"cue": (0.5, 0.6)})
    assert simulation.time == time
    assert simulation.in_play.tolist() == [True, True]
    assert simulation.positions[0].tolist() == [0.5, 0.6]
    assert simulation.positions[1].tobytes() == other
    assert simulation.at_rest
    assert list(simulation.run()) == []
    simulation.shoot(2.0, math.atan2(Y_MIN, X_MIN + 0.1))
    assert [event.balls for event in simulation.run() if event.kind == "ball_ball"][0] == ("cue", "1")


def test_a_ball_in_play_can_be_laid_elsewhere_while_others_move() -> None:
    scene = bs.Scene(
        [[0.4, 0.6], [1.0, 0.6], [1.6, 0.9]], [[0.0, 0.0], [0.0, 0.0], [1.0, -0.3]], table=POOL_9FT, name="three"
    )
    simulation, undisturbed = bs.Simulation(scene), bs.Simulation(scene)
    simulation.advance(0.2)
    simulation.place({"cue": (0.4, 0.9)})
    assert simulation.time == 0.2
    assert simulation.positions[0] == pytest.approx([0.4, 0.9], abs=1e-15)
    simulation.run()
    undisturbed.run()
    assert np.array_equal(simulation.positions[1:], undisturbed.positions[1:])
    assert simulation.scene().positions[0] == pytest.approx([0.4, 0.9], abs=1e-15)


def test_a_moving_ball_that_is_laid_down_is_not_met_where_it_would_have_been() -> None:
    scene = bs.Scene([[0.4, 0.6], [1.0, 0.6]], [[2.0, 0.0], [0.0, 0.0]], table=POOL_9FT)
    simulation = bs.Simulation(scene)
    simulation.advance(0.1)
    simulation.place({"cue": (0.4, 0.9)})
    assert [event for event in simulation.run() if event.kind == "ball_ball"] == []
    assert simulation.positions[1].tolist() == [1.0, 0.6]
    simulation = bs.Simulation(scene)
    simulation.advance(0.1)
    simulation.place({"1": (0.4, 0.9)})  # the one that would have been hit
    assert [event for event in simulation.run(until=1.0) if event.kind == "ball_ball"] == []


def test_a_moving_ball_meets_one_that_is_laid_in_its_way() -> None:
    simulation = bs.Simulation(bs.Scene([[0.4, 0.6], [1.0, 0.9]], [[2.0, 0.0], [0.0, 0.0]], table=POOL_9FT))
    simulation.advance(0.1)
    simulation.place({"1": (1.0, 0.6)})
    event = [event for event in simulation.run(until=1.0) if event.kind == "ball_ball"][0]
    assert (event.kind, event.balls) == ("ball_ball", ("cue", "1"))
    assert event.point[0] == pytest.approx(1.0 - RADIUS, abs=1e-12)


@pytest.mark.parametrize(
    "positions, complaint",
    [
        ({"cue": (X_MIN + 0.6, Y_MIN + 0.65)}, "balls 'cue' and '1' overlap"),
        ({"cue": (X_MIN, Y_MIN)}, "ball 'cue' at .* lies in the pocket x_min_y_min"),
        ({"cue": (-1.0, 0.5)}, "ball 'cue' at .* reaches"),
        ({"9": (0.5, 0.5)}, "no ball is named '9'; the balls are cue, 1"),
        ({"cue": (0.5,)}, "position of ball 'cue' must be 2 numbers"),
        ({"cue": (0.5, math.nan)}, "positions of ball 'cue' must be finite"),
        ({"cue": "no"}, "position of ball 'cue' must be 2 numbers"),
        ([("cue", (0.5, 0.5))], "positions must be a map of names"),
    ],
)
def test_where_no_ball_can_lie_none_is_laid(positions: Any, complaint: str) -> None:
    simulation = after_a_scratch()
    before, twin = simulation.positions.tobytes(), simulation.copy()
    with pytest.raises(ValueError, match=complaint):
        simulation.place(positions)
    assert simulation.positions.tobytes() == before
    assert simulation.in_play.tolist() == [False, True]
    for same in (simulation, twin):
        same.shoot(2.0, 3.0, ball="1")
    assert list(simulation.run()) == list(twin.run())


def test_laying_down_is_kept_by_copies_and_snapshots_and_undone_by_restoring() -> None:
    simulation = after_a_scratch()
    before = simulation.snapshot()
    simulation.place({"cue": (0.5, 0.6)})
    simulation.shoot(2.0, 0.3)
    twins = [simulation.copy(), copy.deepcopy(simulation), pickle.loads(pickle.dumps(simulation))]
    expected = list(simulation.run())
    for twin in twins:
        assert list(twin.run()) == expected
        assert twin.positions.tobytes() == simulation.positions.tobytes()
    simulation.restore(before)
    assert simulation.in_play.tolist() == [False, True]


def test_two_balls_may_swap_places() -> None:
    simulation = bs.Simulation(bs.Scene([[0.4, 0.6], [1.0, 0.6]], table=POOL_9FT))
    simulation.place({"cue": (1.0, 0.6), "1": (0.4, 0.6)})
    assert simulation.positions.tolist() == [[1.0, 0.6], [0.4, 0.6]]


def test_scenes_and_files_keep_pockets_and_what_has_fallen(tmp_path: Path) -> None:
    simulation = after_a_scratch()
    scene = simulation.scene()
    assert scene.in_play.tolist() == [False, True]
    assert np.isnan(scene.positions[0]).all()
    bs.save_scene(scene, tmp_path / "scene.yaml")
    loaded = bs.load_scene(tmp_path / "scene.yaml")
    assert loaded == scene
    assert loaded.table == POOL_9FT
    again = bs.Simulation(loaded)
    again.place({"cue": (0.5, 0.6)})
    assert again.in_play.all()


def test_a_file_may_give_a_pocket(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    pocket = ", ".join(f"{name}: {value!r}" for name, value in CORNER.items())
    file.write_text(
        f"table: {{length: 2.54, width: 1.27, corner_pocket: {{{pocket}}}}}\nballs: [{{name: a, position: [1, 0.5]}}]\n"
    )
    assert bs.load_scene(file).table == corner_table()


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("corner_pocket: {mouth: 0.1}", "table.corner_pocket lacks cut_angle, shelf, point_radius, slate_radius"),
        ("corner_pocket: {depth: 0.1}", "table.corner_pocket has no field 'depth'; known: mouth, cut_angle"),
        ("side_pocket: 0.1", "table.side_pocket must be a mapping of names to numbers, got 0.1"),
        (
            "side_pocket: {mouth: wide, cut_angle: 2, shelf: 0, point_radius: 0.1, slate_radius: 0.1}",
            "table.side_pocket: pocket.mouth must be a number",
        ),
    ],
)
def test_a_file_with_half_a_pocket_is_refused(text: str, complaint: str, tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(f"table: {{{text}}}\nballs: [{{name: a, position: [1, 0.5]}}]\n")
    with pytest.raises(ValueError, match=complaint):
        bs.load_scene(file)


@pytest.mark.parametrize(
    "text, table",
    [
        ("pool_9ft", POOL_9FT),
        ("{preset: snooker_12ft}", bs.Table.snooker_12ft()),
        (
            "{preset: pool_9ft, nose_height: 0.6, side_pocket: null}",
            replace(POOL_9FT, nose_height=0.6, side_pocket=None),
        ),
        (
            "{preset: pool_7ft, corner_pocket: {mouth: 0.12}}",
            replace(bs.Table.pool_7ft(), corner_pocket=bs.Pocket(**{**CORNER, "mouth": 0.12})),
        ),
    ],
)
def test_a_file_may_name_a_real_table(text: str, table: bs.Table, tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text(f"table: {text}\nballs: [{{name: a, position: [1, 0.5]}}]\n")
    assert bs.load_scene(file).table == table


def test_an_unknown_table_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "scene.yaml"
    file.write_text("table: pool_10ft\nballs: [{name: a, position: [1, 0.5]}]\n")
    with pytest.raises(ValueError, match="table.preset must be one of pool_9ft, pool_8ft, .* got 'pool_10ft'"):
        bs.load_scene(file)
