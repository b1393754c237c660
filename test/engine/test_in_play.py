# SPDX-License-Identifier: Apache-2.0
"""Balls that are not in play: off the table, as if they were not there."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from checks import random_scene

import billiards_sim as bs
from billiards_sim.engine.recorder import Recorder

RADIUS = bs.Physics().radius


def without(scene: bs.Scene, *names: str) -> bs.Scene:
    """The scene with some balls off the table."""
    return replace(scene, in_play=[name not in names for name in scene.names])


def reduced(scene: bs.Scene) -> bs.Scene:
    """The scene of the balls in play alone."""
    return bs.Scene(
        scene.positions[scene.in_play],
        scene.velocities[scene.in_play],
        scene.angular_velocities[scene.in_play],
        [name for name, in_play in zip(scene.names, scene.in_play) if in_play],
    )


def state(simulation: bs.Simulation) -> list[bytes]:
    arrays = (simulation.positions, simulation.velocities, simulation.angular_velocities)
    return [values[simulation.in_play].tobytes() for values in arrays]


@pytest.mark.parametrize("off", [("cue",), ("1", "3"), ("2",), ("cue", "1", "2", "3", "4")])
@pytest.mark.parametrize("count", [12, 40], ids=["one cell", "many cells"])
def test_others_move_as_if_it_were_not_there(off: tuple[str, ...], count: int) -> None:
    scene = without(bs.scenes.random_balls(count, seed=6), *off)
    whole, part = bs.Simulation(scene), bs.Simulation(reduced(scene))
    for until in (0.3, 1.1):
        assert list(whole.run(until=until)) == list(part.run(until=until)) != []
        assert state(whole) == state(part)
        assert whole.kinetic_energy == pytest.approx(part.kinetic_energy, rel=1e-14)
    assert list(whole.run()) == list(part.run())
    assert state(whole) == state(part)
    assert whole.at_rest


def test_a_shot_goes_through_where_a_ball_is_not() -> None:
    scene = bs.Scene([[0.5, 0.6], [0.5 + 3.0 * RADIUS, 0.6], [2.0, 0.6]], in_play=[True, False, True])
    whole, part = bs.Simulation(scene), bs.Simulation(reduced(scene))
    for simulation, hit in ((whole, "2"), (part, "2")):
        simulation.strike((80.0, 0.0, 0.0))
        assert next(event for event in simulation.advance(1.0) if event.kind == "ball_ball").balls == ("cue", hit)
    assert state(whole) == state(part)
    whole.run()
    part.run()
    whole.strike((30.0, 9.0, 0.0))  # once more, from rest
    part.strike((30.0, 9.0, 0.0))
    assert list(whole.run()) == list(part.run())
    assert state(whole) == state(part)


def test_it_has_no_position_and_does_not_move() -> None:
    simulation = bs.Simulation(without(random_scene(4), "1"))
    for _ in range(3):
        assert simulation.in_play.tolist() == [name != "1" for name in simulation.start_scene.names]
        assert np.isnan(simulation.positions[1]).all()
        assert np.isfinite(np.delete(simulation.positions, 1, axis=0)).all()
        assert simulation.velocities[1].tolist() == [0.0, 0.0]
        assert simulation.angular_velocities[1].tolist() == [0.0, 0.0, 0.0]
        simulation.advance(0.4)
    simulation.in_play[:] = True  # a copy
    assert not simulation.in_play[1]


def test_it_cannot_be_struck() -> None:
    simulation = bs.Simulation(without(bs.scenes.rack(), "cue"))
    with pytest.raises(ValueError, match="ball 'cue' is not in play"):
        simulation.strike((80.0, 0.0, 0.0))
    simulation.strike((80.0, 0.0, 0.0), ball="1")
    assert {name for event in simulation.run() for name in event.balls} >= {"1", "2", "9"}


def test_it_overlaps_with_nothing_and_lies_in_no_rail() -> None:
    scene = bs.Scene(
        [[1.0, 0.5], [1.0, 0.5], [-3.0, 0.5]], [[0.0, 0.0]] * 2 + [[9e9, 0.0]], in_play=[True, False, False]
    )
    assert np.isnan(scene.positions[1:]).all()
    assert scene.positions[0].tolist() == [1.0, 0.5]
    assert scene.velocities.tolist() == [[0.0, 0.0]] * 3
    with pytest.raises(ValueError, match="overlap"):
        replace(scene, positions=[[1.0, 0.5]] * 3, in_play=[True, True, False])
    with pytest.raises(ValueError, match="'2' reaches"):
        replace(scene, positions=[[1.0, 0.5], [1.0, 0.5], [0.0, 0.5]], in_play=[True, False, True])
    with pytest.raises(ValueError, match="positions of ball '1' must be finite"):
        replace(scene, in_play=[True, True, False])


def test_a_table_may_be_empty() -> None:
    simulation = bs.Simulation(without(bs.scenes.head_on(), "cue", "1"))
    assert simulation.at_rest
    assert list(simulation.run()) == list(simulation.advance(1.0)) == []
    assert (simulation.time, simulation.kinetic_energy) == (1.0, 0.0)


@pytest.mark.parametrize("bad", [[True], [[True, True]], [1, 0], ["yes", "no"], 3, [True, None]])
def test_other_than_a_truth_value_for_each_ball_is_refused(bad: object) -> None:
    with pytest.raises(ValueError, match=r"in_play must be truth values of shape \(2,\), got"):
        bs.Scene([[1.0, 0.5], [1.5, 0.5]], in_play=bad)  # type: ignore[arg-type]


def test_a_shot_at_it_is_no_scene() -> None:
    with pytest.raises(ValueError, match="shot.ball 'cue' is not in play"):
        bs.Scene([[1.0, 0.5]], in_play=[False], shot=bs.Shot((1.0, 0.0, 0.0)))


def test_scenes_keep_it() -> None:
    scene = without(random_scene(4), "1")
    simulation = bs.Simulation(scene)
    simulation.run()
    assert simulation.scene().in_play.tolist() == scene.in_play.tolist()
    assert simulation.scene() == bs.Simulation(simulation.scene()).scene()
    assert scene == without(random_scene(4), "1") != random_scene(4)
    with pytest.raises(ValueError, match="read-only"):
        scene.in_play[1] = True


def test_scene_files_keep_it(tmp_path: Path) -> None:
    scene = without(random_scene(4), "1")
    bs.save_scene(scene, tmp_path / "scene.yaml")
    written = yaml.safe_load((tmp_path / "scene.yaml").read_text(encoding="utf-8"))
    assert written["balls"][1] == {"name": "1", "in_play": False}
    assert bs.load_scene(tmp_path / "scene.yaml") == scene


@pytest.mark.parametrize(
    "ball, complaint",
    [
        ("{name: a, in_play: false, position: [1, 0.5]}", "which is not in play, has no key 'position'"),
        ("{name: a, in_play: 0}", r"balls\[0\] lacks position"),
        ("{name: a, in_play: 1, position: [1, 0.5]}", "in_play must be truth values"),
        ("{name: a, in_play: true}", r"balls\[0\] lacks position"),
    ],
)
def test_a_file_says_one_thing_about_a_ball(ball: str, complaint: str, tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(f"balls:\n  - {ball}\n", encoding="utf-8")
    with pytest.raises(ValueError, match=complaint):
        bs.load_scene(path)


def test_recordings_leave_it_out() -> None:
    scene = without(random_scene(4), "1")
    run, part = bs.record(bs.Simulation(scene)), bs.record(bs.Simulation(reduced(scene)))
    times = np.linspace(run.start, run.end, 20)
    assert np.isnan(run.positions(times)[:, 1]).all()
    assert np.array_equal(run.positions(times)[:, scene.in_play], part.positions(times))
    assert np.array_equal(run.orientations(times)[:, scene.in_play], part.orientations(times))
    assert run.path("1").shape == (0, 3)
    lengths = []
    for start in (scene, reduced(scene)):
        recorder = Recorder(len(start))
        bs.Simulation(start).run(recorder=recorder)
        lengths.append(len(recorder.arcs()))
    assert lengths[0] == lengths[1] + 1
    assert np.array_equal(run.path("2"), part.path("2"))


def test_orientation_of_the_others_is_what_it_would_be() -> None:
    scene = without(random_scene(4), "1")
    whole = bs.Simulation(replace(scene, track_orientation=True))
    part = bs.Simulation(replace(reduced(scene), track_orientation=True))
    whole.run(until=1.0)
    part.run(until=1.0)
    assert np.array_equal(whole.orientations[scene.in_play], part.orientations)
    assert whole.orientations[1].tolist() == [0.0, 0.0, 0.0, 1.0]
    assert math.isfinite(whole.kinetic_energy)
