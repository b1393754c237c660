# SPDX-License-Identifier: Apache-2.0
"""Recordings: from the start to the end of a run, the shot included."""

from __future__ import annotations

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.study import recording as recording_module
from billiards_sim.study.recording import record, ticks
from billiards_sim.study.time_stepping import SOLVERS, SchemeError

SHOT = bs.Scene([[0.5, 0.5], [1.5, 0.52]], shot=bs.Shot((60.0, 5.0, 0.0), (0.004, -0.01)))


@pytest.mark.parametrize("name", SOLVERS)
def test_samples_path_and_poses_go_from_the_shot_to_the_end(name: str) -> None:
    recording = record(SHOT, name, 0.01, until=0.6)
    start, end = recording.start, recording.end
    struck = bs.Simulation(SHOT)
    struck.strike((60.0, 5.0, 0.0), (0.004, -0.01))
    np.testing.assert_allclose(start.velocities, struck.velocities, rtol=0, atol=1e-15)
    np.testing.assert_allclose(start.positions, struck.positions, rtol=0, atol=1e-15)
    assert recording.events[0].kind == "shot"
    assert np.abs(end.positions - start.positions).max() > 0.3
    samples = [*recording.samples(0.05)]
    poses = [*recording.poses([start.time, end.time])]
    for one, other in ((samples[0], start), (samples[-1], end), (poses[0], start), (poses[-1], end)):
        assert one.time == other.time
        assert np.array_equal(one.positions, other.positions)
    for index, ball in enumerate(SHOT.names):
        path = recording.path(ball)
        assert path[0].tolist() == [start.time, *start.positions[index].tolist()]
        assert path[-1, 1:].tolist() == end.positions[index].tolist()


def test_last_state_is_at_the_time_asked_for_to_the_bit() -> None:
    # The last step begins at a collision, and the two add up to the time but for rounding.
    rounded = 0
    for until in np.linspace(0.006, 0.009, 30).tolist():
        recording = record(bs.Scene([[0.5, 0.5], [0.57, 0.5]], [[5.0, 0.0], [0.0, 0.0]]), "time_step", until=until)
        (collision,) = recording.events
        rounded += collision.time + (until - collision.time) != until
        assert [*recording.samples(1.0)][-1].time == recording.end.time == until
    assert rounded > 0


def test_path_of_the_engine_has_every_corner() -> None:
    recording = record(bs.scenes.glancing())
    centres = np.concatenate([recording.path(ball)[:, 1:] for ball in recording.scene.names])
    corners = [event.point for event in recording.events if event.kind == "ball_rail"]
    assert len(corners) >= 3
    for corner in corners:
        nearest = np.hypot(*(centres - corner).T).min()
        assert nearest == pytest.approx(recording.scene.physics.radius, abs=1e-9)


def test_ticks_end_at_the_end_without_a_sliver_before() -> None:
    assert [*ticks(0.0, 0.35, 0.01)][-2:] == [0.34, 0.35]
    assert [*ticks(1.0, 1.25, 0.1)] == pytest.approx([1.0, 1.1, 1.2, 1.25])
    assert [*ticks(2.0, 2.0, 0.1)] == [2.0]


@pytest.mark.parametrize(("end", "interval"), [(1.0, 1e-300), (1e300, 0.01), (1e300, 1e-300), (1.0, 0.1)])
def test_too_many_ticks_are_refused(end: float, interval: float) -> None:
    with pytest.raises(ValueError, match=r"times, .* s apart until .* s, are too many: at most 10"):
        ticks(0.0, end, interval, most=10)


def test_looking_at_many_times_gives_the_bits_of_looking_at_one(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = record(SHOT, until=1.0)
    whole = [state.positions.tobytes() for state in recording.samples(0.01)]
    monkeypatch.setattr(recording_module, "CHUNK", 7)
    assert [state.positions.tobytes() for state in recording.samples(0.01)] == whole
    assert len(set(whole)) == len(whole) == 101


def test_a_run_of_too_many_events_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    physics = bs.Physics(rail_restitution=1.0, sliding_friction=0.0, rolling_friction=0.0)
    scene = bs.Scene([[1.0, 0.5]], [[2.0, 0.7]], physics=physics)
    monkeypatch.setattr(recording_module, "MOST_EVENTS", 100)
    monkeypatch.setattr(recording_module, "PIECE", 0.0)
    with pytest.raises(recording_module.TooMany, match="more than 100 events by .* s: end it earlier, with --until"):
        record(scene, until=1e300)
    assert 50 < len(record(scene, until=50.0).events) <= 100


def test_a_run_in_pieces_is_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = record(SHOT)
    monkeypatch.setattr(recording_module, "PIECE", 0.0)
    pieces = record(SHOT)
    assert list(pieces.events) == list(whole.events)
    assert pieces.end.positions.tobytes() == whole.end.positions.tobytes()
    times = np.linspace(0.0, whole.end.time, 50)
    assert [pose.positions.tobytes() for pose in pieces.poses(times)] == [
        pose.positions.tobytes() for pose in whole.poses(times)
    ]


def test_a_stepped_run_of_too_many_steps_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="1e[+]300 steps of 1 s to 1e[+]300 s are too many: at most 1000000"):
        record(SHOT, "time_step", 1.0, until=1e300)
    monkeypatch.setattr(recording_module, "MOST_STEPS", 50)
    with pytest.raises(SchemeError, match="50 steps of 1e-300 s lead to 5e-299 s only"):
        record(SHOT, "time_step", 1e-300)
