# SPDX-License-Identifier: Apache-2.0
"""What the node costs: processor load and how evenly its ticks come, where ROS 2 is installed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import partial
from typing import Any

from billiards_sim.study.measure import ChildError, Task, installed, lines_of_python

CASES = ((100, "all"), (100, "none"), (1000, "poses"), (1000, "all"))
"""Rates, Hz, and the topics subscribed, as `node_load --topics` takes them."""

DURATION = 10.0  # s, with the balls at rest and again with them moving


def load(rate: int, topics: str) -> list[dict[str, Any]]:
    """What `python3 -m billiards_sim.ros.tools.node_load` says of a case: one record at rest, one moving.

    Raises:
        ChildError: it failed.
    """
    lines = lines_of_python(
        *("-m", "billiards_sim.ros.tools.node_load"),
        *("--rate", str(rate), "--topics", topics, "--duration", str(DURATION)),
    )
    return [{"rate": rate, **json.loads(line), "topics": topics} for line in lines if line.startswith("{")]


def tasks() -> Iterator[Task]:
    """The pieces of this part."""
    for rate, topics in CASES:
        yield f"node at {rate} Hz, {topics}", partial(_add, rate=rate, topics=topics)


def _add(study: dict[str, Any], rate: int, topics: str) -> None:
    study["absent"] = not installed("rclpy")
    if study["absent"]:
        return
    try:
        study.setdefault("runs", []).extend(load(rate, topics))
    except ChildError as error:
        study.setdefault("failures", []).append(f"at {rate} Hz, {topics}: {error}")
