# SPDX-License-Identifier: Apache-2.0
"""Solutions to 20 digits, which errors are measured against.

`truth.json` is written by `python3 test/data/make_exact_scenes.py --truth billiards_sim/study/truth.json`, a
multiprecision program that shares no code with the engine.
"""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.events import Event
from billiards_sim.engine.scene import Scene

Collision = tuple[tuple[int, ...], str | None]
"""Balls, ascending, and the rail if it is one with a rail."""

RAIL_NAMES = {"x-low": "x_min", "x-high": "x_max", "y-low": "y_min", "y-high": "y_max"}
COLLISIONS = ("ball_ball", "ball_rail")


@dataclass(frozen=True)
class State:
    """The exact balls at one time."""

    time: float  # s
    positions: NDArray[np.float64]  # (N, 2) m
    energy: float  # J, of all balls, linear and rotational
    rounding: float  # m, how far the balls move when initial values and constants are rounded to double


@dataclass(frozen=True)
class Truth:
    """A scene and its exact solution."""

    name: str
    description: str
    scene: Scene
    initial_energy: float  # J
    states: dict[str, State]  # by "0.5", "1", "2", "5" (s) and "rest"
    collisions: Counter[Collision]

    @property
    def end(self) -> float:
        """s, when all states have passed."""
        return max(state.time for state in self.states.values())


@cache
def truths() -> dict[str, Truth]:
    """All scenes by name."""
    document = json.loads(Path(__file__).with_name("truth.json").read_text(encoding="utf-8"))
    return {record["name"]: _truth(record) for record in document["scenes"]}


def collisions(events: list[Event], scene: Scene) -> Counter[Collision]:
    """How often each pair of balls, and each ball and rail, collide."""
    index = {name: number for number, name in enumerate(scene.names)}
    return Counter(
        (tuple(sorted(index[ball] for ball in event.balls)), event.rail) for event in events if event.kind in COLLISIONS
    )


def _truth(record: dict[str, Any]) -> Truth:
    initial = np.array(record["initial"], dtype=np.float64)
    rest = float(record["rest_time"])
    states = {
        time: State(
            rest if time == "rest" else float(time),
            np.array(state["positions"], dtype=np.float64),
            float(state["energy"]),
            float(state["rounding"]),
        )
        for time, state in record["states"].items()
    }
    return Truth(
        record["name"],
        record["description"],
        Scene(initial[:, 0:2], initial[:, 2:4], initial[:, 4:7], name=record["name"]),
        float(record["initial_energy"]),
        states,
        Counter((tuple(sorted(balls)), RAIL_NAMES.get(rail)) for _, balls, rail in record["collisions"]),
    )
