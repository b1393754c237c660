# SPDX-License-Identifier: Apache-2.0
"""What the documents show of learning."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("matplotlib")
pytest.importorskip("tqdm")

from documents import REPOSITORY, blocks  # noqa: E402

import billiards_sim as bs  # noqa: E402


def test_the_examples_of_the_environment_run() -> None:
    code = [block for block in blocks(REPOSITORY / "docs" / "rollouts.md", "python") if "gymnasium" in block]
    done = subprocess.run(
        [sys.executable, "-c", "\n".join([*code, "print(rewards.shape)"])],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout == "(64,)\n", done.stderr


@pytest.mark.skipif(not bs.compile(), reason="as many shots take minutes where the engine is interpreted")
@pytest.mark.parametrize(("task", "updates"), [("pot", 800), ("sum_to_three", 100)])
def test_what_is_learnt_scores_more_often_than_at_first(task: str, updates: int, tmp_path: Path) -> None:
    picture = tmp_path / "learn.png"
    done = subprocess.run(
        [sys.executable, "docs/learn.py", task, "--updates", str(updates), "--plot", str(picture)],
        cwd=REPOSITORY,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},  # it may have a core for itself alone
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    by_chance, *by_geometry, first, last = map(float, re.findall(r"0\.\d+", done.stdout))
    assert last > max(by_chance, first) + 0.1
    assert all(score > 4.0 * by_chance for score in by_geometry)
    assert len(by_geometry) == (task == "pot")
    assert f"after {updates * 512} shots" in done.stdout
    assert picture.stat().st_size > 10_000
