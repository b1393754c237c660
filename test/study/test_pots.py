# SPDX-License-Identifier: Apache-2.0
"""The study of random positions: its bounds are bounds, and its command prints what its document shows."""

from __future__ import annotations

import math
import runpy
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import billiards_sim as bs

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def pots() -> dict[str, Any]:
    return runpy.run_path(str(REPOSITORY / "docs" / "pots.py"))


@pytest.mark.parametrize("half_width", [0.5, 1.0, 2.0])
def test_a_window_is_hit_as_often_as_a_normal_error_stays_within(pots: dict[str, Any], half_width: float) -> None:
    deviation, step = pots["NOISE"].azimuth, 2e-4
    azimuths = np.arange(0.0, math.tau, step)
    window = 1.0 * (np.abs(azimuths - 3.0) < half_width * deviation)
    assert pots["averaged"](window, step).max() == pytest.approx(math.erf(half_width / math.sqrt(2.0)), abs=0.03)
    around = 1.0 * (np.minimum(azimuths, math.tau - azimuths) < half_width * deviation)  # all round
    assert pots["averaged"](around, step)[0] == pytest.approx(math.erf(half_width / math.sqrt(2.0)), abs=0.03)


def test_positions_are_those_of_the_document(pots: dict[str, Any]) -> None:
    page = (REPOSITORY / "docs" / "pots.md").read_text(encoding="utf-8")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ") and line[2].isdigit()]
    scenes = pots["positions"](20, 1)
    assert [cells[1:3] for cells in rows] == [
        [f"{x:.3f} {y:.3f}" for x, y in scene.positions.tolist()] for scene in scenes
    ]


@pytest.mark.skipif(not bs.compile(), reason="a hundred thousand shots take minutes where the engine is interpreted")
def test_the_command_prints_the_table() -> None:
    command = [sys.executable, "docs/pots.py", "--positions", "1", "--step", "0.01", "--budget", "3000"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    head, _, row, _, last = done.stdout.splitlines()
    page = (REPOSITORY / "docs" / "pots.md").read_text(encoding="utf-8")
    assert head in page
    *_, success, ghost, bound, grid, _, _ = row.split("|")
    assert 50.0 < float(success) <= 100.0
    assert 0.0 < float(ghost) <= 100.0
    assert float(grid) <= float(bound) + 5.0  # with 4000 samples and a coarse grid
    assert last.endswith("by the grid.")
