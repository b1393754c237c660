# SPDX-License-Identifier: Apache-2.0
"""The same source compiled and interpreted: the same bits; and what importing the engine brings in."""

from __future__ import annotations

import copy
import hashlib
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
from checks import COMPILED, POOL, POOL_TABLE, random_scene
from pocket_checks import mouth_scene
from test_copies import midway, rest

import billiards_sim as bs
from billiards_sim.engine import machine, tables
from billiards_sim.engine import simulation as simulation_module

HERE = Path(__file__).parent


def digest() -> str:
    """Of every event and final state of a break, of the exact scenes' kind of scene and of random ones."""
    scenes = [bs.scenes.head_on(), bs.scenes.glancing(), bs.scenes.rack(), bs.scenes.rack(0.0)]
    scenes += [random_scene(seed) for seed in range(20)]
    scenes.append(bs.Scene([[2.35, 0.6]], [[0.1, 0.5]], [[0.0, 150.0, 0.0]]))
    scenes += [replace(scene, physics=bs.Physics(**POOL), table=POOL_TABLE) for scene in scenes]
    scenes += [mouth_scene(seed) for seed in range(12)]
    summary = hashlib.sha256()
    for scene in scenes:
        simulation = bs.Simulation(scene)
        if scene.name == "rack":
            simulation.strike((120.0, 1.0, 0.0), (0.004, 0.006))
        for event in simulation.run():
            summary.update(repr(event).encode())
        for state in (simulation.positions, simulation.velocities, simulation.angular_velocities):
            summary.update(np.ascontiguousarray(state).tobytes())
    return summary.hexdigest()


def new_process(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    run = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join((str(HERE), *sys.path)), **environment},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run


def in_new_process(code: str, **environment: str) -> str:
    return new_process(code, **environment).stdout.strip()


@pytest.mark.skipif(not COMPILED, reason="needs Numba, switched on")
def test_compiled_and_interpreted_kernels_give_the_same_bits() -> None:
    interpreted = in_new_process("from test_two_speeds import digest; print(digest())", NUMBA_DISABLE_JIT="1")
    assert interpreted == digest()


class Rows(list[Any]):
    """A table that takes no negative row, as machine code takes none."""

    def __getitem__(self, row: Any) -> Any:
        assert isinstance(row, slice) or row >= 0
        return super().__getitem__(row)


def test_no_kernel_takes_a_negative_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "is_ready", lambda: False)
    rows = tables.rows
    monkeypatch.setattr(tables, "rows", lambda kind, count: Rows(rows(kind, count)))
    pool = bs.Physics.pool()
    scenes = [bs.scenes.eight_ball(), bs.scenes.rack(0.0, physics=pool), random_scene(3), mouth_scene(5)]
    scenes.append(replace(random_scene(4), physics=pool, table=POOL_TABLE))
    for scene in scenes:
        simulation = bs.Simulation(scene)
        assert isinstance(simulation._now.state.balls, Rows)
        if not simulation.velocities.any():
            simulation.shoot(8.0, 0.01)
        assert simulation.run()


Ready = Callable[[], bool]


@pytest.fixture
def changes_over(monkeypatch: pytest.MonkeyPatch) -> Callable[[Ready], None]:
    """Lets a function say whether there is machine code."""
    if not COMPILED:
        pytest.skip("needs Numba, switched on")

    def says(ready: Ready) -> None:
        monkeypatch.setattr(machine, "is_ready", ready)

    return says


def at_random(seed: int) -> Ready:
    random = np.random.default_rng(seed)
    return lambda: bool(random.integers(2))


def restored(simulation: bs.Simulation) -> bs.Simulation:
    snapshot = pickle.loads(pickle.dumps(simulation.snapshot()))
    simulation.restore(snapshot)
    return simulation


DETOURS: tuple[Callable[[bs.Simulation], bs.Simulation], ...] = (
    lambda simulation: simulation,
    bs.Simulation.copy,
    copy.deepcopy,
    lambda simulation: pickle.loads(pickle.dumps(simulation)),
    restored,
)


def played(seed: int, detours: bool) -> tuple[object, ...]:
    """A break in several pieces, with an orientation for every third, and what is recorded of its end."""
    random = np.random.default_rng(seed)
    simulation = bs.Simulation(replace(bs.scenes.rack(), track_orientation=seed % 3 == 0))
    simulation.advance(0.25)
    simulation.strike((100.0, float(random.uniform(-2.0, 2.0)), 0.0), tuple(random.uniform(-0.006, 0.006, 2)))
    events = []
    for duration in random.uniform(0.0, 0.6, 6):
        events += simulation.advance(duration)
        detour = DETOURS[random.integers(len(DETOURS))]
        simulation = detour(simulation) if detours else simulation
    run = bs.record(simulation)
    times = np.linspace(run.start, run.end, 7)
    arrays = [run.positions(times), run.orientations(times), simulation.positions, simulation.angular_velocities]
    arrays += [simulation.orientations] if seed % 3 == 0 else []
    return [*events, *run.events], simulation.time, *(values.tobytes() for values in arrays)


@pytest.mark.parametrize("seed", range(30))
def test_breaks_that_change_over_at_random_have_the_same_bits(
    seed: int, changes_over: Callable[[Ready], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = played(seed, detours=False)
    monkeypatch.setattr(simulation_module, "BATCH", 500)  # so that runs change over as well
    ready = at_random(seed)
    said: list[bool] = []
    changes_over(lambda: said.append(ready()) or said[-1])
    assert played(seed, detours=True) == expected
    assert sum(before != after for before, after in zip(said, said[1:])) > 5


@pytest.mark.parametrize("first", [True, False], ids=["machine code first", "interpreted first"])
@pytest.mark.parametrize("detour", DETOURS)
def test_what_was_kept_before_the_change_over_goes_on_after_it(
    first: bool, detour: Callable[[bs.Simulation], bs.Simulation], changes_over: Callable[[Ready], None]
) -> None:
    whole = midway()
    expected = rest(whole)
    changes_over(lambda: first)
    simulation = midway()
    snapshot, stored = simulation.snapshot(), pickle.dumps(simulation)
    changes_over(lambda: not first)
    for kept in (detour(simulation), pickle.loads(stored)):
        assert rest(kept) == expected
        kept.restore(snapshot)
        assert rest(kept) == expected


def test_same_bits_in_another_process() -> None:
    assert in_new_process("from test_two_speeds import digest; print(digest())") == digest()


def test_import_brings_in_neither_ros_nor_matplotlib() -> None:
    code = "import sys, billiards_sim; print([m for m in ('rclpy', 'matplotlib') if m in sys.modules])"
    assert in_new_process(code) == "[]"


def test_engine_runs_without_numba() -> None:
    code = (
        "import sys; sys.modules['numba'] = None\n"
        "import billiards_sim as bs\n"
        "print(bs.compile(), len(bs.Simulation(bs.scenes.head_on()).run()))"
    )
    ended = new_process(code)
    assert (ended.stdout, ended.stderr) == ("False 10\n", "")
