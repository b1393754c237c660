# SPDX-License-Identifier: Apache-2.0
"""What several engine tests need: exact solutions, random scenes, and the laws that every run must keep."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import billiards_sim as bs

COMPILED = bs.compile()
"""Whether the engine runs in machine code."""

DATA = Path(__file__).parent.parent / "data"
EXACT_SCENES: dict[str, Any] = {
    scene["name"]: scene
    for file in ("exact_scenes.json", "more_exact_scenes.json")
    for scene in json.loads((DATA / file).read_text(encoding="utf-8"))["scenes"]
}
"""Solutions to 20 digits; the second file is what test/data/make_exact_scenes.py writes."""

PHYSICS = bs.Physics()
TABLE = bs.Table()
RADIUS = PHYSICS.radius
SLIDING = PHYSICS.sliding_friction * PHYSICS.gravity
ROLLING = PHYSICS.rolling_friction * PHYSICS.gravity
"""m/s^2, decelerations of a sliding and of a rolling ball."""

AT_X_MAX = TABLE.x_max - RADIUS
AT_Y_MAX = TABLE.y_max - RADIUS
"""m, centre of a ball at the rail."""

POOL: dict[str, float] = {
    "mass": 0.17,
    "ball_restitution": 0.95,
    "ball_friction": 9.951e-3,
    "ball_friction_slow": 0.108,
    "ball_friction_decay": 1.088,
    "rail_restitution": 0.85,
    "rail_friction": 0.2,
    "spin_friction": 0.01165,
    "cue_contact_time": 0.001,
    "cue_end_mass": 5.7e-3,
    "miscue_limit": 0.5,
}
"""Every effect, with the figures of pool."""

POOL_TABLE = bs.Table(nose_height=0.635)

EXACT_KINDS = {"ball-ball": "ball_ball", "rail": "ball_rail", "slide->roll": "rolling", "roll->rest": "rest"}
EXACT_RAILS = {"x-low": "x_min", "x-high": "x_max", "y-low": "y_min", "y-high": "y_max"}


def exact_array(balls: list[dict[str, Any]], key: str) -> NDArray[np.float64]:
    """(N, 2) or (N, 3) of a state in the file of exact solutions."""
    return np.array([[float(number) for number in ball[key]] for ball in balls])


def exact_scene(name: str) -> bs.Scene:
    initial = EXACT_SCENES[name]["initial"]
    table, physics = bs.Table(), bs.Physics()
    if "constants" in EXACT_SCENES[name]:
        given = EXACT_SCENES[name]["constants"]
        (x_min, x_max), (y_min, y_max) = (map(float, given["inner_bounds"][axis]) for axis in "xy")
        table = bs.Table(length=x_max - x_min, width=y_max - y_min, rail_thickness=x_min)
        physics = bs.Physics(
            mass=float(given["m"]),
            radius=float(given["R"]),
            gravity=float(given["g"]),
            sliding_friction=float(given["mu_slide"]),
            rolling_friction=float(given["mu_roll"]),
            rail_restitution=float(given["rail_restitution"]),
        )
    return bs.Scene(
        exact_array(initial, "position"),
        exact_array(initial, "velocity"),
        exact_array(initial, "angular_velocity"),
        table=table,
        physics=physics,
    )


def tolerance(name: str) -> float:
    """1e-12 (m, s, m/s), or ten times what rounding the initial values to doubles does to the exact solution."""
    return max(1e-12, 10.0 * float(EXACT_SCENES[name]["conditioning"]["at_rest"]))


MOST_INSTANTS = 1000


def random_scene(seed: int, most: int = 16) -> bs.Scene:
    """2 to `most` balls, some at rest, some with spin."""
    random = np.random.default_rng(seed)
    count = int(random.integers(2, most + 1))
    base = bs.scenes.random_balls(count, seed)
    velocities = base.velocities * (random.random((count, 1)) < 0.6)
    spins = random.uniform(-150.0, 150.0, (count, 3)) * (random.random((count, 1)) < 0.5)
    return bs.Scene(base.positions, velocities, spins)


@dataclass
class Extremes:
    """The worst that a run did, over all events and two instants between each two of them."""

    overlap: float
    """m, of two balls"""
    outside: float
    """m, into a rail"""
    energy_rise: float
    """relative, from one instant to the next"""
    events: int


def extremes(scene: bs.Scene, prepare: Callable[[bs.Simulation], None] = lambda simulation: None) -> Extremes:
    """Run a scene to rest and look at it at its events, at most `MOST_INSTANTS` of them, and twice between each two."""
    simulation = bs.Simulation(scene)
    prepare(simulation)
    run = bs.record(simulation)
    assert simulation.at_rest
    times = np.unique([run.start, *(event.time for event in run.events), run.end])
    times = np.append(times[: -1 : 1 + len(times) // MOST_INSTANTS], times[-1])
    between = np.concatenate([times[:-1] + share * np.diff(times) for share in (1.0 / 3.0, 2.0 / 3.0)])
    times = np.sort(np.concatenate((times, between)))
    table, radius = scene.table, scene.physics.radius
    low = np.array([table.x_min, table.y_min]) + radius
    high = np.array([table.x_max, table.y_max]) - radius
    positions = run.positions(times)
    outside = max((low - positions).max(), (positions - high).max())
    one, other = np.triu_indices(len(scene), 1)
    apart = positions[:, one] - positions[:, other]
    overlap = 2.0 * radius - np.hypot(apart[..., 0], apart[..., 1]).min(initial=np.inf)
    velocities, spins = run.velocities(times), run.angular_velocities(times)
    energies = np.array([scene.physics.kinetic_energy(*moving) for moving in zip(velocities, spins)])
    rises = np.diff(energies) / np.where(energies[:-1] > 0.0, energies[:-1], 1.0)
    assert not np.diff(energies)[energies[:-1] == 0.0].any()
    return Extremes(float(overlap), float(outside), float(rises.max(initial=-np.inf)), len(run.events))


INSTANTS = 6
"""Looks at a run between each two instants at which the motion of any ball changes."""

LOOKED_AT_ONCE = 2000
"""Instants, to bound the memory."""


def depth_at_every_instant(scene: bs.Scene, until: float | None = None) -> float:
    """How far any ball reaches into another or into a rail at the worst, m, as long as any moves or until a time.

    Between two changes of any motion, steps of sustained contact among them, distances are smooth.
    """
    run = bs.record(bs.Simulation(scene), until)
    changes = np.unique(np.append(run._times, run.end))
    shares = np.arange(1, INSTANTS + 1) / INSTANTS
    times = np.append(changes[0], (changes[:-1, np.newaxis] + np.diff(changes)[:, np.newaxis] * shares).ravel())
    times = np.minimum(times, run.end)  # but for rounding
    low = np.array([scene.table.x_min, scene.table.y_min]) + scene.physics.radius
    high = np.array([scene.table.x_max, scene.table.y_max]) - scene.physics.radius
    one, other = np.triu_indices(len(scene), 1)
    worst = -np.inf
    for first in range(0, len(times), LOOKED_AT_ONCE):
        positions = run.positions(times[first : first + LOOKED_AT_ONCE])
        worst = max(worst, (low - positions).max(), (positions - high).max())
        if len(one):
            apart = positions[:, one] - positions[:, other]
            worst = max(worst, 2.0 * scene.physics.radius - np.hypot(apart[..., 0], apart[..., 1]).min())
    return float(worst)
