# SPDX-License-Identifier: Apache-2.0
"""The benchmark: its statistics, its truth, its tables, and a tiny run from end to end."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from extras import needs_plot_extra

import billiards_sim as bs
from billiards_sim.study import (
    benchmark,
    chaos,
    elastic,
    environments,
    measure,
    pool,
    precision,
    report,
    rollouts,
    speed,
)
from billiards_sim.study.truth import collisions, truths

REPOSITORY = Path(__file__).parents[2]
README = REPOSITORY / "README.md"
FIGURES = REPOSITORY / "docs" / "benchmark" / "benchmark.json"


def test_slope_of_a_power_law_is_its_exponent() -> None:
    steps = [0.1, 0.03, 0.01, 0.001]
    found, error = measure.slope(steps, [7.0 * step**1.5 for step in steps])
    assert found == pytest.approx(1.5, abs=1e-12)
    assert error == pytest.approx(0.0, abs=1e-12)


def test_standard_error_of_a_slope_is_that_of_least_squares() -> None:
    random = np.random.default_rng(1)
    x = np.geomspace(1e-3, 1.0, 8)
    y = x * np.exp(0.3 * random.standard_normal(8))
    (line, _), covariance = np.polyfit(np.log(x), np.log(y), 1, cov=True)
    found, error = measure.slope(x.tolist(), y.tolist())
    assert found == pytest.approx(line, rel=1e-12)
    assert error == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-12)


def test_a_slope_needs_three_points() -> None:
    with pytest.raises(ValueError, match="three points, got 2"):
        measure.slope([1.0, 2.0], [1.0, 2.0])


def test_spread() -> None:
    assert measure.spread([3.0, 1.0, 8.0, 2.0]) == {"median": 2.5, "low": 1.0, "high": 8.0, "runs": 4}


def test_root_mean_square() -> None:
    assert measure.root_mean_square([3.0, -4.0]) == pytest.approx(math.sqrt(12.5))
    assert math.isnan(measure.root_mean_square([]))


@pytest.mark.parametrize(
    "costs, errors, cost",
    [
        ([1.0, 10.0, 100.0], [1e-1, 1e-2, 1e-4], math.sqrt(10.0 * 100.0)),  # half way down between two points
        ([1.0, 10.0, 100.0], [1e-1, 1e-3, 1e-5], 10.0),  # at a point
        ([1.0, 10.0, 100.0], [1e-4, 1e-1, 1e-5], math.sqrt(10.0 * 100.0)),  # a lucky coarse step does not count
        ([1.0, 10.0], [1e-4, 1e-5], 1.0),
        ([1.0, 10.0], [1e-1, 1e-2], None),
        ([1.0, 10.0, 100.0], [math.nan, 1e-4, 1e-5], 10.0),
    ],
)
def test_cost_at_equal_error(costs: list[float], errors: list[float], cost: float | None) -> None:
    found = measure.cost_at(1e-3, costs, errors)
    assert found is None if cost is None else found == pytest.approx(cost)


def test_a_child_process_returns_and_fails_in_words() -> None:
    assert measure.in_child(measure.spread, values=[1.0, 3.0])["median"] == 2.0
    with pytest.raises(measure.ChildError, match="three points"):
        measure.in_child(measure.slope, x=[1.0], y=[1.0])


def test_truth_of_the_built_in_scenes_starts_where_they_do() -> None:
    for name in ("head_on", "glancing"):
        built_in = bs.scenes.BUILT_IN[name]()
        assert np.array_equal(truths()[name].scene.positions, built_in.positions)
        assert np.array_equal(truths()[name].scene.velocities, built_in.velocities)
    rack = bs.Simulation(bs.scenes.rack())
    rack.strike((128.0, 3.8, 0.0))
    start = truths()["break"].scene
    np.testing.assert_allclose(start.positions, rack.positions, rtol=0, atol=1e-15)
    np.testing.assert_allclose(start.velocities, rack.velocities, rtol=0, atol=1e-15)


@pytest.mark.parametrize("name", truths())
def test_the_engine_is_as_exact_as_double_precision_allows(name: str) -> None:
    truth = truths()[name]
    run = precision.run_once("event", truth, 1.0)
    assert run["failure"] is None
    assert run["missed"] == run["extra"] == 0
    for time_, state in truth.states.items():
        assert run["position"][time_] < max(1e-12, 10.0 * state.rounding)
        assert run["energy"][time_] < 1e-12


def test_a_start_one_micrometre_off_is_an_error_of_one_micrometre() -> None:
    truth = truths()["draw"]
    moved = bs.Scene(truth.scene.positions + (0.0, 1e-6), truth.scene.velocities, truth.scene.angular_velocities)
    simulation = bs.Simulation(moved)
    simulation.run(until=0.5)
    assert precision.position_error(simulation, truth.states["0.5"]) == pytest.approx(1e-6, rel=1e-6)


def test_the_papers_scheme_is_compared_at_its_own_clock() -> None:
    truth = truths()["draw"]
    late = bs.Simulation(truth.scene)
    late.run(until=0.5 + 1e-5)
    # On a straight line over 1e-5 s, the rest is a dt^2 / 2 with accelerations up to mu_s g = 2 m/s^2.
    assert precision.position_error(late, truth.states["0.5"]) < 1e-10


def test_missed_and_extra_collisions_are_counted() -> None:
    truth = truths()["bank"]
    events = list(bs.Simulation(truth.scene).run())
    assert collisions(events, truth.scene) == truth.collisions
    rails = [event for event in events if event.kind == "ball_rail"]
    of_balls = Counter({((0, 1), None): sum(event.kind == "ball_ball" for event in events)})
    assert of_balls.total() > 0
    assert truth.collisions - collisions(rails, truth.scene) == of_balls
    assert collisions([*events, rails[0]], truth.scene) - truth.collisions == Counter({((0,), rails[0].rail): 1})


def test_time_step_is_first_order_and_paper_does_not_converge() -> None:
    truth = truths()["curve"]
    steps = [0.02, 0.01, 0.005]
    points = [precision.stepped_point("time_step", truth.name, step, precision.NEIGHBOURS) for step in steps]
    order, error = measure.slope(steps, [point["position"]["2"] for point in points])
    assert order == pytest.approx(1.0, abs=max(0.2, 2.0 * error))
    coarse, fine = (precision.run_once("paper", truth, step)["position"]["2"] for step in (0.01, 0.005))
    assert min(coarse, fine) > 0.1


def test_overlap_is_seen() -> None:
    truth = truths()["break"]
    assert precision.deepest_overlap("event", truth, 0.01) < 1e-9
    assert precision.deepest_overlap("paper", truth, 0.01) > 1e-3


def test_a_run_that_fails_says_why_and_counts_what_it_lost() -> None:
    run = precision.run_once("paper", truths()["break"], 0.03)
    assert "overlap after the step" in run["failure"]
    assert math.isnan(run["wall"])
    assert math.isnan(run["position"]["rest"])
    point = precision.summary([run], 0.0)
    assert point["wall"] is None
    assert point["failures"] == [run["failure"]]


def test_conclusions_leave_out_steps_that_miss_a_collision() -> None:
    def point(step: float, error: float, missed: int = 0) -> dict:
        wall = {"median": 0.01 / step}
        return {"time_step": step, "position": {"2": error}, "wall": wall, "missed": missed, "extra": 0}

    steps = [point(0.1, 0.009, missed=1), point(0.01, 4e-3), point(0.001, 4e-4), point(0.0001, 4e-5)]
    points = {"time_step": steps, "event": {"wall": {"median": 2e-3}}, "event_interpreted": {"wall": {"median": 2e-2}}}
    found = precision.conclusions(points)
    assert found["order"][0] == pytest.approx(1.0)
    assert found["ratio"] == pytest.approx(2000.0)  # 1 mm at a step of 2.5 ms, which costs 4 s
    assert found["ratio_interpreted"] == pytest.approx(200.0)


def test_breaks_differ_by_seed_and_have_the_same_speed() -> None:
    forces = [speed.break_force(seed) for seed in range(20)]
    assert len(set(forces)) == 20
    for x, y, z in forces:
        assert math.hypot(x, y) == pytest.approx(128.0)
        assert abs(math.atan2(y, x)) <= speed.AIM
        assert z == 0.0


@pytest.mark.parametrize("count", [16, 100])
def test_a_crowd_rolls_with_the_room_of_sixteen_balls(count: int) -> None:
    crowd = speed.crowd(count)
    simulation = bs.Simulation(crowd)
    slip = crowd.velocities + crowd.physics.radius * crowd.angular_velocities[:, 1::-1] * (-1.0, 1.0)
    assert np.abs(slip).max() < 1e-15
    default = bs.Table()
    assert crowd.table.length * crowd.table.width / count == pytest.approx(default.length * default.width / 16)
    simulation.run(until=0.1)
    assert not simulation.at_rest


def test_twins_part_as_far_as_their_starts_before_anything_happens() -> None:
    distance, count = chaos.parting(chaos.twenty_balls, 1, 1e-9)
    assert distance[0] == 1e-9
    assert count[0] == 0
    before = np.flatnonzero(count == 0)
    assert distance[before[-1]] == pytest.approx(1e-9, rel=1e-4)
    assert distance[-1] > 1e-6
    assert (np.diff(count) >= 0).all()


def test_first_time_beyond() -> None:
    distance = np.array([0.0, 1e-6, 2e-3, 1e-4, 5e-3])
    assert chaos.first_time_beyond(distance, 1e-3) == pytest.approx(2 * chaos.PAUSE)
    assert chaos.first_time_beyond(distance, 1.0) is None


@pytest.mark.parametrize(
    "value, text",
    [
        (None, "-"),
        (0.0, "0"),
        (1.61e-12, "1.6e-12"),
        (0.00123, "0.00123"),
        (0.1876, "0.188"),
        (12.345, "12.3"),
        (1234.5, "1234"),
        (2.5e9, "2.5e9"),
        (-0.5, "-0.500"),
    ],
)
def test_figures_have_three_digits(value: float | None, text: str) -> None:
    assert report.figure(value) == text


def test_a_table_is_aligned_markdown() -> None:
    assert report.table(("a", "what"), [("1", "x"), ("2345", "")]) == (
        "| a    | what |\n| ---- | ---- |\n| 1    | x    |\n| 2345 |      |"
    )


def test_the_node_has_no_rate_where_nobody_subscribes() -> None:
    spacings = ("mean_rate", "spacing_p1", "spacing_p99", "jitter_p99", "spacing_longest")
    common = {"rate": 100, "balls": "at rest", "load": 0.25, "listener_load": 0.5}
    runs = [
        {**common, "topics": "all", **dict.fromkeys(spacings, 0.01)},
        {**common, "topics": "none", **dict.fromkeys(spacings)},
    ]
    rows = [line.split("|")[1:-1] for line in report.node_table({"runs": runs}).splitlines()[:4]]
    names, heard, unheard = ([cell.strip() for cell in rows[index]] for index in (0, 2, 3))
    assert dict(zip(names, heard))["longest, ms"] == "10.0"
    assert dict(zip(names, unheard)) == {
        **dict.fromkeys(names, "-"),
        "Hz asked for": "100",
        "balls": "at rest",
        "share of a core": "25%",
        "subscribed": "none",
        "listener's share": "50%",
    }


def test_rollouts_are_rated_by_what_the_kernel_allows() -> None:
    rates = {way: {"median": rate} for way, rate in (("kernel", 8000.0), ("one", 6000.0), ("all", 9000.0))}
    case = {"name": "break", "events": 190.0, "threads": 2, **rates}
    peer = {"name": "slow", "version": "1.2", "absent": False, "rate": 4.0}
    break_row, peer_row = report.rollout_table({"cases": [case], "peer": peer}).splitlines()[2:]
    cells = ["break", "190", "8000", "6000", "9000", "0.750", "1.50 on 2"]
    assert [cell.strip() for cell in break_row.split("|")[1:-1]] == cells
    assert [cell.strip() for cell in peer_row.split("|")[1:-1]] == [
        "slow 1.2, `break` for 5 s",
        "",
        "",
        "4.00",
        "",
        "",
        "",
    ]
    absent = report.rollout_table({"cases": [], "peer": {"name": "slow", "version": None, "absent": True}})
    assert "not installed" in absent.splitlines()[-1]


def test_rollouts_of_a_case_are_measured_in_every_way() -> None:
    name = "two balls on the paper's table"
    found = rollouts.measure(name, 2, 2_000)
    scene, shots = rollouts.cases()[name]
    counts = []
    for shot in shots[:10].columns().tolist():
        simulation = bs.Simulation(scene)
        simulation.shoot(*shot)
        counts.append(len(simulation.run()))
    assert found["shots"] == 10
    assert found["events"] == np.mean(counts)
    assert all(found[way]["runs"] == 2 and found[way]["low"] > 0.0 for way in ("kernel", "one", "all"))


def test_environments_are_rated_by_the_clock_and_by_the_core() -> None:
    row = {
        "name": "Pool",
        "tables": 64,
        "wall": {"median": 2e4, "low": 1e4, "high": 3e4},
        "processor": {"median": 4e4},
    }
    line = report.environment_table({"absent": False, "rows": [row]}).splitlines()[2]
    cells = ["`billiards_sim/Pool-v0`", "64", "20000", "10000", "30000", "40000"]
    assert [cell.strip() for cell in line.split("|")[1:-1]] == cells
    assert "not installed" in report.environment_table({"absent": True})


@pytest.mark.parametrize("name", environments.OPTIONS)
def test_each_step_of_an_environment_that_is_measured_plays_at_every_table(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("gymnasium")
    from billiards_sim.gym.tables import Tables

    played: list[int] = []
    ticks = iter(range(1000))  # a second between two looks at a clock
    monkeypatch.setattr(environments.time, "perf_counter", lambda: next(ticks))
    monkeypatch.setattr(environments.time, "process_time", lambda: 0.25 * next(ticks))
    play = Tables.play
    monkeypatch.setattr(Tables, "play", lambda self, rows, shots: played.append(len(rows)) or play(self, rows, shots))
    found = environments.measure(name, 2, 12)
    assert played == [environments.TABLES] * 12 * 3
    assert found["wall"] == {"median": 384.0, "low": 384.0, "high": 384.0, "runs": 2}  # 12 steps in 2 s
    assert found["processor"]["median"] == 4.0 * 384.0


def test_a_target_is_met_or_missed() -> None:
    rows = [
        speed.row("fast", "us", [1e-6, 2e-6, 3e-6], 2.0, 1e6),
        speed.row("slow", "us", [3e-6], 2.0, 1e6),
        speed.row("free", "us", [3e-6], None, 1e6),
    ]
    lines = report.speed_table(rows).splitlines()[2:]
    assert [line.split("|")[7].strip() for line in lines] == ["<= 2: met", "<= 2: missed", ""]
    assert lines[0].split("|")[2:7] == [" 2.00   ", " 1.00     ", " 3.00    ", " us   ", " 3    "]


def test_a_fragment_replaces_what_is_between_the_markers() -> None:
    text = f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n"
    assert report.with_fragment(text, "new") == f"before\n{report.BEGIN}\n\nnew\n\n{report.END}\nafter\n"


@pytest.mark.parametrize("text", ["", report.BEGIN, f"{report.END}\n{report.BEGIN}", f"{report.BEGIN}{report.END}" * 2])
def test_a_file_without_markers_is_refused(text: str) -> None:
    with pytest.raises(report.MarkerError, match=r"README\.md must have one line"):
        report.with_fragment(text, "new", "README.md")


def test_readme_shows_the_figures_that_are_kept() -> None:
    text = README.read_text(encoding="utf-8")
    fragment = report.readme_fragment(benchmark.read(FIGURES))
    assert report.with_fragment(text, fragment) == text
    for what in ("break, shot to rest", "`head_on`, error at rest", "`break` for 5 s, pooltool", "node at 100 Hz"):
        assert f"| {what}" in fragment


def test_the_kept_report_is_made_from_the_kept_figures() -> None:
    kept = FIGURES.with_name("benchmark.md").read_text(encoding="utf-8")
    assert kept == report.whole_report(benchmark.read(FIGURES))
    for picture in ("work_precision.png", "rack.png", "chaos.png"):
        assert f"]({picture})" in kept
        assert FIGURES.with_name(picture).is_file()


def test_the_short_table_has_the_figures_of_the_parts_that_were_measured() -> None:
    rows = [speed.row("break", "ms", [2e-4, 3e-4, 1e-4], 0.2, 1e3), speed.row("free", "ms", [3e-6], None, 1e3)]
    wall = {"median": 0.25}
    results = {
        "speed": {"rows": rows},
        "precision": {
            "break": {"event": {"position": {"rest": 3e-12}}, "rounding": {"rest": 2e-12}},
            "bank": {"event": {"position": {"rest": 1e-12}}, "rounding": {"rest": 1e-12}},
        },
        "peers": {
            "slow": {"version": "1.2", "scenes": {"break": {"wall": wall, "position": {"2": 0.5}}}},
            "broken": {"version": "1", "scenes": {"break": {"failure": "lost a ball"}}},
            "absent": {"absent": "not installed"},
        },
        "node": {"runs": [{"rate": 100, "balls": "moving", "topics": "all", "mean_rate": 99.8, "load": 0.25}]},
    }
    assert report.highlights(results) == [
        ("break", "0.200 ms"),
        ("`break`, error at rest", "3.0e-12 m; rounding the start to double precision moves it by 2.0e-12 m"),
        ("`break` for 5 s, slow 1.2", "250 ms; error 0.500 m at 2 s"),
        ("node at 100 Hz, balls moving, all topics subscribed", "99.8 Hz; 25% of a core"),
    ]
    assert report.highlights({}) == []


def test_an_elastic_break_spreads_a_rack_that_a_rigid_one_leaves() -> None:
    rigid, soft = (elastic.break_point(5e-5, is_elastic, 5)["displacement"]["median"] for is_elastic in (False, True))
    assert soft >= 0.4
    assert rigid <= 0.2


def test_a_drawn_rack_was_hit_a_twentieth_of_a_second_before() -> None:
    drawn = elastic.picture(0.0, True)
    way = np.hypot(*(np.array(drawn["after"]) - drawn["before"]).T)[1:]
    assert 0.1 < way.max() < elastic.PICTURE_TIME * elastic.BREAK_SPEED  # nobody is faster than the cue ball was
    assert way.min() > 0.0


def run(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "billiards_sim", "benchmark", *arguments],
        env={**os.environ, **environment},
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        timeout=120.0,
        check=False,
    )


@needs_plot_extra
def test_a_tiny_study_prints_and_writes_everything(tmp_path: Path) -> None:
    readme = tmp_path / "README.md"
    readme.write_text(f"{report.BEGIN}\n{report.END}\n", encoding="utf-8")
    output = tmp_path / "figures"
    done = run("--quick", "--parts", "chaos", "--output", str(output), "--readme", str(readme))
    assert done.returncode == 0, done.stderr
    assert {path.name for path in output.iterdir()} == {"benchmark.json", "benchmark.md", "chaos.png"}
    results = benchmark.read(output / "benchmark.json")
    assert set(results) == {"machine", "options", "chaos"}
    assert results["machine"]["numpy"] == np.__version__
    assert results["chaos"]["break"]["seeds"] == benchmark.QUICK_CHAOS_SEEDS
    assert done.stdout.rstrip("\n") == (output / "benchmark.md").read_text(encoding="utf-8").rstrip("\n")
    assert readme.read_text(encoding="utf-8") == report.with_fragment(
        f"{report.BEGIN}\n{report.END}\n", report.readme_fragment(results)
    )

    again = tmp_path / "again"
    done = run("--from", str(output / "benchmark.json"), "--output", str(again))
    assert done.returncode == 0, done.stderr
    assert (again / "benchmark.json").read_text() == (output / "benchmark.json").read_text()
    assert (again / "chaos.png").stat().st_size > 10_000


@needs_plot_extra
def test_every_part_is_in_the_report_and_the_pictures(tmp_path: Path) -> None:
    results = benchmark.read(FIGURES)
    benchmark.write(results, tmp_path)
    text = (tmp_path / "benchmark.md").read_text(encoding="utf-8")
    for name in truths():
        assert f"### {name}\n" in text
    for picture in ("work_precision.png", "rack.png", "chaos.png"):
        assert (tmp_path / picture).stat().st_size > 10_000


@pytest.mark.parametrize(
    "arguments",
    [
        ("now",),
        ("--seeds", "0"),
        ("--seeds", "many"),
        ("--parts", "everything"),
        ("--from", "/nowhere/benchmark.json"),
        ("--from", str(REPOSITORY / "billiards_sim" / "study" / "truth.json")),
        ("--from", str(README)),
        ("--from", str(FIGURES), "--output", "/proc/nowhere"),
        ("--from", str(FIGURES), "--output", "{tmp}", "--quick"),
        ("--from", str(FIGURES), "--output", "{tmp}", "--seeds", "3"),
        ("--from", str(FIGURES), "--output", "{tmp}", "--parts", "speed"),
        ("--parts", "chaos", "--seeds", "3", "--output", "{tmp}", "--quick"),
    ],
    ids=" ".join,
)
def test_a_mistake_is_one_line_and_code_2(arguments: tuple[str, ...], tmp_path: Path) -> None:
    done = run(*(argument.replace("{tmp}", str(tmp_path)) for argument in arguments))
    assert done.returncode == 2
    assert done.stderr.startswith("benchmark: ")
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr


@needs_plot_extra
@pytest.mark.parametrize("module", ["matplotlib", "tqdm"])
def test_without_an_extra_one_line_names_it(tmp_path: Path, module: str) -> None:
    (tmp_path / module).mkdir()
    (tmp_path / module / "__init__.py").write_text(f"raise ModuleNotFoundError(name={module!r})", encoding="utf-8")
    path = os.pathsep.join(filter(None, (str(tmp_path), os.environ.get("PYTHONPATH"))))
    done = run("--quick", "--parts", "chaos", "--output", str(tmp_path / "out"), PYTHONPATH=path)
    assert done.returncode == 2
    assert done.stderr == f"benchmark: {module} is not there: pip install 'billiards_sim[plot]'\n"
    assert not (tmp_path / "out").exists()


@needs_plot_extra
def test_an_interrupted_study_writes_nothing(tmp_path: Path) -> None:
    child = subprocess.Popen(
        [sys.executable, "-m", "billiards_sim", "benchmark", "--parts", "precision", "--output", str(tmp_path / "out")],
        cwd=REPOSITORY,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    deadline = time.monotonic() + 60.0
    while not (tmp_path / "out").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    child.send_signal(signal.SIGINT)
    _, said = child.communicate(timeout=60.0)
    assert child.returncode == 1
    assert said.splitlines()[-1] == "benchmark: stopped; figures are written at the end only"
    assert list((tmp_path / "out").iterdir()) == []


def test_kept_figures_are_json_without_nan() -> None:
    json.loads(FIGURES.read_text(encoding="utf-8"), parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))


def test_this_engine_meets_first_what_the_reference_meets_and_breaks_on_the_pool_table() -> None:
    found = pool.measure("billiards_sim", 2)
    assert found["first_events"]["right"] == found["first_events"]["cases"] == 6
    assert found["first_events"]["error"] <= 1e-11
    simulation = bs.Simulation(pool.nine_ball_break())
    events = simulation.run()
    assert found["events"] == len(events) > 50
    assert found["pocketed"] == sum(event.kind == "pocketed" for event in events)
    assert 0.0 < found["wall"]["low"] <= found["wall"]["median"]


@pytest.mark.skipif(not measure.installed("pooltool"), reason="needs pooltool, see docs/benchmark")
def test_pooltool_has_the_table_of_the_same_figures(tmp_path: Path) -> None:
    found = measure.in_child(pool.measure, {"HOME": str(tmp_path)}, peer="pooltool", runs=1)
    assert found["first_events"]["right"] == 6
    assert found["first_events"]["error"] <= 1e-11
    assert found["events"] > 20


def test_the_table_of_the_pool_table_has_ratios_and_failures() -> None:
    def peer(median: float) -> dict:
        wall = {"median": median, "low": median, "high": 2.0 * median, "runs": 7}
        first = {"cases": 6, "right": 5, "error": 2e-15}
        return {"version": "1.0", "pool": {"wall": wall, "events": 80, "pocketed": 2, "first_events": first}}

    study = {
        "billiards_sim": peer(4e-4),
        "slow": peer(0.04),
        "broken": {"version": "2.0", "pool": {"failure": "no table"}},
        "without": {"version": "3.0"},
    }
    lines = report.pool_table(study).splitlines()[2:]
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert cells[0][:6] == ["billiards_sim 1.0", "0.400", "0.400", "0.800", "7", "1.00"]
    assert cells[1][5:] == ["100", "80", "2", "5 of 6; 2.0e-15 s"]
    assert cells[2][0] == "broken 2.0: failed: no table"
    assert len(cells) == 3
    rows = report.highlights({"peers": {name: one for name, one in study.items() if name != "without"}})
    assert ("nine-ball break, pool table, everything on, slow 1.0", "40.0 ms") in rows
