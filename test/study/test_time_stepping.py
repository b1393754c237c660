# SPDX-License-Identifier: Apache-2.0
"""The time-stepping solvers: the literal one against runs of the paper's program, the corrected one against the engine.

`data/paper_runs.csv` holds what the paper's program gives for its scenes 1 and 2 at two time steps. `t` is its clock,
`elapsed` the time that has passed; step -1 is the start, step 0 the one it does not count. `collision_type` is 1 for
two balls, 2 for a rail at low x or y, 3 for one at high x or y.
"""

from __future__ import annotations

import csv
import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.study.time_stepping import SOLVERS, PaperSolver, SchemeError, TimeStepSolver

PAPER_RUNS = Path(__file__).parent.parent / "data" / "paper_runs.csv"
STATE = ("x", "y", "vx", "vy", "wx", "wy", "wz")
RADIUS = bs.Physics().radius
TABLE = bs.Table()
SCENES = {"1": bs.scenes.head_on, "2": bs.scenes.glancing}
STEPPED = ("time_step", "paper")


def paper_runs() -> dict[tuple[str, str], list[list[dict[str, str]]]]:
    """By scene and time step: for each recorded step, the rows of its balls."""
    with PAPER_RUNS.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    runs = itertools.groupby(rows, key=lambda row: (row["scene"], row["time_step"]))
    return {
        run: [list(balls) for _, balls in itertools.groupby(group, key=lambda row: row["step"])] for run, group in runs
    }


@pytest.mark.parametrize("scene, time_step", paper_runs())
def test_paper_solver_gives_what_the_papers_program_gives(scene: str, time_step: str) -> None:
    solver = PaperSolver(SCENES[scene](), float(time_step))
    within_a_step = 1e-7  # s, less than any step of these runs
    for balls in paper_runs()[scene, time_step]:
        clock, elapsed = float(balls[0]["t"]), float(balls[0]["elapsed"])
        events = solver.run(until=clock - within_a_step) if elapsed > 0.0 else []
        assert solver.time == pytest.approx(clock, rel=0, abs=1e-9)
        assert solver.time + float(time_step) == pytest.approx(elapsed, rel=0, abs=1e-9)
        state = np.column_stack((solver.positions, solver.velocities, solver.angular_velocities))
        expected = [[float(row[column]) for column in STATE] for row in balls]
        np.testing.assert_allclose(state, expected, rtol=0, atol=1e-9)
        collided = bool(events) and events[-1].time == solver.time
        assert collided == (balls[0]["collision_type"] != "0")


def test_paper_runs_cover_two_scenes_at_two_time_steps_to_five_seconds() -> None:
    runs = paper_runs()
    assert set(runs) == {(scene, step) for scene in SCENES for step in ("0.01", "0.001")}
    assert all(float(steps[-1][0]["t"]) >= 5.0 for steps in runs.values())


@pytest.mark.parametrize("make", [bs.scenes.head_on, bs.scenes.glancing])
def test_time_step_solver_converges_at_first_order(make) -> None:
    # What is first order is rolling friction, which acts through the whole of the step in which slip ends: the error
    # in the speed is mu_r g times the part of that step before the end of slip. These steps put it half-way.
    until = 0.35
    exact = bs.Simulation(make())
    events = {event.kind: event.time for event in exact.run(until=until)}
    slipping = events["rolling"] - events["ball_ball"]
    time_steps = [slipping / (steps + 0.5) for steps in (40, 80, 160, 320, 640, 1280)]
    errors = []
    for time_step in time_steps:
        solver = TimeStepSolver(make(), time_step)
        solver.run(until=until)
        errors.append(np.abs(solver.positions - exact.positions).max())
    slope = np.polyfit(np.log(time_steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)
    physics = exact.start_scene.physics
    speed_error = 0.5 * physics.rolling_friction * physics.gravity * time_steps[-1]
    assert errors[-1] == pytest.approx(speed_error * (until - events["rolling"]), rel=0.2)


def test_paper_solver_does_not_converge() -> None:
    exact = bs.Simulation(bs.scenes.glancing())
    errors = []
    for time_step in (0.01, 0.001):
        solver = PaperSolver(exact.start_scene, time_step)
        solver.run(until=2.0)
        compared = exact.copy()
        compared.run(until=solver.time + time_step)  # the time that has passed
        errors.append(np.hypot(*(solver.positions - compared.positions).T).max())
    assert errors[1] > 0.9 * errors[0] > 0.1


def test_time_step_solver_comes_to_rest_where_the_engine_does() -> None:
    for make in (bs.scenes.head_on, bs.scenes.glancing):
        exact = bs.Simulation(make())
        exact.run()
        for time_step in (0.01, 0.001):
            solver = TimeStepSolver(make(), time_step)
            solver.run()
            assert solver.at_rest
            assert solver.time == pytest.approx(exact.time, rel=0, abs=2.0 * time_step)
            # Speeds are wrong by mu_r g dt, which a ball rolling at v carries for v/(mu_r g): by v dt, v < 1 m/s.
            np.testing.assert_allclose(solver.positions, exact.positions, rtol=0, atol=1.0 * time_step)


def test_time_step_solver_gets_a_break_right() -> None:
    exact, solver = bs.Simulation(bs.scenes.rack()), TimeStepSolver(bs.scenes.rack(), 0.001)
    for each in (exact, solver):
        each.strike((128.0, 1.5, 0.0))
        each.run(until=1.0)
    np.testing.assert_allclose(solver.positions, exact.positions, rtol=0, atol=1e-3)
    assert np.abs(exact.positions - exact.start_scene.positions).max() > 0.5


def test_time_step_solver_rolls_without_slip_and_slows_by_rolling_friction() -> None:
    physics = bs.Physics()
    solver = TimeStepSolver(bs.Scene([TABLE.centre], [[0.3, -0.4]], [[0.4 / RADIUS, 0.3 / RADIUS, 7.0]]), 0.01)
    solver.run(until=1.0)
    speed = 0.5 - physics.rolling_friction * physics.gravity
    assert solver.velocities[0] == pytest.approx([0.6 * speed, -0.8 * speed], rel=1e-12)
    assert solver.angular_velocities[0] == pytest.approx([0.8 * speed / RADIUS, 0.6 * speed / RADIUS, 7.0], rel=1e-12)


def test_paper_solver_never_rests() -> None:
    table = bs.Table(length=100.0, width=100.0)
    scene = bs.Scene([table.centre], [[0.5, 0.0]], [[0.0, 0.5 / RADIUS, 0.0]], table=table)
    exact, solver = bs.Simulation(scene), PaperSolver(scene, 0.01)
    exact.run()
    with pytest.raises(ValueError, match="never rest"):
        solver.run()
    solver.run(until=4.0 * exact.time)
    assert not solver.at_rest
    assert solver.velocities[0] == pytest.approx([0.5, 0.0], abs=0.005)


@pytest.mark.parametrize("name", SOLVERS)
def test_collisions_are_found_in_order_and_near_their_times(name: str) -> None:
    time_step = 0.001
    solver = SOLVERS[name](bs.scenes.glancing(), time_step)
    exact = list(bs.Simulation(bs.scenes.glancing()).run(until=1.0))
    expected = [event for event in exact if event.kind.startswith("ball_")]
    found = [event for event in solver.run(until=1.0) if event.kind.startswith("ball_")]
    assert len(expected) == 3
    late = time_step if name == "paper" else 0.0
    for event, other in zip(found[:2], expected[:2], strict=True):
        assert (event.kind, event.balls, event.rail) == (other.kind, other.balls, other.rail)
        assert event.time + late == pytest.approx(other.time, rel=0, abs=1e-4)
        assert event.point == pytest.approx(other.point, abs=1e-3)
        assert event.normal == pytest.approx(other.normal, abs=1e-3)
        assert event.approach_speed == pytest.approx(other.approach_speed, rel=1e-3)
        assert event.impulse == pytest.approx(other.impulse, rel=1e-3)
    if name != "paper":
        assert [(event.kind, event.balls) for event in found] == [(event.kind, event.balls) for event in expected]


@pytest.mark.parametrize("name", SOLVERS)
def test_solvers_share_one_interface(name: str) -> None:
    scene = bs.scenes.head_on()
    solver = SOLVERS[name](scene, 0.01)
    assert solver.start_scene is scene
    assert not solver.at_rest
    assert solver.kinetic_energy == pytest.approx(0.5 * scene.physics.mass * 25.0, rel=1e-15)
    for array, expected in (
        (solver.positions, scene.positions),
        (solver.velocities, scene.velocities),
        (solver.angular_velocities, scene.angular_velocities),
    ):
        np.testing.assert_allclose(array, expected, rtol=0, atol=1e-15)
        array += 1.0  # a copy
    np.testing.assert_allclose(solver.positions, scene.positions, rtol=0, atol=1e-15)
    events = [*solver.run(until=0.1), *solver.run(until=0.3)]
    assert [event.kind for event in events if event.kind != "rolling"] == ["ball_ball"]
    with pytest.raises(ValueError, match="until must be"):
        solver.run(until=0.2)
    with pytest.raises(ValueError, match="until must be"):
        solver.run(until=float("nan"))


@pytest.mark.parametrize("name, late", [("event", 0.0), ("time_step", 0.0), ("paper", 0.01)])
def test_clock_where_a_run_ends(name: str, late: float) -> None:
    solver = SOLVERS[name](bs.scenes.head_on(), 0.01)
    rounding = (0.0023802028304333897, 0.006759809836048891)  # a, b with a + (b - a) > b
    for until in (*rounding, 0.123, 0.123, 0.5):
        solver.run(until=until)
        assert until <= solver.time <= until + late  # to the bit but for the paper's


def test_clock_of_the_paper_solver_is_0_after_the_first_step_even_if_that_ends_at_a_collision() -> None:
    solver = PaperSolver(bs.Scene([[TABLE.x_max - RADIUS - 0.01, 0.5]], [[5.0, 0.0]]), 0.01)
    (event,) = solver.run(until=0.0)
    assert solver.time == 0.0
    assert event.time == pytest.approx(-0.01 + 0.01 / 5.0, rel=1e-12)
    assert solver.velocities[0, 0] == pytest.approx(-0.7 * 5.0, rel=1e-2)


@pytest.mark.parametrize("name", SOLVERS)
def test_shot_is_the_engines(name: str) -> None:
    scene = bs.Scene([[0.5, 0.5], [1.5, 0.5]])
    exact, solver = bs.Simulation(scene), SOLVERS[name](scene, 0.01)
    for each in (exact, solver):
        each.strike((20.0, 30.0, 0.0), offset=(0.005, -0.01))
    start = solver.time
    assert np.array_equal(solver.velocities, exact.velocities)
    assert np.array_equal(solver.angular_velocities, exact.angular_velocities)
    np.testing.assert_allclose(solver.positions, exact.positions, rtol=0, atol=1e-15)
    shot, expected = solver.run(until=0.05)[0], exact.run(until=0.05)[0]
    assert (shot.kind, shot.balls, shot.time) == ("shot", ("cue",), start)
    assert (shot.point, shot.normal, shot.impulse) == (expected.point, expected.normal, expected.impulse)
    assert solver.run(until=0.06) == []
    with pytest.raises(ValueError, match="must"):
        solver.strike((20.0, 0.0, 0.0))


@pytest.mark.parametrize("name", STEPPED)
def test_a_refused_shot_changes_nothing(name: str) -> None:
    solver = SOLVERS[name](bs.scenes.head_on(), 0.01)
    with pytest.raises(ValueError, match="must rest"):
        solver.strike((20.0, 0.0, 0.0))
    assert solver.velocities.tolist() == [[5.0, 0.0], [0.0, 0.0]]
    assert solver.run(until=0.05) == []


@pytest.mark.parametrize("name", STEPPED)
def test_balls_that_are_not_in_play_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match="every ball in play; ball '1' is not"):
        SOLVERS[name](replace(bs.scenes.head_on(), in_play=[True, False]), 0.01)


@pytest.mark.parametrize(
    ("effect", "paper"),
    [
        *(("ball_restitution", 1.0), ("ball_friction", 0.0), ("ball_friction_slow", 0.0)),
        *(("rail_friction", 0.0), ("spin_friction", 0.0)),
    ],
)
@pytest.mark.parametrize("name", STEPPED)
def test_physics_that_the_paper_does_not_have_is_refused(name: str, effect: str, paper: float) -> None:
    scene = bs.scenes.head_on(physics=bs.Physics(**{effect: 0.015625}))
    with pytest.raises(ValueError, match=f"the paper's model: physics.{effect} must be {paper}, got 0.015625$"):
        SOLVERS[name](scene, 0.01)


@pytest.mark.parametrize("name", STEPPED)
def test_a_tilted_nose_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"the paper's model: table.nose_height must be 0.5, got 0.635$"):
        SOLVERS[name](bs.scenes.head_on(table=bs.Table(nose_height=0.635)), 0.01)


@pytest.mark.parametrize("name", STEPPED)
def test_the_cue_has_its_effects_in_all_solvers(name: str) -> None:
    scene = bs.Scene([TABLE.centre], physics=bs.Physics(cue_end_mass=0.006, miscue_limit=0.5))
    exact, solver = bs.Simulation(scene), SOLVERS[name](scene, 0.01)
    for each in (exact, solver):
        each.strike((20.0, 30.0, -10.0), offset=(0.008, 0.0))
    assert np.array_equal(solver.velocities, exact.velocities)
    assert np.array_equal(solver.angular_velocities, exact.angular_velocities)
    assert abs(exact.velocities[0, 0] / exact.velocities[0, 1] - 2.0 / 3.0) > 1e-2


@pytest.mark.parametrize("time_step", [0.0, -0.01, float("inf"), float("nan"), 1.01])
@pytest.mark.parametrize("name", STEPPED)
def test_time_step_must_be_positive_and_short(name: str, time_step: float) -> None:
    with pytest.raises(ValueError, match="time_step must be a number > 0, <= 1 "):
        SOLVERS[name](bs.scenes.head_on(), time_step)


def test_time_step_solver_refuses_to_wait_for_rest_without_friction() -> None:
    solver = TimeStepSolver(bs.Scene([TABLE.centre], [[1.0, 0.0]], physics=bs.Physics(rolling_friction=0.0)))
    with pytest.raises(ValueError, match="rolling_friction 0"):
        solver.run()


@pytest.mark.parametrize("name", STEPPED)
def test_thin_hits_within_a_step_are_missed(name: str) -> None:
    # At 5 m/s in steps of 10 ms; the chord through the other ball is a sixth of a step long.
    start = bs.Scene([[0.9, 0.5 + 1.997 * RADIUS], [1.025, 0.5]], [[5.0, 0.0], [0.0, 0.0]])
    assert [event.kind for event in bs.Simulation(start).run(until=0.1)][:1] == ["ball_ball"]
    assert SOLVERS[name](start, 0.01).run(until=0.1) == []


@pytest.mark.parametrize("name", STEPPED)
def test_touching_balls_at_rest_stay(name: str) -> None:
    # 0/0 in the times of contact of the pair and of the rail.
    scene = bs.Scene([[TABLE.x_min + RADIUS, 0.5], [TABLE.x_min + 3.0 * RADIUS, 0.5]])
    solver = SOLVERS[name](scene, 0.01)
    assert solver.run(until=0.1) == []
    assert np.array_equal(solver.positions, scene.positions)


@pytest.mark.parametrize("name", STEPPED)
def test_a_ball_passes_through_one_that_it_touches(name: str) -> None:
    # The time of contact is 0, which does not count; later steps start in overlap and find the time of parting.
    physics = bs.Physics(radius=1.0 / 32.0)
    scene = bs.Scene([[0.5, 0.5], [0.5 + 1.0 / 16.0, 0.5]], [[3.0, 0.0], [0.0, 0.0]], physics=physics)
    solver = SOLVERS[name](scene, 0.01)
    assert solver.run(until=0.05) == []
    assert solver.positions[0, 0] > solver.positions[1, 0] + 1.0 / 16.0
    assert bs.Simulation(scene).run(until=0.05)[0].kind == "ball_ball"


@pytest.mark.parametrize("name", STEPPED)
def test_balls_that_part_from_overlap_can_collide_when_they_part(name: str) -> None:
    # Friction takes them together again within the step, so they overlap at its end.
    scene = bs.Scene(
        [[0.5, 0.5], [0.5 + 2.0 * RADIUS - 1e-10, 0.5]], [[-1e-4, 0.0], [0.0, 0.0]], [[0.0, 50.0, 0.0], [0.0, 0.0, 0.0]]
    )
    solver = SOLVERS[name](scene, 0.01)
    event = solver.run(until=0.0 if name == "paper" else 1e-3)[0]
    assert event.time - (-0.01 if name == "paper" else 0.0) == pytest.approx(1e-10 / 1e-4, rel=1e-5)
    assert event.approach_speed < 0.0


def test_endless_bounces_end_in_an_error() -> None:
    # Topspin beside a rail.
    solver = PaperSolver(bs.Scene([[TABLE.x_max - RADIUS - 1e-6, 0.5]], [[0.0, 0.0]], [[0.0, 100.0, 0.0]]), 0.01)
    with pytest.raises(SchemeError, match=r"at 0\.078\d* s: stalled: 1000 contacts, .*'cue' with rail x_max"):
        solver.run(until=0.1)


def test_time_step_solver_survives_topspin_beside_a_rail() -> None:
    scene = bs.Scene([[TABLE.x_max - RADIUS - 1e-6, 0.5]], [[0.0, 0.0]], [[0.0, 100.0, 0.0]])
    for time_step in (0.01, 0.001):
        solver = TimeStepSolver(scene, time_step)
        events = solver.run()
        times = [event.time for event in events]
        assert times == sorted(times)
        assert {event.rail for event in events} == {"x_max"}
        into_rail = solver.positions[0, 0] - (TABLE.x_max - RADIUS)
        assert -RADIUS < into_rail < 0.2 * time_step  # m: it sinks in a little at each bounce


def test_division_by_zero_ends_in_an_error() -> None:
    solver = PaperSolver(bs.Scene([[TABLE.x_min + RADIUS + 1e-6, 0.5]], [[0.0, 0.0]], [[0.0, -100.0, 0.0]]), 0.01)
    with pytest.raises(SchemeError, match="at -0.01 s: ball 'cue' at .* rail x_min at 0 m/s, .* -inf s"):
        solver.run(until=0.1)
    assert solver.positions[0, 0] == TABLE.x_min + RADIUS + 1e-6


@pytest.mark.parametrize("name", STEPPED)
def test_a_contact_that_straight_lines_miss_ends_in_an_error(name: str) -> None:
    # Slip to the side bends the path into the other ball by 94 % of mu_s g dt^2/2 = 98 um.
    positions = [[0.991, 0.5 + 2.0 * RADIUS + 50e-6], [1.0, 0.5]]
    spins = [[100.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    solver = SOLVERS[name](bs.Scene(positions, [[1.0, 0.0], [0.0, 0.0]], spins), 0.01)
    with pytest.raises(SchemeError, match="'cue' and '1' overlap after the step, .* 5e-05 m apart"):
        solver.run(until=0.1)
