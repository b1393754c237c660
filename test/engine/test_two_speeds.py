# SPDX-License-Identifier: Apache-2.0
"""The same source compiled and interpreted: the same bits; and what importing the engine brings in."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from checks import COMPILED, random_scene

import billiards_sim as bs

HERE = Path(__file__).parent


def digest() -> str:
    """Of every event and final state of a break, of the exact scenes' kind of scene and of random ones."""
    scenes = [bs.scenes.head_on(), bs.scenes.glancing(), bs.scenes.eight_ball(), bs.scenes.eight_ball(0.0)]
    scenes += [random_scene(seed) for seed in range(20)]
    scenes.append(bs.Scene([[2.35, 0.6]], [[0.1, 0.5]], [[0.0, 150.0, 0.0]]))
    summary = hashlib.sha256()
    for scene in scenes:
        simulation = bs.Simulation(scene)
        if scene.name == "eight_ball":
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
def test_a_line_says_what_the_first_run_waits_for(tmp_path: Path) -> None:
    code = (
        "from billiards_sim.engine.detection import contact_time, rail_contact_time\n"
        "rail_contact_time(1.0, 1.0, 0.0, 0.0); contact_time(1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0)"
    )
    assert new_process(code, NUMBA_CACHE_DIR=str(tmp_path)).stderr.count("compiling the engine") == 1
    assert new_process(code, NUMBA_CACHE_DIR=str(tmp_path)).stderr == ""


ASK = (
    "import sys; sys.path.insert(0, {site!r})\n"
    "from billiards_sim.engine.detection import contact_time, rail_contact_time\n"
    "print(rail_contact_time(1.0, -1.0, 0.0, 0.0))"
)
"""Prints INF of `state.py`, which is part of the machine code of `detection.py`."""


@pytest.fixture
def installed(tmp_path: Path) -> Path:
    """A copy of the package, to be changed."""
    package = Path(bs.__file__).parent
    shutil.copytree(package, tmp_path / "site/billiards_sim", ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path / "site"


@pytest.mark.skipif(not COMPILED, reason="needs Numba, switched on")
@pytest.mark.parametrize("given", [True, False], ids=["NUMBA_CACHE_DIR", "beside the sources"])
def test_machine_code_of_former_sources_is_not_used(given: bool, installed: Path, tmp_path: Path) -> None:
    cache = tmp_path / "cache" if given else installed / "billiards_sim/engine/__pycache__"
    environment = {"NUMBA_CACHE_DIR": str(cache) if given else "", "PYTHONDONTWRITEBYTECODE": "1"}
    ask = ASK.format(site=str(installed))
    assert in_new_process(ask, **environment) == "inf"
    assert new_process(ask, **environment).stderr == ""
    state = installed / "billiards_sim/engine/state.py"
    before = state.stat()
    text = state.read_text(encoding="utf-8")
    state.write_text(text.replace("INF = math.inf", "INF = 7.000000"), encoding="utf-8")
    os.utime(state, ns=(before.st_atime_ns, before.st_mtime_ns))  # the content decides
    assert in_new_process(ask, **environment) == "7.0"
    assert len(list(cache.glob("billiards_sim-*"))) == 1


@pytest.mark.skipif(not COMPILED, reason="needs Numba, switched on")
def test_without_a_directory_to_write_in_the_engine_is_compiled_and_not_kept(installed: Path, tmp_path: Path) -> None:
    nowhere = tmp_path / "file"
    nowhere.touch()
    (installed / "billiards_sim/engine/__pycache__").touch()
    environment = {
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_CACHE_DIR": str(nowhere / "numba"),
        "XDG_CACHE_HOME": str(nowhere / "cache"),
    }
    code = ASK.format(site=str(installed)) + "; contact_time(1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0)"
    for _ in range(2):
        run = new_process(code, **environment)
        assert run.stdout.strip() == "inf"
        assert run.stderr.count("\n") == 1
        assert "cannot be kept, no cache directory can be written" in run.stderr


@pytest.mark.skipif(not COMPILED, reason="needs Numba, switched on")
def test_compiled_and_interpreted_kernels_give_the_same_bits() -> None:
    interpreted = in_new_process("from test_two_speeds import digest; print(digest())", NUMBA_DISABLE_JIT="1")
    assert interpreted == digest()


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
    assert in_new_process(code) == "False 10"
