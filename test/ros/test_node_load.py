# SPDX-License-Identifier: Apache-2.0
"""What is measured of the node is what happens."""

from __future__ import annotations

import json
import sys

import pytest
from conftest import Site

from billiards_sim.ros.tools.node_load import SCENES, TOPICS, evenness


@pytest.mark.parametrize("scene", SCENES)
def test_a_break_is_measured_from_before_the_shot_until_rest(site: Site, scene: str) -> None:
    load = site.process(
        *("-m", "billiards_sim.ros.tools.node_load", "--scene", scene, "--topics", "all", "--breaks", "1"),
        command=[sys.executable],
    )
    assert load.wait() == 0, load.stderr
    assert f"ready: scene {scene}, 16 balls" in load.stderr
    found = json.loads(load.stdout)
    assert (found["balls"], found["topics"]) == ("break", list(TOPICS))
    assert 0.0 < found["twist_rate"] < 16 * 100.0  # of balls that move; a resting one is told again once a second
    assert found["spacing_p1"] <= 1.0 / found["mean_rate"] <= found["spacing_longest"]
    assert found["load"] > 0.0


def test_previews_are_answered_while_the_ticks_are_measured(site: Site) -> None:
    load = site.process(
        *("-m", "billiards_sim.ros.tools.node_load", "--topics", "states", "--previews", "20", "--duration", "2"),
        command=[sys.executable],
    )
    assert load.wait() == 0, load.stderr
    found = json.loads(load.stdout)
    assert 1 < found["previews"] <= 80  # at most twice the rate
    assert 0.0 < found["preview_median"] <= found["preview_p95"]
    assert found["mean_rate"] > 0.0


def test_evenness_of_ticks_of_which_one_is_late() -> None:
    found = evenness([0.0, 0.01, 0.02, 0.05, 0.06], 100.0)
    assert abs(found["mean_rate"] - 4 / 0.06) < 1e-9
    assert abs(found["spacing_longest"] - 0.03) < 1e-12
    assert set(evenness([1.0], 100.0).values()) == {None}
