# SPDX-License-Identifier: Apache-2.0
"""Work against precision: what each solver's time step buys, measured against solutions to 20 digits.

Every solver starts from a scene and goes on to t = 0.5, 1, 2 and 5 s and to rest. A step is run `len(NEIGHBOURS)`
times, each time a few per cent different: the error of a time-stepping scheme jumps about with where in a step a
collision or the end of a slip falls, and the root mean square over neighbours is what a user may expect of a step of
that size.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.events import Event
from billiards_sim.study.measure import Task, cost_at, in_child, root_mean_square, slope, spread
from billiards_sim.study.time_stepping import SOLVERS, SchemeError, Solver
from billiards_sim.study.truth import State, Truth, collisions, truths

STEPS = (0.03, 0.01, 0.005, 0.002, 0.001, 0.0005, 0.0003)  # s
QUICK_STEPS = (0.02, 0.01, 0.005)  # s
NEIGHBOURS = (0.91, 0.94, 0.97, 1.0, 1.03, 1.06, 1.09)
"""The time steps that are run in place of one, as shares of it."""
QUICK_NEIGHBOURS = (0.91, 1.0, 1.09)

STEPPED = ("time_step", "paper")
"""Solvers with a step."""

EXACT_RUNS = 50
"""Runs of `event`, which has no step, for the median of its wall time."""
INTERPRETED_RUNS = 7
"""The same without Numba."""

LOOK_EVERY = 0.01
"""s between two looks at overlapping balls; a longer step is looked at when it ends."""
LOOK_UNTIL = 2.0
"""s, from when on nothing much happens that has not happened before."""

CHART_TIME = "2"
"""s, the time of the error in plots, slopes and ratios: most collisions are over, no ball rests yet."""

FIRST_ORDER_BELOW = 0.01
"""m. Errors above it, where a collision is missed or another one happens, tell nothing about the order."""

EQUAL_ERROR = 1e-3
"""m, at which the wall times of `event` and `time_step` are compared."""


def position_error(solver: Solver, state: State) -> float:
    """The largest distance of a ball from where it should be, m.

    `paper` stops up to a step late: from there its balls are taken back to the time in question on straight lines.
    """
    positions = solver.positions
    if solver.time != state.time and not solver.at_rest:
        positions = positions + solver.velocities * (state.time - solver.time)
    return float(np.hypot(*(positions - state.positions).T).max())


def run_once(solver_name: str, truth: Truth, time_step: float) -> dict[str, Any]:
    """One run, timed from making the solver to the last of the truth's times.

    Returns:
        "wall": s per simulated second; "position": m, and "energy": share of the initial energy, by time; "missed" and
        "extra": collisions; "failure": why the run ended early, or None. What was not reached is nan.
    """
    result: dict[str, Any] = {
        "wall": math.nan,
        "position": dict.fromkeys(truth.states, math.nan),
        "energy": dict.fromkeys(truth.states, math.nan),
        "missed": 0,
        "extra": 0,
        "failure": None,
    }
    events: list[Event] = []
    clock = time.perf_counter
    wall = -clock()
    solver = SOLVERS[solver_name](truth.scene, time_step)
    wall += clock()
    try:
        for name, state in sorted(truth.states.items(), key=lambda item: item[1].time):
            to_rest = name == "rest" and solver_name != "paper"  # the paper's balls never rest
            start = clock()
            new = solver.run() if to_rest else solver.run(max(state.time, solver.time))
            wall += clock() - start
            events.extend(new)
            result["position"][name] = position_error(solver, state)
            result["energy"][name] = abs(solver.kinetic_energy - state.energy) / truth.initial_energy
    except SchemeError as error:
        result["failure"] = str(error)
    else:
        result["wall"] = wall / truth.end
    happened = collisions(events, truth.scene)
    result["missed"] = (truth.collisions - happened).total()
    result["extra"] = (happened - truth.collisions).total()
    return result


def deepest_overlap(solver_name: str, truth: Truth, time_step: float) -> float:
    """How far any two balls reach into each other, m, looked at every `LOOK_EVERY` until `LOOK_UNTIL`."""
    solver = SOLVERS[solver_name](truth.scene, time_step)
    deepest = 0.0
    one, other = np.triu_indices(len(truth.scene), 1)
    pause = max(LOOK_EVERY, time_step)
    for look in range(1, math.floor(LOOK_UNTIL / pause) + 1):
        try:
            solver.run(max(look * pause, solver.time))
        except SchemeError:
            break
        positions: NDArray[np.float64] = solver.positions
        distances = np.hypot(*(positions[one] - positions[other]).T)
        deepest = max(deepest, 2.0 * truth.scene.physics.radius - float(distances.min()))
    return deepest


def summary(runs: Sequence[dict[str, Any]], overlap: float) -> dict[str, Any]:
    """One point of the study from its runs: root mean square errors, median wall time, worst of the rest."""

    def error(kind: str, name: str) -> float:
        return root_mean_square([run[kind][name] for run in runs])

    walls = [run["wall"] for run in runs if run["failure"] is None]
    return {
        "wall": spread(walls) if walls else None,
        "position": {name: error("position", name) for name in runs[0]["position"]},
        "energy": {name: error("energy", name) for name in runs[0]["energy"]},
        "missed": max(run["missed"] for run in runs),
        "extra": max(run["extra"] for run in runs),
        "overlap": overlap,
        "failures": [run["failure"] for run in runs if run["failure"] is not None],
    }


def exact_point(scene: str, runs: int) -> dict[str, Any]:
    """The point of `event` in a scene."""
    truth = truths()[scene]
    run_once("event", truth, 1.0)  # what only the first run does
    return summary([run_once("event", truth, 1.0) for _ in range(runs)], deepest_overlap("event", truth, LOOK_EVERY))


def exact_points(runs: int) -> dict[str, Any]:
    """The points of `event` in all scenes; called in a process without Numba."""
    return {scene: exact_point(scene, runs) for scene in truths()}


def stepped_point(solver: str, scene: str, time_step: float, neighbours: Sequence[float]) -> dict[str, Any]:
    """The point of a time-stepping solver at a step, s, and its neighbours, shares of it."""
    truth = truths()[scene]
    runs = [run_once(solver, truth, time_step * share) for share in neighbours]
    return {"time_step": time_step} | summary(runs, deepest_overlap(solver, truth, time_step))


def conclusions(points: dict[str, Any]) -> dict[str, Any]:
    """What the points of a scene say.

    Returns:
        "order": of `time_step`, with its standard error, from the steps that miss nothing, None if they are fewer than
        three; "ratio": its wall time over that of `event` at `EQUAL_ERROR`, "ratio_interpreted": over that of `event`
        without Numba, None if it does not get there.
    """
    steps = points["time_step"]
    errors = [point["position"][CHART_TIME] for point in steps]
    clean = [
        (point["time_step"], error)
        for point, error in zip(steps, errors)
        if error < FIRST_ORDER_BELOW and point["missed"] == point["extra"] == 0
    ]
    order = slope(*zip(*clean)) if len(clean) > 2 else None
    timed = [(point["wall"]["median"], error) for point, error in zip(steps, errors) if point["wall"]]
    cost = cost_at(EQUAL_ERROR, *zip(*timed)) if timed else None
    exact = points["event"]["wall"]["median"]
    interpreted = points["event_interpreted"]["wall"]["median"]
    return {
        "order": order,
        "ratio": cost / exact if cost else None,
        "ratio_interpreted": cost / interpreted if cost else None,
    }


def tasks(quick: bool) -> Iterator[Task]:
    """The pieces of this part."""
    neighbours, steps = (QUICK_NEIGHBOURS, QUICK_STEPS) if quick else (NEIGHBOURS, STEPS)
    for scene in truths():
        yield f"event: {scene}", partial(_add_exact, scene=scene)
    yield "event without Numba", _add_interpreted
    for scene, solver, step in itertools.product(truths(), STEPPED, steps):
        yield (
            f"{solver} {step:g} s: {scene}",
            partial(_add_stepped, scene=scene, solver=solver, step=step, neighbours=neighbours),
        )
    yield "orders and ratios", _add_conclusions


def _add_exact(study: dict[str, Any], scene: str) -> None:
    truth = truths()[scene]
    study[scene] = {
        "description": truth.description,
        "balls": len(truth.scene),
        "collisions": truth.collisions.total(),
        "rest_time": truth.states["rest"].time,
        "rounding": {name: state.rounding for name, state in truth.states.items()},
        "event": exact_point(scene, EXACT_RUNS),
        "event_interpreted": None,
        **{solver: [] for solver in STEPPED},
    }


def _add_interpreted(study: dict[str, Any]) -> None:
    for scene, point in in_child(exact_points, {"NUMBA_DISABLE_JIT": "1"}, runs=INTERPRETED_RUNS).items():
        study[scene]["event_interpreted"] = point


def _add_stepped(study: dict[str, Any], scene: str, solver: str, step: float, neighbours: Sequence[float]) -> None:
    study[scene][solver].append(stepped_point(solver, scene, step, neighbours))


def _add_conclusions(study: dict[str, Any]) -> None:
    for scene in study.values():
        scene.update(conclusions(scene))
