# SPDX-License-Identifier: Apache-2.0
"""Copies and pickles: of scenes, simulations and snapshots, within a process and across processes."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from checks import random_scene

import billiards_sim as bs
from billiards_sim.engine import simulation as simulation_module

HERE = Path(__file__).parent

COPIES: tuple[Callable[[Any], Any], ...] = (
    copy.copy,
    copy.deepcopy,
    lambda value: pickle.loads(pickle.dumps(value)),
)


def midway() -> bs.Simulation:
    """Shortly after a break, with orientations, and with a shot that no call has told of."""
    simulation = bs.Simulation(replace(bs.scenes.rack(), track_orientation=True))
    simulation.advance(0.3)
    simulation.strike((128.0, 1.5, 0.0))
    simulation.advance(0.21)
    simulation.strike((0.0, 10.0, 0.0), ball=simulation.start_scene.names[_resting(simulation)])
    return simulation


def _resting(simulation: bs.Simulation) -> int:
    return int(np.flatnonzero((simulation.velocities == 0.0).all(axis=1))[0])


def rest(simulation: bs.Simulation) -> tuple[Any, ...]:
    events = list(simulation.run())
    return events, simulation.time, simulation.positions.tobytes(), simulation.orientations.tobytes()


@pytest.mark.parametrize("copied", COPIES)
def test_copies_of_a_simulation_go_their_own_way(copied: Callable[[Any], Any]) -> None:
    original = midway()
    twin = copied(original)
    before = original.positions
    expected = rest(twin)
    assert expected[0][0].kind == "shot"
    assert np.array_equal(original.positions, before)
    assert rest(original) == expected


@pytest.mark.parametrize("copied", COPIES)
def test_copies_of_a_snapshot_are_restored(copied: Callable[[Any], Any]) -> None:
    simulation = midway()
    snapshot = copied(simulation.snapshot())
    expected = rest(simulation)
    simulation.restore(snapshot)
    assert rest(simulation) == expected
    copied(simulation).restore(snapshot)


@pytest.mark.parametrize("other", [None, 3, bs.scenes.head_on()])
def test_only_snapshots_are_restored(other: Any) -> None:
    with pytest.raises(ValueError, match="restored from a Snapshot, got .*"):
        midway().restore(other)


@pytest.mark.parametrize("copied", COPIES)
def test_copies_of_a_scene_are_equal_and_cannot_be_written_to(copied: Callable[[Any], Any]) -> None:
    scene = random_scene(1)
    twin = copied(scene)
    assert twin == scene
    assert hash(twin) == hash(scene)
    for array in (twin.positions, twin.velocities, twin.angular_velocities):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 7.0


def test_scenes_that_differ_are_not_equal() -> None:
    scene = random_scene(1)
    moved = scene.positions.copy()
    moved[0, 0] += 1e-15
    others = [
        replace(scene, positions=moved),
        replace(scene, velocities=0.5 * scene.velocities),
        replace(scene, physics=bs.Physics(mass=0.17)),
        replace(scene, names=[f"ball {name}" for name in scene.names]),
        replace(scene, shot=bs.Shot((1.0, 0.0, 0.0))),
        replace(scene, track_orientation=True),
        "a scene",
    ]
    assert all(scene != other for other in others)
    assert scene == replace(scene)


PLAY_ON = """
import pickle, sys
from test_copies import rest
simulation, snapshot = pickle.load(sys.stdin.buffer)
once = rest(simulation)
simulation.restore(snapshot)
assert rest(simulation) == once
sys.stdout.buffer.write(pickle.dumps(once))
"""


@pytest.mark.parametrize("interpreted", ["", "1"], ids=["compiled where it can be", "interpreted"])
def test_another_process_goes_on_with_the_same_bits(interpreted: str) -> None:
    simulation = midway()
    run = subprocess.run(
        [sys.executable, "-c", PLAY_ON],
        input=pickle.dumps((simulation, simulation.snapshot())),
        env={**os.environ, "PYTHONPATH": os.pathsep.join((str(HERE), *sys.path)), "NUMBA_DISABLE_JIT": interpreted},
        capture_output=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr.decode()
    assert pickle.loads(run.stdout) == rest(simulation)


@pytest.mark.parametrize("copied", COPIES)
def test_copies_know_the_last_shot(copied: Callable[[Any], Any], monkeypatch: pytest.MonkeyPatch) -> None:
    original = bs.Simulation(bs.scenes.rack())
    original.strike((128.0, 1.5, 0.0))
    original.advance(0.1)
    twin = copied(original)
    monkeypatch.setattr(simulation_module, "BATCH", 1)
    monkeypatch.setattr(simulation_module, "EVENT_BUDGET", 5)
    with pytest.raises(bs.StallError) as stall:
        twin.run()
    Path(str(stall.value.path)).unlink()
    assert stall.value.scene.shot == bs.Shot((128.0, 1.5, 0.0))
    assert np.array_equal(stall.value.scene.positions, original.start_scene.positions)
