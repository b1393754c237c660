# SPDX-License-Identifier: Apache-2.0
"""Elastic contacts: racks hit at 8 m/s, error against the step of integration and its cost.

`elastic.json` is written by `python3 test/data/make_elastic.py --truth billiards_sim/study/elastic.json`, a program
that integrates the same law by brute force and shares no code with the engine.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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


def gaps() -> list[float]:
    """The gaps of the racks, m, ascending."""
    return sorted({rack.gap for rack in racks(0.0)})


def tasks(quick: bool) -> Iterator[Task]:
    """The pieces of this part."""
    steps, runs = (QUICK_STEPS, QUICK_RUNS) if quick else (STEPS, RUNS)
    for gap, count in itertools.product(gaps(), (RIGID, *steps)):
        what = f"{count} steps a contact" if count != RIGID else "rigid"
        yield f"{what}: rack with gaps of {gap * 1e3:g} mm", partial(_add, gap=gap, steps=count, runs=runs)


def _add(figures: dict[str, Any], gap: float, steps: int, runs: int) -> None:
    figures.setdefault("racks", []).append(point(gap, steps, runs))


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
