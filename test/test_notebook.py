# SPDX-License-Identifier: Apache-2.0
"""The notebook for a class: it runs, shows what it is stored with, and its balls keep to the formulas."""

from __future__ import annotations

import asyncio
import json
import math
import os
from typing import Any

import numpy as np
import pytest

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")
pytest.importorskip("ipykernel")
pytest.importorskip("matplotlib")

from documents import REPOSITORY  # noqa: E402
from jupyter_client import AsyncKernelManager  # noqa: E402

NOTEBOOK = REPOSITORY / "docs" / "class.ipynb"

FOUND = """
import json
print(json.dumps({
    "head_on": head_on,
    "right_angles": right_angles,
    "cuts": cuts.tolist(),
    "ideal": ideal,
    "real": real,
    "thrown": {speed: [throw(RIGID, cut, speed) for cut in cuts] for speed in half_ball},
    "half_ball": half_ball,
    "ratios": ratios.tolist(),
    "apart": {left: [float(sizes[0]), float(sizes.max())] for left, sizes in apart.items()},
}))
"""


@pytest.fixture(scope="module")
def executed(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The notebook after a run without a display, with a cell more that prints what was found."""
    notebook = nbformat.read(NOTEBOOK, 4)
    notebook.cells.append(nbformat.v4.new_code_cell(FOUND))
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs = []
    path = tmp_path_factory.mktemp("notebook")
    python_path = os.pathsep.join(filter(None, (str(REPOSITORY), os.environ.get("PYTHONPATH"))))
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "MPLBACKEND")}
    client = nbclient.NotebookClient(
        notebook,
        km=AsyncKernelManager(kernel_name="python3", transport="ipc", ip=str(path / "kernel")),
        timeout=120,
        resources={"metadata": {"path": str(path)}},
    )
    asyncio.run(client.async_execute(cleanup_kc=True, env={**environment, "PYTHONPATH": python_path}))
    return notebook


@pytest.fixture(scope="module")
def found(executed: Any) -> Any:
    return json.loads(printed(executed.cells[-1]))


def printed(cell: Any) -> str:
    return "".join(output.text for output in cell.get("outputs", ()) if output.output_type == "stream")


def test_it_is_stored_with_what_it_prints_and_with_small_pictures(executed: Any) -> None:
    stored = nbformat.read(NOTEBOOK, 4)
    nbformat.validate(stored)
    texts = [printed(cell) for cell in stored.cells]
    assert any(texts)
    assert texts == [printed(cell) for cell in executed.cells[:-1]]
    pictures = [
        [output for output in cell.get("outputs", ()) if "image/png" in output.get("data", {})]
        for notebook in (stored, executed)
        for cell in notebook.cells[: len(stored.cells)]
    ]
    assert list(map(len, pictures[: len(stored.cells)])) == list(map(len, pictures[len(stored.cells) :]))
    assert sum(map(len, pictures)) == 8
    assert NOTEBOOK.stat().st_size < 300_000


def test_it_names_its_licence() -> None:
    (code, *_) = (cell.source for cell in nbformat.read(NOTEBOOK, 4).cells if cell.cell_type == "code")
    assert code.startswith("# SPDX-License-Identifier: Apache-2.0\n")


def test_two_balls_in_line_share_speed_and_energy_by_the_restitution(found: Any) -> None:
    mass, speed = 0.160, 2.0
    assert [row[0] for row in found["head_on"]] == [1.0, 0.95, 0.8, 0.5]
    for e, *row in found["head_on"]:
        expected = [
            0.5 * (1.0 - e) * speed,
            0.5 * (1.0 + e) * speed,
            0.5 * mass * (1.0 + e) * speed,
            0.5 * (1.0 + e * e),
        ]
        assert row == pytest.approx(expected, abs=1e-12)


def test_elastic_balls_part_at_a_right_angle(found: Any) -> None:
    assert found["right_angles"] == pytest.approx([90.0] * len(found["cuts"]), abs=1e-9)


def test_a_rolling_cue_ball_keeps_to_the_30_degree_rule(found: Any) -> None:
    cuts = np.array(found["cuts"])
    after = 5.0 / 7.0 * np.sin(cuts) * np.array([np.sin(cuts), np.cos(cuts)])
    after[0] += 2.0 / 7.0
    assert found["ideal"] == pytest.approx(np.degrees(np.arctan2(after[1], after[0])).tolist(), abs=1e-6)
    half_ball = found["ideal"][cuts.round(6).tolist().index(round(math.radians(30.0), 6))]
    assert half_ball == pytest.approx(math.degrees(math.atan(math.sqrt(3.0) / 4.0 / 0.65)), abs=1e-6)
    assert found["real"] == pytest.approx(found["ideal"], abs=1.0)  # the balls of real games keep to it, too


def test_throw_is_what_was_published(found: Any) -> None:
    assert list(found["half_ball"].values()) == pytest.approx([3.5, 1.7, 0.9], abs=0.06)  # degrees, TP A.14
    for speed, thrown in found["thrown"].items():
        for cut, angle in zip(found["cuts"], thrown, strict=True):
            normal = 0.5 * 1.95 * float(speed) * math.cos(cut)  # J/m
            slip = float(speed) * math.sin(cut)
            friction = (9.951e-3 + 0.108 * math.exp(-1.088 * slip)) * normal
            assert angle == pytest.approx(math.degrees(math.atan(min(friction, slip / 7.0) / normal)), abs=1e-6)


def test_errors_grow_by_the_same_factor_ball_after_ball(found: Any) -> None:
    assert found["ratios"] == pytest.approx([-(0.3 / 0.05715 - 1.0)] * 8, rel=1e-4)
    for left, (first, largest) in found["apart"].items():
        assert first == pytest.approx(float(left), rel=1e-3)
        assert largest > 1e5 * first
