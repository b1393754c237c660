# SPDX-License-Identifier: Apache-2.0
"""How far a run can be foretold: two runs that start almost alike, and when they part.

Balls are convex, so each collision magnifies a difference, and differences grow exponentially with the collisions. No
solver escapes it: double precision rounds the start by 1e-16 m, a camera measures it to 1e-3 m.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine import scenes
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation
from billiards_sim.study.measure import Task
from billiards_sim.study.speed import break_force

APART = 1e-12
"""m, by how much the starts of two runs differ: small enough to grow undisturbed, far above rounding."""
LAST_BIT = 4.0 * sys.float_info.epsilon
"""m, 9e-16: the least change of a coordinate that rounding is sure not to swallow."""
GOOD = 1e-3
"""m, what a position is wanted to."""

PAUSE = 0.01  # s between two looks
DURATION = 6.0  # s; few balls move later
LARGEST_COUNT = 200  # collisions in the plot

Arrangement = Callable[[int, float], Simulation]
"""Makes a simulation from a seed and a shift, m, of the cue ball across the shot."""


def shifted(scene: Scene, shift: float) -> Scene:
    """The scene with its first ball moved along y, m."""
    positions = scene.positions.copy()
    positions[0, 1] += shift
    return Scene(positions, scene.velocities, scene.angular_velocities, scene.names, scene.table, scene.physics)


def a_break(seed: int, shift: float) -> Simulation:
    """An eight-ball break at 8 m/s; the seed gives the aim."""
    simulation = Simulation(shifted(scenes.rack(), shift))
    simulation.strike(break_force(seed))
    return simulation


def twenty_balls(seed: int, shift: float) -> Simulation:
    """The paper's scene 3: 20 random balls at up to 7 m/s on each axis."""
    return Simulation(shifted(scenes.random_balls(20, seed), shift))


ARRANGEMENTS: dict[str, Arrangement] = {"break": a_break, "20 random balls": twenty_balls}


def parting(arrange: Arrangement, seed: int, shift: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Two runs whose starts differ by a shift, looked at every `PAUSE` for `DURATION`.

    Returns:
        (looks + 1,) the largest distance between a ball and its twin, m, and (looks + 1,) the ball-ball collisions so
        far; both start with time 0.
    """
    one, other = arrange(seed, 0.0), arrange(seed, shift)
    distance, count = [abs(shift)], [0]
    for look in range(1, round(DURATION / PAUSE) + 1):
        events = one.run(until=look * PAUSE)
        other.run(until=look * PAUSE)
        distance.append(float(np.hypot(*(one.positions - other.positions).T).max()))
        count.append(count[-1] + sum(event.kind == "ball_ball" for event in events))
    return np.array(distance), np.array(count)


def first_time_beyond(distance: NDArray[np.float64], level: float) -> float | None:
    """s, of the first look at which the distance exceeds a level; None if it never does."""
    beyond = np.flatnonzero(distance > level)
    return float(beyond[0]) * PAUSE if beyond.size else None


def growth(arrangement: str, seeds: int) -> dict[str, Any]:
    """How a difference grows, over several seeds.

    Returns:
        "time": s, and "by_time"; "collisions", and "by_collisions": difference over initial difference, {"low",
        "median", "high"} being the 10th, 50th and 90th percentiles; "per_collision": the factor of a collision of any
        two balls, from the straight part of the median; "good_for": {"median", "earliest"} s until two runs that
        differ in the last bits part by `GOOD`, None if they do not; "parted": share of the runs that do.
    """
    arrange = ARRANGEMENTS[arrangement]
    runs = [parting(arrange, seed, APART) for seed in range(1, seeds + 1)]
    factors = np.array([distance for distance, _ in runs]) / APART
    counts = np.array([count for _, count in runs])
    most = min(LARGEST_COUNT, int(np.median(counts[:, -1])))
    # The factor when the k-th collision is over: at the first look with at least k collisions.
    after = np.full((seeds, most + 1), np.nan)
    for run in range(seeds):
        looks = np.searchsorted(counts[run], np.arange(most + 1))
        there = looks < counts.shape[1]
        after[run, there] = factors[run, looks[there]]
    median = np.nanmedian(after, axis=0)
    straight = np.flatnonzero(median < GOOD / APART)
    per_collision = float(np.exp(np.polyfit(straight, np.log(median[straight]), 1)[0]))
    times = [first_time_beyond(parting(arrange, seed, LAST_BIT)[0], GOOD) for seed in range(1, seeds + 1)]
    # One that never parts counts as later than all others.
    ranked = sorted(times, key=lambda time: np.inf if time is None else time)
    looks_drawn = slice(None, None, 5)
    return {
        "seeds": seeds,
        "time": (np.arange(factors.shape[1]) * PAUSE)[looks_drawn].round(6).tolist(),
        "by_time": _band(factors[:, looks_drawn]),
        "collisions": list(range(most + 1)),
        "by_collisions": _band(after),
        "collisions_in_all": float(np.median(counts[:, -1])),
        "per_collision": per_collision,
        "at_end": {"median": float(np.median(factors[:, -1])), "high": float(factors[:, -1].max())},
        "good_for": {"median": ranked[len(ranked) // 2], "earliest": ranked[0]},
        "parted": sum(time is not None for time in times) / seeds,
    }


def _band(values: NDArray[np.float64]) -> dict[str, list[float]]:
    low, median, high = np.nanpercentile(values, (10, 50, 90), axis=0)
    return {"low": low.tolist(), "median": median.tolist(), "high": high.tolist()}


def tasks(seeds: int) -> Iterator[Task]:
    """The pieces of this part."""
    for arrangement in ARRANGEMENTS:
        yield f"parting: {arrangement}", partial(_add, arrangement=arrangement, seeds=seeds)


def _add(study: dict[str, Any], arrangement: str, seeds: int) -> None:
    study[arrangement] = growth(arrangement, seeds)
