# SPDX-License-Identifier: Apache-2.0
"""The executable `simulate`: what it writes against what the solvers give, and how it refuses."""

from __future__ import annotations

import csv
import dataclasses
import json
import math
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from extras import needs_plot_extra

import billiards_sim as bs
from billiards_sim.study import simulate
from billiards_sim.study.time_stepping import SOLVERS, TimeStepSolver

OFF_TABLE = """
balls:
  - {name: cue, position: [0.6, 0.6], velocity: [1, 0]}
  - {name: "1", in_play: false}
  - {name: "2", position: [1.2, 0.61]}
"""

BREAK = ("rack", "--force", "128", "1.5")

DRAW_SHOT = """
balls:
  - {name: cue, position: [0.6, 0.6]}
  - {name: "1", position: [1.2, 0.61]}
shot: {ball: cue, force: [60, 5, 0], offset: [0.004, -0.01]}
"""

FRICTIONLESS = """
physics: {rolling_friction: 0}
balls: [{name: cue, position: [0.6, 0.6], velocity: [1, 0]}]
"""

INTO_RAIL = """
balls: [{name: cue, position: [0.079376, 0.5], angular_velocity: [0, -100, 0]}]
"""
"""The paper's scheme divides by zero here."""


def break_to_rest() -> tuple[bs.Simulation, list[bs.Event]]:
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.strike((128.0, 1.5, 0.0))
    return simulation, list(simulation.run())


def written_json(tmp_path: Path, *arguments: str) -> dict[str, Any]:
    path = tmp_path / "out.json"
    assert simulate.main([*arguments, "--json", str(path)]) == 0
    document: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return document


def same_bits(one: Any, other: Any) -> bool:
    return np.array(one, dtype=np.float64).tobytes() == np.array(other, dtype=np.float64).tobytes()


def assert_is_state_of(document: dict[str, Any], solver: Any, events: Any) -> None:
    assert document["time"] == solver.time
    assert tuple(document["names"]) == solver.start_scene.names
    assert same_bits(document["positions"], solver.positions)
    assert same_bits(document["velocities"], solver.velocities)
    assert same_bits(document["angular_velocities"], solver.angular_velocities)
    tuples = {"balls", "point", "normal"}
    read = [
        bs.Event(**{key: tuple(value) if key in tuples else value for key, value in event.items()})
        for event in document["events"]
    ]
    assert read == list(events)


def assert_refused(capsys: pytest.CaptureFixture[str], code: int, expected: int, *words: str) -> None:
    output = capsys.readouterr()
    assert code == expected
    assert output.out == ""
    assert output.err.startswith("simulate: ")
    assert output.err.endswith("\n")
    assert output.err.count("\n") == 1
    for word in words:
        assert word in output.err


def test_json_reads_back_as_the_engines_result_to_the_bit(tmp_path: Path) -> None:
    document = written_json(tmp_path, *BREAK)
    simulation, events = break_to_rest()
    assert len(events) > 100
    assert_is_state_of(document, simulation, events)
    assert (document["scene"], document["solver"]) == ("rack", "event")
    assert 0.0 < document["wall_seconds"] < 10.0
    assert [*document] == [
        *("scene", "solver", "time", "names", "positions", "in_play", "velocities", "angular_velocities", "events"),
        "wall_seconds",
    ]
    assert [*document["events"][0]] == [field.name for field in dataclasses.fields(bs.Event)]


@needs_plot_extra
@pytest.mark.parametrize("name", ["time_step", "paper"])
def test_json_of_a_stepped_solver_is_its_result_whatever_else_is_written(tmp_path: Path, name: str) -> None:
    options = ("glancing", "--solver", name, "--time-step", "0.003", "--until", "0.777")
    document = written_json(tmp_path, *options, "--csv", str(tmp_path / "out.csv"), "--plot", str(tmp_path / "out.png"))
    solver = SOLVERS[name](bs.scenes.glancing(), 0.003)
    assert_is_state_of(document, solver, solver.run(until=0.777))
    assert document["time_step"] == 0.003
    assert len(document["events"]) >= 2


def test_until_ends_a_run_at_that_time(tmp_path: Path) -> None:
    document = written_json(tmp_path, *BREAK, "--until", "0.3")
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.strike((128.0, 1.5, 0.0))
    events = simulation.run(until=0.3)
    assert document["time"] == 0.3
    assert_is_state_of(document, simulation, events)


def test_shot_of_a_scene_file_is_played(tmp_path: Path) -> None:
    file = tmp_path / "draw.yaml"
    file.write_text(DRAW_SHOT)
    simulation = bs.Simulation(bs.load_scene(file))
    simulation.strike((60.0, 5.0, 0.0), (0.004, -0.01))
    events = simulation.run()
    document = written_json(tmp_path, str(file))
    assert [event["kind"] for event in document["events"]].count("shot") == 1
    assert_is_state_of(document, simulation, events)


def test_force_and_offset_replace_the_shot_of_a_scene_file(tmp_path: Path) -> None:
    file = tmp_path / "draw.yaml"
    file.write_text(DRAW_SHOT)
    simulation = bs.Simulation(bs.load_scene(file))
    simulation.strike((-20.0, 3.0, 0.0), (-0.002, 0.01))
    events = simulation.run()
    document = written_json(tmp_path, str(file), "--force", "-20", "3", "--offset", "-0.002", "0.01")
    assert_is_state_of(document, simulation, events)


def test_a_shot_in_words_replaces_the_shot_of_a_scene_file(tmp_path: Path) -> None:
    file = tmp_path / "draw.yaml"
    file.write_text(DRAW_SHOT)
    simulation = bs.Simulation(bs.load_scene(file))
    simulation.shoot(2.0, 0.5 * np.pi, 0.3, -0.2)
    events = simulation.run()
    document = written_json(tmp_path, str(file), "--speed", "2", "--angle", "90deg", "--side", "0.3", "--up", "-0.2")
    assert_is_state_of(document, simulation, events)


def read_csv(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_csv_is_the_engines_state_every_hundredth_of_a_second_to_the_bit(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    assert simulate.main([*BREAK, "--csv", str(path)]) == 0
    rows = read_csv(path)
    assert [*rows[0]] == ["time", "ball", "x", "y", "vx", "vy", "wx", "wy", "wz"]
    end, _ = break_to_rest()
    balls = len(end.start_scene)
    times = [float(row["time"]) for row in rows[::balls]]
    assert times[0] == 0.0
    assert times[-1] == end.time
    assert times[:-1] == pytest.approx([0.01 * index for index in range(len(times) - 1)], abs=1e-12)
    assert 0.0 < times[-1] - times[-2] <= 0.01
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.strike((128.0, 1.5, 0.0))
    for index, time in enumerate(times):
        simulation.run(until=time)
        block = rows[balls * index : balls * (index + 1)]
        assert tuple(row["ball"] for row in block) == simulation.start_scene.names
        assert {float(row["time"]) for row in block} == {time}
        state = np.column_stack((simulation.positions, simulation.velocities, simulation.angular_velocities))
        assert same_bits(
            [[float(row[key]) for key in ("x", "y", "vx", "vy", "wx", "wy", "wz")] for row in block], state
        )


@pytest.mark.parametrize("sample, until, count", [("0.1", "0.3", 4), ("0.07", "0.2", 4), ("5", "0.2", 2)])
def test_csv_goes_from_the_start_to_the_end_in_steps_of_the_sample(
    tmp_path: Path, sample: str, until: str, count: int
) -> None:
    path = tmp_path / "out.csv"
    assert simulate.main(["head_on", "--csv", str(path), "--sample", sample, "--until", until]) == 0
    times = [float(row["time"]) for row in read_csv(path)[::2]]
    assert times == pytest.approx([*(float(sample) * index for index in range(count - 1)), float(until)], abs=1e-12)


def test_csv_of_a_stepped_solver_has_each_of_its_steps(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    assert simulate.main(["head_on", "--solver", "time_step", "--until", "0.3", "--csv", str(path)]) == 0
    rows = read_csv(path)
    times = [float(row["time"]) for row in rows[::2]]
    solver = TimeStepSolver(bs.scenes.head_on(), 0.01)
    (collision,) = (event for event in solver.run(until=0.3) if event.kind == "ball_ball")
    assert times[0] == 0.0
    assert times[-1] == 0.3
    assert collision.time in times
    assert max(np.diff(times)) == pytest.approx(0.01)
    assert same_bits([[float(row["x"]), float(row["y"])] for row in rows[-2:]], solver.positions)


def test_summary_names_solver_time_events_and_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "out.json"
    assert simulate.main(["head_on", "--json", str(path)]) == 0
    simulation = bs.Simulation(bs.scenes.head_on())
    events = simulation.run()
    output = capsys.readouterr()
    assert output.out.startswith("simulate: head_on, 2 balls\n")
    lines = dict(line.strip().split("  ", 1) for line in output.out.splitlines()[1:])
    assert lines["solver"].strip() == "event"
    assert lines["simulated time"].strip() == f"{simulation.time:.6g} s, at rest"
    total, _, kinds = lines["events"].strip().partition(": ")
    assert int(total) == len(events)
    counts = Counter(event.kind for event in events)
    assert sorted(kinds.split(", ")) == sorted(f"{count} {kind}" for kind, count in counts.items())
    assert lines["wall time"].strip().endswith(" s")
    assert lines["wrote"].strip() == str(path)
    assert "compiling" in output.err or output.err == ""


SPINNING = """
physics: {preset: pool, mass: 0.16}
balls: [{name: cue, position: [0.6, 0.6], angular_velocity: [0, 0, 20]}]
"""


def test_a_ball_that_spins_where_it_lies_is_played_until_it_has_ended(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, table = tmp_path / "scene.yaml", tmp_path / "states.csv"
    path.write_text(SPINNING)
    document = written_json(tmp_path, str(path), "--csv", str(table), "--sample", "0.1")
    printed = capsys.readouterr().out
    deceleration = bs.Physics.pool().spin_deceleration
    assert document["time"] == pytest.approx(20.0 / deceleration, rel=1e-14)
    assert (document["events"], document["angular_velocities"]) == ([], [[0.0, 0.0, 0.0]])
    assert "at rest" in printed
    assert "nothing moved" not in printed
    with table.open(newline="") as file:
        rows = [(float(row["time"]), float(row["wz"])) for row in csv.DictReader(file)]
    assert len(rows) == 22
    for time, spin in rows:
        assert spin == pytest.approx(20.0 - deceleration * time, abs=1e-12)
    assert simulate.main([str(path), "--until", "0.5"]) == 0
    assert "balls still move" in capsys.readouterr().out


def test_a_raised_butt_is_played(tmp_path: Path) -> None:
    words = ("--speed", "2", "--angle", "30deg", "--side", "0.3", "--up", "-0.2", "--elevation", "35deg")
    document = written_json(tmp_path, "rack", *words, "--until", "0.3")
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.shoot(2.0, math.radians(30.0), side=0.3, up=-0.2, elevation=math.radians(35.0))
    assert_is_state_of(document, simulation, simulation.run(until=0.3))
    vx, vy = document["velocities"][0]
    assert abs(math.atan2(vy, vx) - math.radians(30.0)) > 0.1


@pytest.mark.parametrize("solver", ["time_step", "paper"])
def test_a_stepped_solver_refuses_physics_that_it_does_not_have(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], solver: str
) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(SPINNING)
    code = simulate.main([str(path), "--solver", solver, "--until", "1"])
    assert_refused(capsys, code, 2, "scene.yaml", "physics.youngs_modulus must be 0.0, got 5800000000.0")


def test_a_scene_where_nothing_moves_says_so(capsys: pytest.CaptureFixture[str]) -> None:
    assert simulate.main(["rack"]) == 0
    assert "nothing moved: the scene has no shot" in capsys.readouterr().out


@needs_plot_extra
def test_plot_is_a_picture_of_the_table_to_scale(tmp_path: Path) -> None:
    path = tmp_path / "out.png"
    from PIL import Image

    assert simulate.main(["glancing", "--plot", str(path)]) == 0
    with Image.open(path) as image:
        assert image.format == "PNG"
        pixels = np.asarray(image.convert("RGB")).astype(int)
    wood = np.abs(pixels - [89, 51, 26]).max(axis=2) < 8
    rows, columns = np.flatnonzero(wood.any(axis=1)), np.flatnonzero(wood.any(axis=0))
    table = bs.Table()
    pixels_per_metre = np.ptp(columns) / (table.x_max + table.rail_thickness)
    assert pixels_per_metre > 500.0
    assert np.ptp(rows) / pixels_per_metre == pytest.approx(table.y_max + table.rail_thickness, rel=0.005)
    inside = pixels[rows[0] : rows[-1], columns[0] : columns[-1]]
    yellow = np.abs(inside - [242, 196, 15]).max(axis=2) < 8  # ball 1: its path, and where it ends
    simulation = bs.Simulation(bs.scenes.glancing())
    xs = []
    while not simulation.at_rest:
        simulation.advance(0.01)
        xs.append(simulation.positions[1, 0])
    seen = np.flatnonzero(yellow.any(axis=0)) / pixels_per_metre
    assert seen.min() == pytest.approx(min(xs), abs=1.2 * bs.Physics().radius)
    assert seen.max() == pytest.approx(max(xs), abs=1.2 * bs.Physics().radius)


def test_a_ball_that_is_not_in_play_is_in_no_row_and_no_picture(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text(OFF_TABLE, encoding="utf-8")
    document = written_json(tmp_path, str(scene), "--csv", str(tmp_path / "out.csv"))
    assert document["names"] == ["cue", "1", "2"]
    assert [place is None for place in document["positions"]] == [False, True, False]
    assert {row["ball"] for row in read_csv(tmp_path / "out.csv")} == {"cue", "2"}


@needs_plot_extra
def test_a_picture_is_that_of_the_balls_in_play(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    pictures = []
    for text in (OFF_TABLE, OFF_TABLE.replace('  - {name: "1", in_play: false}\n', "")):
        scene.write_text(text, encoding="utf-8")
        for ending in ("png", "gif"):
            path = tmp_path / f"out.{ending}"
            option = "--plot" if ending == "png" else "--movie"
            assert simulate.main([str(scene), option, str(path), "--until", "0.1"]) == 0
            pictures.append(path.read_bytes())
    assert pictures[:2] == pictures[2:]


REFUSED = [
    (("cowboy_pool",), "'cowboy_pool'", "rack"),
    (("{tmp}",), "{tmp}"),
    (("{tmp}/broken.yaml",), "broken.yaml", "not YAML"),
    (("{tmp}/binary.yaml",), "binary.yaml"),
    (("{tmp}/no_balls.yaml",), "no_balls.yaml", "balls"),
    (("{tmp}/frictionless.yaml",), "rolling_friction 0", "--until"),
    ((), "SCENE"),
    (("head_on", "glancing"), "glancing"),
    (("head_on", "--solver", "euler"), "--solver", "euler"),
    (("head_on", "--solver", "paper"), "paper", "--until"),
    (("head_on", "--until", "soon"), "--until", "soon"),
    (("head_on", "--until", "-1"), "--until", "-1"),
    (("head_on", "--until", "nan"), "--until", "nan"),
    (("head_on", "--time-step", "0"), "--time-step"),
    (("head_on", "--csv", "{tmp}/out.csv", "--sample", "0"), "--sample"),
    (("head_on", "--rate", "30"), "--rate needs --bag"),
    (("head_on", "--sample", "0.1", "--json", "{tmp}/out"), "--sample needs --csv"),
    (("head_on", "--time-step", "0.01"), "--time-step needs --solver time_step or paper"),
    (
        ("head_on", "--solver", "time_step", "--csv", "{tmp}/out.csv", "--sample", "0.1"),
        "--sample needs --solver event: time_step writes each of its steps",
    ),
    (("head_on", "--csv", "{tmp}/out.csv", "--until", "1e300"), "--until 1e+300", "times", "at most 1000000"),
    (("head_on", "--csv", "{tmp}/out.csv", "--until", "1", "--sample", "1e-300"), "1e-300 s apart", "at most 1000000"),
    pytest.param(
        (("head_on", "--movie", "{tmp}/out.gif", "--until", "1e300"), "--until 1e+300", "times", "at most 100000"),
        marks=needs_plot_extra,
    ),
    (("head_on", "--solver", "time_step", "--time-step", "1e-9", "--until", "1"), "1e+09 steps", "at most 1000000"),
    (("head_on", "--json", 300 * "a"), "--json", "File name too long"),
    (("head_on", "--json", "{tmp}/" + 300 * "a"), "--json", "File name too long"),
    ((300 * "a",), "cannot read 'aaa", "File name too long"),
    (("{tmp}/pipe",), "pipe", "not a regular file"),
    (("{tmp}/surrogate.yaml",), "surrogate.yaml: "),
    (("head_on", "--force", "80", "0"), "'cue'", "must rest"),
    (("rack", "--force", "0", "0"), "force"),
    (("rack", "--force", "nan", "0"), "force"),
    (("rack", "--force", "80", "0", "--offset", "0.03", "0"), "offset"),
    (("rack", "--offset", "0", "0"), "--offset", "--force"),
    (("rack", "--speed", "3"), "--speed", "--angle"),
    (("rack", "--speed", "3", "--angle", "1deg", "--force", "1", "0"), "--speed", "--force"),
    (("rack", "--speed", "1e9", "--angle", "1deg"), "speed must be", "1e+09"),
    (("head_on", "--speed", "3", "--angle", "1deg"), "'cue'", "must rest"),
    (("head_on", "--json", "{tmp}"), "--json", "directory"),
    (("head_on", "--csv", "{tmp}/nowhere/out.csv"), "--csv", "nowhere"),
    (("head_on", "--json", "{tmp}/out", "--csv", "{tmp}/out"), "--csv", "{tmp}/out"),
    (("head_on", "--plot", "{tmp}/out.jpg"), "--plot", "out.jpg", ".png"),
    (("head_on", "--plot", "{tmp}/out"), "--plot", ".png"),
    (("head_on", "--movie", "{tmp}/out.avi"), "--movie", "out.avi", ".mp4", ".gif"),
]


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: " ".join(case[0]) or "no arguments")
def test_what_cannot_be_done_is_one_line_and_code_2(
    case: tuple[Any, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, *words = case
    (tmp_path / "broken.yaml").write_text("balls: [")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00\x81")
    (tmp_path / "no_balls.yaml").write_text("balls: []")
    (tmp_path / "surrogate.yaml").write_text('balls: [{name: "\\udc80", position: [1, 0.5]}]')
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "frictionless.yaml").write_text(FRICTIONLESS)
    try:
        code = simulate.main([argument.replace("{tmp}", str(tmp_path)) for argument in arguments])
    except SystemExit as end:  # argparse
        code = int(str(end.code))
    assert_refused(capsys, code, 2, *(word.replace("{tmp}", str(tmp_path)) for word in words))


def test_too_many_times_until_rest_are_one_line_and_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert simulate.main(["head_on", "--csv", str(tmp_path / "out.csv"), "--sample", "1e-300"]) == 2
    error = capsys.readouterr().err
    assert error.startswith("simulate: --csv: 4.74e+300 times, 1e-300 s apart until 4.73536 s, are too many: at most")
    assert error.count("\n") == 1
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("option", ["--json", "--csv"])
def test_a_file_that_cannot_be_written_is_one_line_and_code_2(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert simulate.main(["head_on", option, "/dev/full"]) == 2
    output = capsys.readouterr()
    assert output.err == f"simulate: {option}: cannot write '/dev/full': No space left on device\n"
    assert "wrote" not in output.out


def test_a_frictionless_scene_runs_until_a_time(tmp_path: Path) -> None:
    file = tmp_path / "frictionless.yaml"
    file.write_text(FRICTIONLESS)
    document = written_json(tmp_path, str(file), "--until", "1.5")
    assert document["time"] == 1.5
    assert document["velocities"][0][0] != 0.0


def test_a_scheme_that_cannot_go_on_is_one_line_and_code_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "rail.yaml"
    file.write_text(INTO_RAIL)
    code = simulate.main([str(file), "--solver", "paper", "--until", "0.1"])
    assert_refused(capsys, code, 1, "paper cannot go on", "'cue'", "x_min")


def test_a_stalled_engine_is_one_line_and_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = bs.scenes.head_on()
    stall = bs.StallError("no progress", scene, bs.Simulation(scene).advance(0.0))

    def stalled(*_: Any) -> None:
        raise stall

    monkeypatch.setattr(simulate, "record", stalled)
    assert_refused(capsys, simulate.main(["head_on"]), 1, "event cannot go on", "no progress", str(stall.path))
    Path(str(stall.path)).unlink()


def test_an_interrupted_run_is_one_line_and_code_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(simulate, "record", interrupted)
    assert_refused(capsys, simulate.main(["head_on"]), 1, "stopped")


@needs_plot_extra
@pytest.mark.parametrize(
    "option, file, module, package",
    [
        ("--plot", "out.png", "matplotlib", "matplotlib"),
        ("--movie", "out.gif", "PIL", "pillow"),
        ("--movie", "out.gif", "tqdm", "tqdm"),
        ("--movie", "out.mp4", "imageio_ffmpeg", "imageio-ffmpeg"),
    ],
)
def test_a_missing_extra_is_named_before_anything_is_computed(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    option: str,
    file: str,
    module: str,
    package: str,
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr(simulate, "record", lambda *_: pytest.fail("computed"))
    code = simulate.main(["head_on", option, str(tmp_path / file)])
    assert_refused(capsys, code, 2, f"{option} needs {package}: pip install 'billiards_sim[plot]'")


def test_a_scene_file_without_pyyaml_names_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "draw.yaml"
    file.write_text(DRAW_SHOT)
    monkeypatch.setitem(sys.modules, "yaml", None)
    assert_refused(capsys, simulate.main([str(file)]), 2, str(file), "PyYAML", "billiards_sim[ros]")


def test_numbers_need_no_drawing_library(tmp_path: Path) -> None:
    arguments = ["head_on", "--json", str(tmp_path / "out.json"), "--csv", str(tmp_path / "out.csv")]
    code = (
        "import sys\n"
        "from billiards_sim.study import simulate\n"
        f"assert simulate.main({arguments}) == 0\n"
        "print(sorted({'matplotlib', 'PIL', 'tqdm', 'imageio_ffmpeg', 'rclpy'} & sys.modules.keys()))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert run.returncode == 0, run.stderr
    assert run.stdout.splitlines()[-1] == "[]"
