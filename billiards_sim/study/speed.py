# SPDX-License-Identifier: Apache-2.0
"""How fast the engine is: breaks, starts, many balls, copies, and what each feature costs. Through the public API."""

from __future__ import annotations

import gc
import math
import tempfile
import time
import tracemalloc
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from billiards_sim.engine import machine, scenes
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation
from billiards_sim.engine.table import Table
from billiards_sim.study.measure import Task, in_child, run_python, seconds, seconds_each, spread

BREAK_FORCE = 128.0
"""N. 8 m/s with the default physics."""
AIM = math.radians(1.0)
"""Breaks are aimed at random within this angle of the rack's axis."""

INTERPRETED_SEEDS, QUICK_INTERPRETED_SEEDS = 50, 5
"""Breaks without Numba, which take a hundred times longer."""
TICKED_SEEDS = 20
"""Breaks in ticks, too."""
SMALL_RUNS = 50
"""Medians of calls that take microseconds are of so many means of 20."""

COUNTS = (100, 1_000, 10_000)
"""Balls on tables that give each as much room as 16 have on the default one."""
MANY_BALLS_DURATION = 1.0  # s
CROWDED_BALLS, QUICK_CROWDED_BALLS = 100_000, 2_000
"""Balls in all the runs with so many of them; at least one run, at most `MOST_CROWDS`."""
MOST_CROWDS = 20

START_CODE = """
import time
start = time.perf_counter()
import billiards_sim as bs
simulation = bs.Simulation(bs.scenes.rack())
simulation.strike((128.0, 1.5, 0.0))
simulation.run()
print(time.perf_counter() - start)
"""
COMPILE_CODE = """
import time
start = time.perf_counter()
import billiards_sim as bs
bs.compile()
print(time.perf_counter() - start)
"""
STARTS, QUICK_STARTS = 5, 2
"""New processes, of each kind."""

Row = dict[str, Any]
"""A line of a table: "what", "unit", "target" (or None) and what `spread` gives."""


def row(what: str, unit: str, values: list[float], target: float | None = None, scale: float = 1.0) -> Row:
    """A line from values, multiplied by `scale` to be in `unit`."""
    return {"what": what, "unit": unit, "target": target, **spread([value * scale for value in values])}


def break_force(seed: int) -> tuple[float, float, float]:
    """N, of a break at 8 m/s; the seed gives the aim."""
    angle = float(np.random.default_rng(seed).uniform(-AIM, AIM))
    return BREAK_FORCE * math.cos(angle), BREAK_FORCE * math.sin(angle), 0.0


def struck(seed: int, track_orientation: bool = False) -> Simulation:
    """An eight-ball rack after the break shot, before anything moves."""
    rack = scenes.rack()
    if track_orientation:
        rack = Scene(rack.positions, track_orientation=True)
    simulation = Simulation(rack)
    simulation.strike(break_force(seed))
    return simulation


def breaks(seeds: int, track_orientation: bool = False, look_at_events: bool = False) -> dict[str, list[float]]:
    """Wall time from the shot to rest, s, and number of events, of breaks with different aims.

    Args:
        seeds: breaks.
        track_orientation: of the scene.
        look_at_events: also build every `Event`, within the time.
    """
    times, counts = [], []
    for seed in range(-3, seeds):  # a few to warm up
        simulation = struck(abs(seed), track_orientation)
        if seed == 0:
            gc.collect()
        start = time.perf_counter()
        events = simulation.run()
        if look_at_events:
            list(events)
        elapsed = time.perf_counter() - start
        if seed >= 0:
            times.append(elapsed)
            counts.append(float(len(events)))
    return {"seconds": times, "events": counts}


def whole_break(seed: int) -> None:
    """A break from nothing: scene, set-up, shot, run."""
    struck(seed).run()


def ticked_break(seed: int) -> None:
    """A break in ticks of 10 ms, as a node at 100 Hz takes it."""
    simulation = struck(seed)
    while not simulation.at_rest:
        simulation.advance(0.01)


def break_rows(seeds: int) -> list[Row]:
    """Breaks in this process."""
    result = breaks(seeds)
    each = [time / events for time, events in zip(result["seconds"], result["events"])]
    how = "" if machine.is_ready() else " (Numba is not there: interpreted)"
    return [
        row(f"break, shot to rest{how}", "ms", result["seconds"], 0.20, 1e3),
        row(f"break, per event{how}", "us", each, 1.2, 1e6),
        row("events of a break", "", result["events"]),
    ]


def interpreted_rows(seeds: int) -> list[Row]:
    """Breaks in a process without Numba."""
    result = in_child(breaks, {"NUMBA_DISABLE_JIT": "1"}, seeds=seeds)
    each = [time / events for time, events in zip(result["seconds"], result["events"])]
    return [
        row("break without Numba", "ms", result["seconds"], 30.0, 1e3),
        row("break without Numba, per event", "us", each, None, 1e6),
    ]


def start_rows(starts: int) -> list[Row]:
    """Import to the end of the first break in new processes, without kept machine code and with it."""
    with tempfile.TemporaryDirectory(prefix="billiards_sim_kernels_") as cache:
        cold = [float(run_python("-c", START_CODE, NUMBA_CACHE_DIR=cache)) for _ in range(starts)]
        compiling = float(run_python("-c", COMPILE_CODE, NUMBA_CACHE_DIR=cache))
        warm = [float(run_python("-c", START_CODE, NUMBA_CACHE_DIR=cache)) for _ in range(starts)]
    return [
        row("new process, machine code kept: import to end of first break", "s", warm, 0.3),
        row("new process, none kept: the same", "s", cold, 1.0),
        row("compile(), in a process of its own", "s", [compiling]),
    ]


def small_rows(runs: int) -> list[Row]:
    """Set-up, copies and shots: microseconds each."""
    scene = scenes.rack()
    simulation = Simulation(scene)
    simulation.strike(break_force(0))
    simulation.run(until=0.3)
    snapshot = simulation.snapshot()

    def measured(what: str, action: Callable[[], Any], target: float | None = None) -> Row:
        return row(f"{what}, 16 balls", "us", seconds_each(action, runs, 20), target, 1e6)

    return [
        measured("Simulation(scene)", lambda: Simulation(scene), 50.0),
        measured("copy()", simulation.copy, 20.0),
        measured("snapshot()", simulation.snapshot, 20.0),
        measured("restore()", lambda: simulation.restore(snapshot)),
        measured("positions", lambda: simulation.positions),
    ]


def crowd(count: int, seed: int = 1) -> Scene:
    """Balls that roll about at 0.5 to 1.5 m/s on a table with the default one's room for each of 16."""
    random = np.random.default_rng(seed)
    radius, default = Physics().radius, Table()
    scale = math.sqrt(count / 16)
    table = Table(length=default.length * scale, width=default.width * scale)
    across = math.ceil(math.sqrt(2.0 * count))
    along = math.ceil(count / across)
    margin = 3.0 * radius
    x = np.linspace(table.x_min + margin, table.x_max - margin, across)
    y = np.linspace(table.y_min + margin, table.y_max - margin, along)
    grid = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)[:count]
    positions = grid + random.uniform(-radius, radius, (count, 2))
    angle, speed = random.uniform(0.0, 2.0 * math.pi, count), random.uniform(0.5, 1.5, count)
    velocities = np.stack((speed * np.cos(angle), speed * np.sin(angle)), axis=1)
    spins = np.stack((-velocities[:, 1], velocities[:, 0], np.zeros(count)), axis=1) / radius
    return Scene(positions, velocities, spins, table=table)


def many_balls(count: int, runs: int) -> dict[str, Any]:
    """Cost of a second of `count` balls.

    Returns:
        "per_event" and "setup": s, as `spread`; "events": in the first run; "bytes": what a `Simulation` holds in all.
    """
    per_event, setup, events = [], [], 0
    for seed in range(1, runs + 1):
        scene = crowd(count, seed)
        start = time.perf_counter()
        simulation = Simulation(scene)
        setup.append(time.perf_counter() - start)
        start = time.perf_counter()
        log = simulation.run(until=MANY_BALLS_DURATION)
        per_event.append((time.perf_counter() - start) / len(log))
        events = events or len(log)
    tracemalloc.start()
    held = Simulation(scene)
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    del held
    return {
        "balls": count,
        "per_event": spread(per_event),
        "setup": spread(setup),
        "events": events,
        "bytes": size,
    }


def feature_rows(seeds: int) -> list[Row]:
    """A break with and without what can be left out."""
    looked = breaks(seeds, look_at_events=True)["seconds"]
    turning = breaks(seeds, track_orientation=True)["seconds"]
    return [
        row("break, events recorded", "ms", breaks(seeds)["seconds"], None, 1e3),
        row("break, every Event looked at", "ms", looked, None, 1e3),
        row("break, orientations tracked", "ms", turning, None, 1e3),
        row("break from nothing: scene, set-up, shot, run", "ms", timed(whole_break, seeds), None, 1e3),
        row("break from nothing, in ticks of 10 ms", "ms", timed(ticked_break, min(seeds, TICKED_SEEDS)), None, 1e3),
    ]


def timed(action: Callable[[int], None], seeds: int) -> list[float]:
    """Wall time of an action for each seed, s, warm."""
    action(0)
    gc.collect()
    return [seconds(partial(action, seed)) for seed in range(seeds)]


def tasks(seeds: int, quick: bool) -> Iterator[Task]:
    """The pieces of this part."""
    yield "breaks", partial(_add_rows, make=partial(break_rows, seeds))
    slow_seeds = min(seeds, QUICK_INTERPRETED_SEEDS if quick else INTERPRETED_SEEDS)
    yield "without Numba", partial(_add_rows, make=partial(interpreted_rows, slow_seeds))
    if machine.is_ready():
        yield "starts", partial(_add_rows, make=partial(start_rows, QUICK_STARTS if quick else STARTS))
    yield "copies", partial(_add_rows, make=partial(small_rows, SMALL_RUNS))
    for count in COUNTS:
        runs = max(1, min(MOST_CROWDS, (QUICK_CROWDED_BALLS if quick else CROWDED_BALLS) // count))
        yield f"{count} balls", partial(_add_crowd, count=count, runs=runs)
    yield "features", partial(_add_features, seeds=seeds)


def _add_rows(study: dict[str, Any], make: Callable[[], list[Row]]) -> None:
    study.setdefault("rows", []).extend(make())


def _add_crowd(study: dict[str, Any], count: int, runs: int) -> None:
    study.setdefault("crowds", []).append(many_balls(count, runs))


def _add_features(study: dict[str, Any], seeds: int) -> None:
    study["features"] = feature_rows(seeds)
