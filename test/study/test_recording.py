# SPDX-License-Identifier: Apache-2.0
"""Recordings: from the start to the end of a run, the shot included."""

from __future__ import annotations

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.study.recording import record, ticks
from billiards_sim.study.time_stepping import SOLVERS

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
    path = recording.path()
    assert np.array_equal(path[0], start.positions)
    assert np.array_equal(path[-1], end.positions)


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
    centres = recording.path().reshape(-1, 2)
    corners = [event.point for event in recording.events if event.kind == "ball_rail"]
    assert len(corners) >= 3
    for corner in corners:
        nearest = np.hypot(*(centres - corner).T).min()
        assert nearest == pytest.approx(recording.scene.physics.radius, abs=1e-9)


def test_ticks_end_at_the_end_without_a_sliver_before() -> None:
    assert [*ticks(0.0, 0.35, 0.01)][-2:] == [0.34, 0.35]
    assert [*ticks(1.0, 1.25, 0.1)] == pytest.approx([1.0, 1.1, 1.2, 1.25])
    assert [*ticks(2.0, 2.0, 0.1)] == [2.0]
