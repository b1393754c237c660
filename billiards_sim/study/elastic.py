# SPDX-License-Identifier: Apache-2.0
"""Elastic contacts: racks hit at 8 m/s, error against the step of integration and its cost; how far a break spreads.

`elastic.json` is written by `python3 test/data/make_elastic.py --truth billiards_sim/study/elastic.json`, a program
that integrates the same law by brute force and shares no code with the engine.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine import scenes
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation
from billiards_sim.engine.table import Table
from billiards_sim.engine.tables import set_fields
from billiards_sim.study.measure import Task, seconds, spread

STEPS = (10, 20, 40, 80)
"""Steps a contact."""
QUICK_STEPS = (10, 20)
RUNS, QUICK_RUNS = 21, 5
"""Of each rack, for the median of its wall time."""

GAPS = (0.0, 5e-5, 1e-4, 3e-4, 1e-3)
"""m, between the balls of racks that are broken."""
AIMS, QUICK_AIMS = 41, 5
WIDEST_AIM = 0.012
"""rad, off the middle; the cue ball then meets the first ball 14 mm beside its middle."""
BREAK_SPEED = 8.0
"""m/s, of the cue ball."""

PICTURED_GAPS = (0.0, 5e-5, 3e-4)
PICTURE_TIME, PICTURE_AIM = 0.05, 0.003
"""s after the hit, and rad."""

RIGID = 0
"""In place of the steps a contact: rigid impacts."""

YOUNGS_MODULUS = 5.8e9
"""Pa, of phenolic resin; that of `elastic.json`."""

NO_FRICTION = 1e-9
"""Coefficient of friction of the cloth; the solutions have none."""

FOOT = 0.7
"""Where on the table's middle line the first ball lies, share of its length; far from every rail."""


@dataclass(frozen=True)
class Rack:
    """A rack that is about to be hit, and the exact balls a little later.

    Attributes:
        gap: m, between neighbours.
        time: s, of the solution.
        free: (N,), the balls that are not pressed at that time; the others are not compared.
    """

    gap: float
    scene: Scene
    time: float
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    free: NDArray[np.bool_]


@cache
def racks(youngs_modulus: float) -> tuple[Rack, ...]:
    """All racks, of balls with a Young's modulus, Pa; 0 for rigid ones."""
    document = json.loads(Path(__file__).with_name("elastic.json").read_text(encoding="utf-8"))
    return tuple(_rack(case, youngs_modulus) for case in document["cases"])


def simulation(scene: Scene, steps: int) -> Simulation:
    """A simulation that integrates contacts with so many steps each."""
    made = Simulation(scene)
    if steps != RIGID:
        set_fields(made._now.state.constants, 0, contact_steps=float(steps))
    return made


def run_once(rack: Rack, steps: int) -> dict[str, float]:
    """Play a rack to the time of its solution.

    Returns:
        "wall": s; "velocity" and "position": largest error of a component of a free ball, m/s and m; "energy": share of
        the energy that appeared or went, nan where some balls are still pressed.
    """
    played = simulation(rack.scene, steps)
    before = played.kinetic_energy
    wall = seconds(lambda: played.run(until=rack.time))
    change = abs(played.kinetic_energy / before - 1.0)
    return {
        "wall": wall,
        "velocity": float(np.abs(played.velocities - rack.velocities)[rack.free].max()),
        "position": float(np.abs(played.positions - rack.positions)[rack.free].max()),
        "energy": change if rack.free.all() else math.nan,
    }


def point(gap: float, steps: int, runs: int) -> dict[str, Any]:
    """The worst error over all racks of a gap, m, and the wall time of one."""
    found = [
        run_once(rack, steps)
        for rack in racks(YOUNGS_MODULUS if steps != RIGID else 0.0)
        if rack.gap == gap
        for _ in range(runs)
    ]
    energies = [run["energy"] for run in found if math.isfinite(run["energy"])]
    return {
        "gap": gap,
        "steps": steps,
        "wall": spread([run["wall"] for run in found]),
        "velocity": max(run["velocity"] for run in found),
        "position": max(run["position"] for run in found),
        "energy": max(energies, default=None),
    }


def break_shot(gap: float, is_elastic: bool, azimuth: float) -> Simulation:
    """A rack with every effect of pool, right after the shot that will break it."""
    physics = Physics.pool() if is_elastic else Physics.pool(youngs_modulus=0.0)
    made = Simulation(scenes.rack(gap, physics=physics))
    made.shoot(BREAK_SPEED, azimuth)
    return made


def break_point(gap: float, is_elastic: bool, aims: int) -> dict[str, Any]:
    """Breaks to rest, aimed at so many places: how far the 15 balls end from where they lay, m, and the wall time."""
    displacements, walls = [], []
    for azimuth in np.linspace(0.0, WIDEST_AIM, aims).tolist():
        played = break_shot(gap, is_elastic, azimuth)
        start = played.positions[1:]
        walls.append(seconds(played.run))
        displacements.append(float(np.median(np.hypot(*(played.positions[1:] - start).T))))
    return {"gap": gap, "elastic": is_elastic, "displacement": spread(displacements), "wall": spread(walls)}


def picture(gap: float, is_elastic: bool) -> dict[str, Any]:
    """Where the balls of a rack are `PICTURE_TIME` after it was hit, m, and where they were before."""
    hit = next(event.time for event in break_shot(gap, False, PICTURE_AIM).run() if event.kind == "ball_ball")
    played = break_shot(gap, is_elastic, PICTURE_AIM)
    start = played.positions
    played.run(until=hit + PICTURE_TIME)
    return {
        "gap": gap,
        "elastic": is_elastic,
        "radius": played.start_scene.physics.radius,
        "names": list(played.start_scene.names),
        "before": start.tolist(),
        "after": played.positions.tolist(),
    }


def gaps() -> list[float]:
    """The gaps of the racks, m, ascending."""
    return sorted({rack.gap for rack in racks(0.0)})


def tasks(quick: bool) -> Iterator[Task]:
    """The pieces of this part."""
    steps, runs = (QUICK_STEPS, QUICK_RUNS) if quick else (STEPS, RUNS)
    for gap, count in itertools.product(gaps(), (RIGID, *steps)):
        what = f"{count} steps a contact" if count != RIGID else "rigid"
        yield f"{what}: rack with gaps of {gap * 1e3:g} mm", _task("racks", point, gap, count, runs)
    aims = QUICK_AIMS if quick else AIMS
    for gap, is_elastic in itertools.product(GAPS, (False, True)):
        yield f"breaks with gaps of {gap * 1e3:g} mm", _task("breaks", break_point, gap, is_elastic, aims)
    for is_elastic, gap in itertools.product((False, True), PICTURED_GAPS):
        yield f"rack with gaps of {gap * 1e3:g} mm, drawn", _task("pictures", picture, gap, is_elastic)


def _task(name: str, measure: Callable[..., dict[str, Any]], *what: Any) -> Callable[[dict[str, Any]], None]:
    def add(figures: dict[str, Any]) -> None:
        figures.setdefault(name, []).append(measure(*what))

    return add


def _rack(case: dict[str, Any], youngs_modulus: float) -> Rack:
    physics = Physics(
        youngs_modulus=youngs_modulus,
        sliding_friction=NO_FRICTION,
        rolling_friction=NO_FRICTION,
    )
    table = Table()
    shift = np.array([FOOT * table.length, table.width / 2.0])
    positions = np.array(case["positions"]) + shift
    free = np.ones(len(positions), dtype=bool)
    free[case["in_contact"]] = False
    return Rack(
        gap=case["gap"],
        scene=Scene(positions, case["velocities"], table=table, physics=physics),
        time=case["time"],
        positions=np.array(case["final_positions"]) + shift,
        velocities=np.array(case["final_velocities"]),
        free=free,
    )
