# SPDX-License-Identifier: Apache-2.0
"""Scenes built to provoke: balls that touch or nearly do, in rows, rings and lattices, and press against each other."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

import billiards_sim as bs

RADIUS = bs.Physics().radius
TABLE = bs.Table()
LOW = np.array([TABLE.x_min, TABLE.y_min]) + RADIUS
HIGH = np.array([TABLE.x_max, TABLE.y_max]) - RADIUS
GAPS = (0.0, *(10.0**power for power in range(-13, -3)))
"""m, between neighbours and to the rail."""


def row(count: int, pitch: float) -> NDArray[np.float64]:
    """(count, 2) m, along x."""
    return pitch * np.column_stack((np.arange(count), np.zeros(count)))


def square(columns: int, rows: int, pitch: float) -> NDArray[np.float64]:
    """(columns * rows, 2) m."""
    return pitch * np.array([(x, y) for x in range(columns) for y in range(rows)], dtype=np.float64)


def hexagonal(columns: int, rows: int, pitch: float) -> NDArray[np.float64]:
    """(columns * rows, 2) m: every other row is shifted by half a pitch."""
    return pitch * np.array([(x + 0.5 * (y % 2), math.sqrt(0.75) * y) for x in range(columns) for y in range(rows)])


def ring(count: int, pitch: float) -> NDArray[np.float64]:
    """(count, 2) m."""
    turns = 2.0 * math.pi * np.arange(count) / count
    return 0.5 * pitch / math.sin(math.pi / count) * np.column_stack((np.cos(turns), np.sin(turns)))


def turned(places: NDArray[np.float64], angle: float) -> NDArray[np.float64]:
    """Places turned about the origin, rad."""
    c, s = math.cos(angle), math.sin(angle)
    return places @ np.array([[c, s], [-s, c]])


def topspin(directions: NDArray[np.float64], spin: float | NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) rad/s: spin that drives balls along (N, 2) unit directions."""
    return np.column_stack((-directions[:, 1], directions[:, 0], np.zeros(len(directions)))) * np.reshape(spin, (-1, 1))


def towards(places: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 2) unit directions to a target; 0 for a ball that is there."""
    way = target - places
    distance = np.hypot(way[:, 0], way[:, 1])[:, np.newaxis]
    return np.divide(way, distance, out=np.zeros_like(way), where=distance > 0.0)


def _layout(random: np.random.Generator) -> NDArray[np.float64]:
    kind = random.choice(["square", "hexagonal", "ring", "row", "rail", "corner", "one"])
    gap = float(random.choice(GAPS))
    pitch = 2.0 * RADIUS * (1.0 + 1e-15) + gap
    if kind == "square":
        places = square(int(random.integers(2, 6)), int(random.integers(1, 6)), pitch)
    elif kind == "hexagonal":
        places = hexagonal(int(random.integers(2, 6)), int(random.integers(1, 6)), pitch)
    elif kind == "ring":
        places = ring(int(random.integers(3, 13)), pitch)
    else:
        places = row(1 if kind == "one" else int(random.integers(1, 13)), pitch)
    if kind not in ("rail", "corner") and random.random() < 0.5:
        places = turned(places, random.uniform(0.0, 2.0 * math.pi))
    least, most = LOW - places.min(axis=0), HIGH - places.max(axis=0)
    origin = random.uniform(least, most)
    if kind == "rail":
        origin[1] = least[1] + gap * (random.random() < 0.5)
    elif kind == "corner" or random.random() < 0.2:
        origin = least + gap * (random.random() < 0.5)
    elif random.random() < 0.3:
        origin[0] = most[0] - gap * (random.random() < 0.5)
    return np.clip(places + origin, LOW, HIGH)


def provoking_scene(seed: int) -> bs.Scene:
    """1 to 25 balls with spins of 1 to 1 000 rad/s, any restitution of the rails, any friction."""
    random = np.random.default_rng(seed)
    places = _layout(random)
    count = len(places)
    centre = places.mean(axis=0)
    velocities, spins = np.zeros((count, 2)), np.zeros((count, 3))
    spin = 10.0 ** random.uniform(0.0, 3.0)
    style = random.choice(["inward", "random", "one", "halves"])
    if style == "inward":
        directions = towards(places, centre + 1e-9 * random.normal(size=2))
        spins = topspin(directions, spin)
        velocities = directions * float(random.choice([0.0, 0.0, 1e-6, 3e-6, 1e-4, 1e-2]))
    elif style == "random":
        angles = random.uniform(0.0, 2.0 * math.pi, count)
        spins = topspin(np.column_stack((np.cos(angles), np.sin(angles))), random.uniform(0.0, spin, count))
    elif style == "one":
        angles = random.uniform(0.0, 2.0 * math.pi, 2)
        spins[random.integers(count), :2] = spin * math.cos(angles[0]), spin * math.sin(angles[0])
        if random.random() < 0.5:
            speed = 10.0 ** random.uniform(-6.0, 1.0)
            velocities[random.integers(count)] = speed * math.cos(angles[1]), speed * math.sin(angles[1])
    else:
        axis = int(random.integers(2))
        directions = np.zeros((count, 2))
        directions[:, axis] = np.where(places[:, axis] > centre[axis], -1.0, 1.0)
        spins = topspin(directions, spin)
        velocities = directions * float(random.choice([0.0, 1e-6, 5e-6, 1e-4]))
    spins[:, 2] = random.uniform(-100.0, 100.0, count)
    friction = {}
    if random.random() < 0.6:
        friction["sliding_friction"] = 10.0 ** random.uniform(-2.5, 0.5)
        friction["rolling_friction"] = 10.0 ** random.uniform(-3.5, -0.5)
    restitution = float(random.choice([0.0, 0.3, 0.5, 0.7, 0.7, 0.9, 0.99, 1.0, 1.0, 1.0]))
    return bs.Scene(places, velocities, spins, physics=bs.Physics(rail_restitution=restitution, **friction))


def frozen_row(seed: int) -> bs.Scene:
    """2 to 8 touching balls of which some spin: along a rail, into a corner, or pushed in the open by the first."""
    random = np.random.default_rng(seed)
    kind = random.choice(["rail", "corner", "pushed"])
    places = row(int(random.integers(2, 9)), 2.0 * RADIUS)
    count = len(places)
    spins = np.zeros((count, 3))
    if kind == "pushed":
        angle = random.uniform(0.0, 0.5 * math.pi) * (random.random() < 0.5)
        places = turned(places, angle) + (0.8, 0.3)
        spins[0, :2] = random.uniform(10.0, 300.0) * np.array([-math.sin(angle), math.cos(angle)])
        spins[0, :2] += random.uniform(-20.0, 20.0, 2)
        spins[-1, :2] += random.uniform(-100.0, 100.0, 2) * (random.random() < 0.5)
    else:
        spins[:, :2] = random.uniform(-1.0, 1.0, (count, 2)) * random.choice([0.0, 1.0, 100.0, 300.0], (count, 1))
        start = LOW[0] if kind == "corner" else random.uniform(LOW[0], HIGH[0] - places[-1, 0])
        places = places + (start, LOW[1])
    slick = random.random() < 1.0 / 3.0
    return bs.Scene(places, None, spins, physics=bs.Physics(sliding_friction=0.05) if slick else bs.Physics())
