# SPDX-License-Identifier: Apache-2.0
"""How many shots a second environments play whose tables share a rollout, where Gymnasium is installed."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from typing import Any

from billiards_sim.study.measure import Task, installed, spread

TABLES = 64
"""Side by side."""

RUNS, QUICK_RUNS = 15, 3

STEPS = 100
"""Of a run."""

OPTIONS: dict[str, dict[str, Any]] = {"Pool": {"balls": 1}, "SumToThree": {"random_start": True}}
"""By the name of the environment. Both have two balls, the cue ball and another one."""


def measure(name: str, runs: int, steps: int) -> dict[str, Any]:
    """Shots a second of random actions: "wall", and "processor", a second of which is one that this process had a core.

    Games that are over begin anew within the step, so that each step plays a shot at every table. Both as `spread`.
    """
    import gymnasium

    identity = f"billiards_sim.gym:billiards_sim/{name}-v0"
    envs = gymnasium.make_vec(identity, TABLES, autoreset_mode="SameStep", **OPTIONS[name])
    envs.reset(seed=1)
    envs.action_space.seed(1)
    actions = [envs.action_space.sample() for _ in range(steps)]
    found: dict[str, list[float]] = {"wall": [], "processor": []}
    for run in range(runs + 1):
        start = time.perf_counter(), time.process_time()
        for action in actions:
            envs.step(action)
        end = time.perf_counter(), time.process_time()
        if run:  # the first one is to warm up
            for clock, before, after in zip(("wall", "processor"), start, end):
                found[clock].append(TABLES * steps / (after - before))
    return {"name": name, "tables": TABLES, **{clock: spread(rates) for clock, rates in found.items()}}


def tasks(quick: bool) -> Iterator[Task]:
    """The pieces of this part."""
    for name in OPTIONS:
        yield f"environment {name}", partial(_add, name=name, runs=QUICK_RUNS if quick else RUNS)


def _add(study: dict[str, Any], name: str, runs: int) -> None:
    study["absent"] = not installed("gymnasium")
    if not study["absent"]:
        study.setdefault("rows", []).append(measure(name, runs, STEPS))
