# SPDX-License-Identifier: Apache-2.0
"""Balls that fall into pockets, in pictures and movies."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from extras import needs_plot_extra

import billiards_sim as bs
from billiards_sim.outline import outline
from billiards_sim.study import simulate
from billiards_sim.study.falls import DURATION, falls
from billiards_sim.study.recording import record

TABLE, PHYSICS = bs.Table.pool_9ft(), bs.Physics.pool()


def pot() -> bs.Scene:
    """The 1 and the 2 roll into the middle pocket at low y, one behind the other."""
    x, y = TABLE.centre
    rolling = [[1.2 / PHYSICS.radius, 0.0, 0.0]] * 2
    return bs.Scene(
        [(0.6, y), (x, 0.5), (x, 0.8)],
        [(0.0, 0.0), (0.0, -1.2), (0.0, -1.2)],
        [[0.0, 0.0, 0.0], *rolling],
        table=TABLE,
        physics=PHYSICS,
        name="pot",
    )


def test_balls_come_to_lie_apart_in_the_hole_behind_the_lip() -> None:
    scene = pot()
    events = bs.Simulation(scene).run()
    found = falls(scene, events)
    assert list(found) == [1, 2]
    hole = outline(TABLE).holes[[mouth.name for mouth in TABLE.mouths].index("y_min")]
    for fall, event in zip(found.values(), [event for event in events if event.kind == "pocketed"]):
        assert (fall.time, tuple(fall.start)) == (event.time, event.point)
        assert (fall.place >= hole.min(axis=0) + 0.99 * PHYSICS.radius).all()
        assert (fall.place <= hole.max(axis=0) - 0.99 * PHYSICS.radius).all()
        assert fall.at(fall.time) == (pytest.approx(fall.start), 0.0)
        place, depth = fall.at(fall.time + DURATION)
        assert place == pytest.approx(fall.place, abs=1e-9)
        assert depth == pytest.approx(1.0, abs=1e-9)
    assert math.dist(found[1].place, found[2].place) > 0.9 * 2.0 * PHYSICS.radius * math.sqrt(0.75)


def test_a_path_ends_at_the_lip_and_then_in_the_pocket() -> None:
    run = bs.record(bs.Simulation(pot()))
    (fall,) = [event for event in run.events if event.kind == "pocketed" and event.balls == ("1",)]
    path = run.path("1")
    assert tuple(path[-2]) == (fall.time, *fall.point)
    assert tuple(path[-1]) == (fall.time, *run.positions([run.end])[0, 1])
    before = np.linspace(0.0, fall.time, 200, endpoint=False)
    drawn = np.column_stack([np.interp(before, path[:-1, 0], path[:-1, axis]) for axis in (1, 2)])
    assert np.hypot(*(drawn - run.positions(before)[:, 1]).T).max() <= 2.001e-4


def test_files_tell_who_is_in_play(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = tmp_path / "pot.yaml"
    bs.save_scene(pot(), scene)
    assert simulate.main([str(scene), "--json", f"{tmp_path}/a.json", "--csv", f"{tmp_path}/a.csv"]) == 0
    assert "  pocketed        1 in y_min, 2 in y_min\n" in capsys.readouterr().out
    document = json.loads((tmp_path / "a.json").read_text())
    assert document["in_play"] == [True, False, False]
    fell = {event["balls"][0]: event["time"] for event in document["events"] if event["kind"] == "pocketed"}
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    for name, time in fell.items():
        last = max(float(row["time"]) for row in rows if row["ball"] == name)
        assert time - 0.01 <= last < time


@needs_plot_extra
def test_a_movie_shows_a_ball_at_the_lip_then_dark_in_its_pocket_under_the_wood() -> None:
    from billiards_sim.study.movie import Painter

    scene = pot()
    recording = record(scene)
    found = falls(scene, recording.events)
    painter = Painter(scene, 1400, found)
    scale = 1400 / (TABLE.length + 2.0 * TABLE.rail_thickness)

    def picture(time: float) -> np.ndarray:
        return painter.frame(next(iter(recording.poses([time])))).astype(float)

    def yellow(frame: np.ndarray) -> np.ndarray:
        red, green, blue = np.moveaxis(frame, 2, 0)
        return (red > 2.0 * blue) & (green > 1.3 * blue) & (red > green) & (red < 1.6 * green) & (red > 60.0)

    def middle(frame: np.ndarray) -> tuple[float, float, int, float]:
        near = yellow(frame)
        near[:, : int((fall.place[0] - 0.1) * scale)] = near[:, int((fall.place[0] + 0.1) * scale) :] = False
        near[: -int(0.3 * scale)] = False
        rows, columns = np.nonzero(near)
        return columns.mean() / scale, (len(frame) - rows.mean()) / scale, len(rows), frame[rows, columns].mean()

    fall = found[1]
    at_lip, fallen = middle(picture(fall.time - 1e-6)), middle(picture(fall.time + DURATION))
    assert at_lip[:2] == pytest.approx(fall.start, abs=0.012)  # numbers and light move its middle
    assert fallen[:2] == pytest.approx(fall.place, abs=0.012)
    assert fallen[3] < 0.7 * at_lip[3]
    assert math.dist(fallen[:2], TABLE.centre) > math.dist(at_lip[:2], TABLE.centre)


@needs_plot_extra
def test_a_movie_goes_on_until_the_last_ball_lies_in_its_pocket(tmp_path: Path) -> None:
    from billiards_sim.study.movie import write_movie

    recording = record(pot())
    assert recording.events[-1].kind == "pocketed"
    end = falls(recording.scene, recording.events)[2].time + DURATION
    assert write_movie(recording, tmp_path / "pot.gif", longest=120) == math.ceil(30.0 * end) + 1


@needs_plot_extra
def test_a_plot_shows_the_balls_in_their_pockets(tmp_path: Path) -> None:
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    from billiards_sim.study import plots

    circles = []
    original = Figure.savefig

    def look(figure: Figure, *given: object, **more: object) -> None:
        circles.extend(one for one in figure.axes[0].patches if isinstance(one, Circle))
        original(figure, *given, **more)

    recording = record(pot())
    found = falls(recording.scene, recording.events)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", look)
        plots.draw_run(recording, tmp_path / "pot.png")
    edges = {tuple(np.round(one.center, 9)): one.get_edgecolor() for one in circles if one.radius == PHYSICS.radius}
    for fall in found.values():
        assert min(edges[tuple(np.round(fall.place, 9))]) > 0.9  # light, to be seen in the hole
    assert edges[tuple(np.round(recording.end.positions[0], 9))][:3] == (0.0, 0.0, 0.0)
    assert tuple(np.round(recording.end.positions[1], 9)) not in edges


@pytest.mark.parametrize("name", ["eight_ball", "nine_ball", "ten_ball", "straight_pool"])
def test_the_break_of_a_game_spreads_the_rack(name: str) -> None:
    recording = record(bs.scenes.BUILT_IN[name]())
    assert recording.at_rest
    moved = np.hypot(*(recording.end.positions - recording.scene.positions).T)
    assert np.median(moved) > 0.4


@pytest.mark.parametrize("turn", [-1e-4, 0.0, 1e-4])  # rad
def test_in_the_break_of_nine_ball_one_rattles_and_another_falls_even_if_it_is_a_little_off(turn: float) -> None:
    scene = bs.scenes.nine_ball()
    assert scene.shot is not None
    along, across, _ = scene.shot.force
    force, angle = math.hypot(along, across), math.atan2(across, along) + turn
    simulation = bs.Simulation(scene)
    simulation.strike((force * math.cos(angle), force * math.sin(angle), 0.0), scene.shot.offset)
    events = simulation.run(until=1.5)
    of_corner = [event.balls for event in events if (event.rail or "").startswith("x_max_y_max_")]
    assert of_corner == len(of_corner) * [("5",)]
    assert len(of_corner) >= 3
    fell = [event for event in events if event.kind == "pocketed"]
    assert [(event.balls[0], event.pocket) for event in fell] == [("1", "y_min")]


def test_the_opening_shot_of_three_cushion_scores() -> None:
    recording = record(bs.scenes.three_cushion())
    mine = [event for event in recording.events if "cue" in event.balls and event.kind in ("ball_ball", "ball_rail")]
    hits = [index for index, event in enumerate(mine) if event.kind == "ball_ball"]
    assert {*mine[hits[0]].balls, *mine[hits[1]].balls} == {"cue", "red", "yellow"}
    assert sum(event.kind == "ball_rail" for event in mine[: hits[1]]) >= 3


def test_the_break_of_snooker_leaves_the_cue_ball_in_baulk() -> None:
    recording = record(bs.scenes.snooker())
    first = next(event for event in recording.events if event.kind == "ball_ball")
    assert first.balls[0] == "cue"
    assert first.balls[1].startswith("red")
    assert not any(event.kind == "pocketed" for event in recording.events)
    assert recording.end.positions[0, 0] < recording.scene.positions[recording.scene.names.index("brown"), 0]
