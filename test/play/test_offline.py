# SPDX-License-Identifier: Apache-2.0
"""A run as a page in one file: what is in it. `test_browser.py` opens it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

import billiards_sim as bs
from billiards_sim.play import offline
from billiards_sim.study import simulate


def test_the_page_has_the_arcs_and_events_of_the_run_and_needs_no_other_file(tmp_path: Path) -> None:
    path = tmp_path / "break.html"
    assert simulate.main(["nine_ball", "--speed", "8", "--angle", "1deg", "--html", str(path)]) == 0
    page = path.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="run">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    data = json.loads(found[1])
    simulation = bs.Simulation(bs.scenes.nine_ball())
    simulation.shoot(8.0, 3.141592653589793 / 180.0)
    run = bs.record(simulation)
    assert data["title"] == "nine_ball"
    assert data["run"]["arcs"] == [run.arcs(name).tolist() for name in run.scene.names]
    assert [event["time"] for event in data["run"]["events"]] == [event.time for event in run.events]
    assert "here:" not in page
    assert not re.search(r"^(import|export) ", page, re.MULTILINE)
    assert not re.search(r"\b(src|href)=", page)


def test_names_cannot_end_the_page(tmp_path: Path) -> None:
    scene = replace(bs.scenes.head_on(), names=("</script><script>alert(1)", "<!--"))
    offline.write_page(bs.record(bs.Simulation(scene)), tmp_path / "run.html", "</title>")
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert page.count("</script>") == 2
    assert "<!--" not in page.split("-->", 1)[1]
    assert page.count("</title>") == 1


def test_what_is_no_run_of_the_engine_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = str(tmp_path / "run.html")
    assert simulate.main(["head_on", "--solver", "time_step", "--html", out]) == 2
    assert "--html shows runs of the solver event, not of time_step" in capsys.readouterr().err
    assert simulate.main(["head_on", "--html", str(tmp_path / "run.txt")]) == 2
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_no_browser_would_open_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(offline, "MOST_ARCS", 5)
    assert simulate.main(["head_on", "--html", str(tmp_path / "run.html")]) == 2
    assert "a page takes 5: end it earlier with --until" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
