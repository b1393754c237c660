# SPDX-License-Identifier: Apache-2.0
"""The executable `plan`: what it prints and writes against the engine, and how it refuses."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from extras import needs_plot_extra

import billiards_sim as bs
from billiards_sim.engine import goals
from billiards_sim.engine.record import record
from billiards_sim.engine.scene_file import load_scene
from billiards_sim.engine.search import as_it_succeeds
from billiards_sim.engine.shot_kind import ShotKind, cut_of, kind_of
from billiards_sim.study import plan

TABLE = bs.Table.pool_9ft()
POOL = bs.Physics.pool()
RADIUS = POOL.radius

SCENE = """
table: pool_9ft
physics: pool
balls:
  - {name: cue, position: [1.5, 0.9]}
  - {name: "1", position: [2.1, 1.0]}
  - {name: "3", position: [0.6, 0.4]}
"""

QUICK = ("--budget", "20000", "--best", "3", "--samples", "300")


@pytest.fixture
def scene(tmp_path: Path) -> str:
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE, encoding="utf-8")
    return str(path)


def rows(text: str) -> list[list[str]]:
    """Cells of the shots that were printed."""
    return [re.split(r"\s{2,}", line.strip()) for line in text.splitlines() if re.match(r" +\d+  ", line)]


def test_the_table_is_what_the_search_found(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert plan.main([scene, *QUICK, "--seed", "7"]) == 0
    told = rows(capsys.readouterr().out)
    where = load_scene(scene)
    noise = bs.ShooterNoise.tournament()
    found = bs.search(where, goals.pocket(where), noise=noise, samples=300, best=3, seed=7, budget=20_000)
    assert len(told) == len(found) > 1
    for index, (_, ball, pocket, kind, speed, azimuth, side, up, cut, success, end) in enumerate(told):
        shot = found.shots[index : index + 1]
        wanted = [shot.speed, np.degrees(shot.azimuth), shot.side, shot.up]
        for text, value in zip((speed, azimuth, side, up), wanted):
            difference = math.remainder(float(text) - float(np.squeeze(value)), 360.0)
            assert abs(difference) <= 0.0051
        assert success == f"{100.0 * found.values[index]:.1f} +- {100.0 * found.errors[index]:.1f}"
        # The rest by a run of its own: without noise, or where it fails so, of a try that succeeds.
        alone = bs.rollout(where, as_it_succeeds(where, shot, goals.pocket(where), noise, 7))
        assert alone.pocketed(ball, pocket).all()
        x, y, spread = (float(text) for text in re.findall(r"[\d.]+", end))
        assert (x, y) == pytest.approx(alone.positions[0, 0], abs=0.0051)
        stays = found.result.in_play[index, :, 0]
        away = found.result.positions[index, stays, 0] - alone.positions[0, 0]
        assert spread == pytest.approx(math.sqrt((away**2).sum(axis=1).mean()), abs=0.0051)
        assert kind in ("direct", "bank", "kick", "combination", "carom")
        assert 0.0 <= float(cut) < 90.0


def test_what_is_asked_for_is_what_falls(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert plan.main([scene, *QUICK, "--ball", "3", "--pocket", "y_max", "--noise", "0"]) == 0
    told = rows(capsys.readouterr().out)
    assert len(told) >= 1
    for cells in told:
        assert cells[1:3] == ["3", "y_max"]
        assert cells[-2] == "100.0 +- 0.0"
        assert cells[-1].endswith("+- 0.00")


def test_the_same_seed_prints_the_same(scene: str, capsys: pytest.CaptureFixture[str]) -> None:
    texts = []
    for seed in ("1", "1", "2"):
        assert plan.main([scene, "--budget", "2000", "--best", "1", "--seed", seed]) == 0
        texts.append(capsys.readouterr().out)
    assert texts[0] == texts[1] != texts[2]


def test_the_message_is_the_best_shot(scene: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "best.yaml"
    assert plan.main([scene, *QUICK, "--yaml", str(path)]) == 0
    out = capsys.readouterr().out
    assert f"wrote {path}" in out
    (_, ball, pocket, _, speed, azimuth, side, up, *_), *_ = rows(out)
    message = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert message["header"] == {"frame_id": ""}
    force, torque = (np.array([message["wrench"][key][axis] for axis in "xyz"]) for key in ("force", "torque"))
    # As docs/ros.md has it: with d the direction, r = side * left + up * z, and what lies along d does not matter.
    ahead = force / np.linalg.norm(force)
    left = np.cross((0.0, 0.0, 1.0), ahead)
    reach = RADIUS * (float(side) * left + float(up) * np.array((0.0, 0.0, 1.0)))
    assert torque == pytest.approx(np.cross(reach, force), abs=0.0051 * RADIUS * float(np.linalg.norm(force)))
    assert np.linalg.norm(force) * POOL.cue_contact_time / POOL.mass == pytest.approx(float(speed), abs=0.0051)
    assert math.degrees(math.atan2(force[1], force[0])) == pytest.approx(float(azimuth), abs=0.0051)
    simulation = bs.Simulation(load_scene(scene))
    size = float(np.linalg.norm(force))
    simulation.strike(tuple(force), (-float(torque[2]) / size, float(left @ torque) / size))
    fell = [event for event in simulation.run() if event.kind == "pocketed"]
    assert [(event.balls[0], event.pocket) for event in fell] == [(ball, pocket)]


@needs_plot_extra
def test_the_picture_has_a_dot_for_each_sample_that_ends_on_the_table(
    scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib.figure import Figure

    from billiards_sim.study import plan_plot

    drawn: list[Figure] = []

    class Kept(Figure):
        def __init__(self, *given: Any, **named: Any) -> None:
            super().__init__(*given, **named)
            drawn.append(self)

    monkeypatch.setattr(plan_plot, "Figure", Kept)
    options = plan.parser().parse_args([scene, *QUICK, "--plot", str(tmp_path / "plan.png")])
    made = plan.plan(load_scene(scene), options)
    plan.write(made, options)
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")
    (axes,) = drawn[0].axes
    dots = [line for line in axes.lines if line.get_marker() == "o"]
    cue, one, three = (np.array(line.get_xydata()) for line in dots)
    fell = made.found.result.pocketed("1")[0]
    assert made.rows[0].kind.ball == "1"
    assert 0 < fell.sum() < 300
    assert len(one) == 300 - fell.sum()
    assert len(cue) == made.found.result.in_play[0, :, 0].sum()
    assert len(three) == 0  # nothing comes near it
    np.testing.assert_array_equal(cue, made.found.result.positions[0, made.found.result.in_play[0, :, 0], 0])


REFUSED = [
    ((), "give a SCENE, or --ros"),
    (("nowhere.yaml",), "SCENE 'nowhere.yaml' is neither a file nor one of head_on"),
    (("rack",), "the table of the scene has no pockets"),
    (("nine_ball", "--ball", "77"), "no ball is named '77'; the balls are cue, 1"),
    (("nine_ball", "--pocket", "left"), "no pocket is named 'left'; the pockets are x_min_y_min"),
    (("nine_ball", "--first", "cue"), "the ball to be met first must be another than 'cue'"),
    (("nine_ball", "--shoot"), "--shoot needs --ros: there is no table to shoot on"),
    (("nine_ball", "--timeout", "5"), "--timeout needs --ros: there is no table to wait for"),
    (("nine_ball", "--samples", "0"), "argument --samples: must be a whole number from 1 to 100000, got 0"),
    (("nine_ball", "--samples", "1e3"), "must be a whole number from 1 to 100000, got 1e3"),
    (("nine_ball", "--best", "101"), "argument --best: must be a whole number from 1 to 100, got 101"),
    (("nine_ball", "--budget", "99"), "argument --budget: must be a whole number from 100 to"),
    (("nine_ball", "--seed", "-1"), "argument --seed: must be a whole number from 0 to"),
    (("nine_ball", "--noise", "1,2"), "1,2 is no noise: give one number, or four with commas between"),
    (("nine_ball", "--noise", "nan"), "nan is no noise"),
    (("nine_ball", "--noise", "-1"), "-1 is no noise"),
    (("nine_ball", "--plot", "plan.txt"), "--plot: 'plan.txt' must end in .png or .svg or .pdf"),
    (("nine_ball", "--yaml", "/no/such/place"), "--yaml: cannot write '/no/such/place': no directory '/no/such'"),
    (("nine_ball", "--yaml", "/"), "--yaml: '/' is a directory"),
    (("nine_ball", "--sam", "3"), "unrecognized arguments: --sam 3"),
]


@pytest.mark.parametrize(("arguments", "said"), REFUSED)
def test_what_cannot_be_is_one_line(
    arguments: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    try:
        code = plan.main(list(arguments))
    except SystemExit as end:  # as argparse ends
        code = end.code  # type: ignore[assignment]
    output = capsys.readouterr()
    assert (code, output.out) == (2, "")
    assert output.err.startswith("plan: ")
    assert output.err.count("\n") == 1
    assert said in output.err


@pytest.mark.parametrize(
    ("text", "code", "said"),
    [
        (SCENE.replace("[2.1, 1.0]", "[2.1, 1.0], velocity: [1, 0]"), 2, "ball '1' moves at the start; all balls must"),
        (SCENE.replace("name: cue", "name: white"), 2, "no ball is named 'cue'; the balls are white, 1, 3"),
        ("table: pool_9ft\nballs: [{name: cue, position: [1, 1]}]", 2, "there is no ball to pot but 'cue'"),
        (SCENE.replace("physics: pool", "physics: {rolling_friction: 0}"), 2, "the balls never rest"),
        ("balls: 3", 2, "balls"),
    ],
)
def test_a_scene_that_cannot_be_planned_is_one_line(
    text: str, code: int, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    assert plan.main([str(path)]) == code
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.count("\n") == 1
    assert said in output.err


def test_where_nothing_falls_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    # On this cloth no ball goes further than 1.3 m: v^2/(2 mu g) at 5 m/s, the most it tries. The pocket is 2 m off.
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE.replace("physics: pool", "physics: {sliding_friction: 1, rolling_friction: 1}"))
    message = tmp_path / "best.yaml"
    options = ["--ball", "1", "--pocket", "x_min_y_min", "--budget", "100", "--yaml", str(message)]
    assert plan.main([str(path), *options]) == 1
    output = capsys.readouterr()
    assert output.err.startswith("plan: none of ")
    assert output.err.endswith("a larger --budget searches for longer\n")
    assert (output.out, message.exists()) == ("", False)


CORNER = np.array((TABLE.x_max - 0.04, TABLE.y_max - 0.04))
"""In the mouth of x_max_y_max."""

WAY = np.array((math.cos(0.6), math.sin(0.6)))
IDEAL = bs.Physics(sliding_friction=0.01, rolling_friction=0.001, rail_restitution=1.0)


def played(*places: Any, azimuth: float, speed: float = 2.0) -> bs.Run:
    simulation = bs.Simulation(bs.Scene(places, table=bs.Table.pool_9ft(nose_height=0.5), physics=IDEAL))
    simulation.shoot(speed, azimuth)
    return record(simulation)


def kind(*places: Any, azimuth: float, **wanted: str | None) -> ShotKind:
    return kind_of(played(*places, azimuth=azimuth).events, **wanted)


def falling(start: Any, ball: Any, azimuth: float) -> float:
    """An azimuth close to this one with which ball 1 falls."""
    scene = bs.Scene([start, ball], table=bs.Table.pool_9ft(nose_height=0.5), physics=IDEAL)
    azimuths = azimuth + np.linspace(-0.01, 0.01, 201)
    fell = bs.rollout(scene, bs.Shots(2.0, azimuths)).pocketed("1")
    return float(np.median(azimuths[fell]))


def towards(one: Any, other: Any) -> float:
    x, y = np.array(other) - np.array(one)
    return math.atan2(y, x)


def test_a_straight_shot_is_direct_and_has_no_cut() -> None:
    run = played(CORNER - 1.1 * WAY, CORNER - 0.4 * WAY, azimuth=0.6)
    assert kind_of(run.events) == ("direct", "1", "x_max_y_max")
    assert cut_of(run) == pytest.approx(0.0, abs=1e-6)


def test_a_cut_is_told_as_the_angle_from_the_line_of_centres() -> None:
    cut = 0.5
    ball = CORNER - 0.4 * WAY
    way = np.array((math.cos(0.6 + cut), math.sin(0.6 + cut)))
    run = played(ball - 2.0 * RADIUS * WAY - 0.3 * way, ball, azimuth=0.6 + cut)
    assert kind_of(run.events) == ("direct", "1", "x_max_y_max")
    assert cut_of(run) == pytest.approx(cut, abs=1e-6)


def test_by_a_rail_before_the_ball_it_is_a_kick_and_after_it_a_bank() -> None:
    ball = CORNER - 0.4 * WAY
    ghost = ball - 2.0 * RADIUS * WAY
    image = (ghost[0], 2.0 * (TABLE.y_min + RADIUS) - ghost[1])
    start = (1.6, 0.3)
    assert kind(start, ball, azimuth=falling(start, ball, towards(start, image))) == ("kick", "1", "x_max_y_max")
    ball = np.array((1.6, 0.9))
    image = (CORNER[0], 2.0 * (TABLE.y_max - RADIUS) - (TABLE.y_min + 0.04))
    way = np.array(image) - ball
    start = tuple(ball - 0.3 * way / np.linalg.norm(way))
    assert kind(start, ball, azimuth=falling(start, ball, towards(ball, image))) == ("bank", "1", "x_max_y_min")


def test_a_touch_of_the_rubber_beside_the_pocket_is_no_bank() -> None:
    ball = np.array((TABLE.x_max - 0.5, TABLE.y_max - RADIUS - 0.001))
    run = played(ball - (0.4, 0.0), ball, azimuth=-0.003)
    touched = [event.rail for event in run.events if event.kind == "ball_rail" and event.balls == ("1",)]
    assert touched[:1] == ["y_max"]
    assert kind_of(run.events) == ("direct", "1", "x_max_y_max")


def test_the_pocket_that_is_wanted_is_looked_at() -> None:
    events = list(played(CORNER - 1.1 * WAY, CORNER - 0.4 * WAY, azimuth=0.6).events)
    fall = next(event for event in events if event.kind == "pocketed")
    later = replace(fall, time=fall.time + 1.0, balls=("2",), pocket="x_min_y_max")
    assert kind_of([*events, later])[1:] == ("1", "x_max_y_max")
    assert kind_of([*events, later], pocket="x_min_y_max")[1:] == ("2", "x_min_y_max")


def test_by_way_of_another_ball_it_is_a_combination() -> None:
    found = kind(CORNER - 1.2 * WAY, CORNER - 0.7 * WAY, CORNER - 0.3 * WAY, azimuth=0.6)
    assert found == ("combination", "2", "x_max_y_max")


def test_off_another_ball_it_is_a_carom() -> None:
    # Half full on the first: the struck ball goes on along the tangent, at right angles to the line of centres.
    ball = CORNER - 0.4 * WAY
    ghost = ball - 2.0 * RADIUS * WAY
    meets = ghost - 0.3 * WAY
    normal = np.array((WAY[1], -WAY[0]))
    other = meets + 2.0 * RADIUS * normal
    way = (WAY + normal) / math.sqrt(2.0)
    run = played(meets - 0.4 * way, ball, other, azimuth=towards((0.0, 0.0), way))
    assert kind_of(run.events) == ("carom", "1", "x_max_y_max")
    assert cut_of(run) == pytest.approx(math.pi / 4.0, abs=1e-3)


def test_nothing_is_a_miss_and_the_cue_ball_alone_a_scratch() -> None:
    missed = played((1.0, 0.6), (0.5, 0.5), azimuth=0.0, speed=0.1)
    assert kind_of(missed.events) == ("miss", "", "")
    assert math.isnan(cut_of(missed))
    assert kind(CORNER - 0.7 * WAY, (0.5, 0.5), azimuth=0.6) == ("scratch", "cue", "x_max_y_max")
    both = kind(CORNER - 1.1 * WAY, CORNER - 0.4 * WAY, azimuth=0.6, wanted="1")
    assert both.ball == "1"
    assert kind(CORNER - 1.1 * WAY, CORNER - 0.4 * WAY, (0.5, 0.5), azimuth=0.6, wanted="2").kind == "miss"
