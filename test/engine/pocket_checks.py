# SPDX-License-Identifier: Apache-2.0
"""What the tests of pockets share: a table's outline by itself, what a ball meets first on it, and scenes in mouths."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import billiards_sim as bs

Array = NDArray[np.float64]


@dataclass
class Outline:
    """Rubber and slate of a table as complex numbers, m, from the corner of the noses at low x and y.

    Built by turning and mirroring one edge of a mouth in the complex plane, in other steps than the engine.
    """

    segments: dict[str, tuple[complex, complex]]
    """noses and jaws; names as those of events, noses with a number behind"""
    discs: dict[str, tuple[complex, float]]
    captures: dict[str, tuple[complex, float]]


@cache
def outline(table: bs.Table) -> Outline:
    result = Outline({}, {}, {})
    size = complex(table.length, table.width)
    tips: dict[str, list[complex]] = {}

    def add_edge(
        pocket: bs.Pocket, name: str, side: str, rail: str, tip: complex, nose: complex, inward: complex
    ) -> None:
        # A nose goes on from the tip along `nose`, the table lies on the side of `inward`.
        back = pocket.point_radius / math.tan(0.5 * pocket.cut_angle)
        jaw = nose * math.cos(pocket.cut_angle) - inward * math.sin(pocket.cut_angle)
        end = tip + jaw * table.jaw_depth / math.sin(pocket.cut_angle)
        result.segments[f"{name}_jaw_{side}"] = (tip + back * jaw, end)
        result.discs[f"{name}_point_{side}"] = (tip + back * nose - inward * pocket.point_radius, pocket.point_radius)
        tips.setdefault(rail, []).append(tip + back * nose)

    if table.corner_pocket is not None:
        pocket = table.corner_pocket
        for x, sign_x in (("x_min", 1.0), ("x_max", -1.0)):
            for y, sign_y in (("y_min", 1.0), ("y_max", -1.0)):
                corner = complex(0.0 if sign_x > 0 else size.real, 0.0 if sign_y > 0 else size.imag)
                along_x, along_y = complex(sign_x, 0.0), complex(0.0, sign_y)
                name, tip = f"{x}_{y}", pocket.mouth / math.sqrt(2.0)
                add_edge(pocket, name, y, y, corner + tip * along_x, along_x, along_y)
                add_edge(pocket, name, x, x, corner + tip * along_y, along_y, along_x)
                out = -(along_x + along_y) / math.sqrt(2.0)
                away = pocket.slate_radius - (0.5 * pocket.mouth - pocket.shelf)
                result.captures[name] = (corner + away * out, pocket.slate_radius)
    if table.side_pocket is not None:
        pocket = table.side_pocket
        for name, sign_y in (("y_min", 1.0), ("y_max", -1.0)):
            middle = complex(0.5 * size.real, 0.0 if sign_y > 0 else size.imag)
            inward = complex(0.0, sign_y)
            add_edge(pocket, name, "x_min", name, middle - 0.5 * pocket.mouth, complex(-1.0, 0.0), inward)
            add_edge(pocket, name, "x_max", name, middle + 0.5 * pocket.mouth, complex(1.0, 0.0), inward)
            result.captures[name] = (middle - inward * (pocket.shelf + pocket.slate_radius), pocket.slate_radius)
    for rail, ends in tips.items():
        ordered = sorted(ends, key=lambda tip: (tip.real, tip.imag))
        for number in range(0, len(ordered), 2):
            result.segments[f"{rail}_{number // 2}"] = (ordered[number], ordered[number + 1])
    return result


def distances(shape: Outline, places: Any) -> dict[str, Any]:
    """How far each part is from places, complex, m: of segments and discs the surface, of captures the slate's cut."""
    found = {}
    for name, (start, end) in shape.segments.items():
        along = end - start
        share = np.clip(((places - start) * along.conjugate()).real / abs(along) ** 2, 0.0, 1.0)
        found[name] = np.abs(places - start - share * along)
    for name, (centre, radius) in shape.discs.items():
        found[name] = np.abs(places - centre) - radius
    for name, (centre, radius) in shape.captures.items():
        found[name] = np.abs(places - centre) - radius
    return found


def gap(shape: Outline, places: Any, radius: float) -> dict[str, Any]:
    """How far balls of a radius at places are from meeting each part, m."""
    return {name: away if name in shape.captures else away - radius for name, away in distances(shape, places).items()}


def path_of(position: Any, velocity: Any, spin: Any, physics: bs.Physics) -> Any:
    """The complex place of a free ball as a function of times (T,), s: it slides, then it rolls, then it rests."""
    place, v = complex(*position), complex(*velocity)
    slip = v + physics.radius * complex(-spin[1], spin[0])
    sliding = physics.sliding_friction * physics.gravity
    slips = 2.0 * abs(slip) / (7.0 * sliding)
    slowing = sliding * (slip / abs(slip) if slip else 0.0)
    v_rolling = v - slowing * slips
    start = place + v * slips - 0.5 * slowing * slips**2
    rolling = physics.rolling_friction * physics.gravity
    rolls = abs(v_rolling) / rolling
    ahead = v_rolling / abs(v_rolling) if v_rolling else 0.0

    def at(times: Any) -> Any:
        early = np.minimum(times, slips)
        late = np.clip(times - slips, 0.0, rolls)
        slid = place + v * early - 0.5 * slowing * early**2
        return np.where(times <= slips, slid, start + v_rolling * late - 0.5 * rolling * ahead * late**2)

    return at, slips + rolls


def first_met(shape: Outline, at: Any, end: float, radius: float, samples: int = 20_000) -> tuple[str, float] | None:
    """What a ball on a path meets first, and when, s: by samples, and bisection between two of them. None: nothing."""
    times = np.linspace(0.0, end, samples)
    met = [(name, np.flatnonzero(away <= 0.0)) for name, away in gap(shape, at(times), radius).items()]
    found = [(int(indices[0]), name) for name, indices in met if len(indices)]
    if not found:
        return None
    first = min(found)[0]
    best = ("", math.inf)
    for index, name in found:
        if index > first:
            continue
        low, high = times[index - 1], times[index]
        for _ in range(80):
            middle = 0.5 * (low + high)
            if gap(shape, at(np.array([middle])), radius)[name][0] <= 0.0:
                high = middle
            else:
                low = middle
        if high < best[1]:
            best = (name, high)
    return best


POOL = bs.Physics(
    mass=0.17,
    ball_restitution=0.95,
    ball_friction=9.951e-3,
    ball_friction_slow=0.108,
    rail_restitution=0.85,
    rail_friction=0.2,
    spin_friction=0.01165,
)
SNOOKER = bs.Physics(mass=0.1406, radius=0.02625)

TABLES: dict[str, tuple[bs.Table, bs.Physics]] = {
    "pool_9ft": (bs.Table.pool_9ft(), POOL),
    "pool_7ft": (bs.Table.pool_7ft(), bs.Physics()),
    "snooker_12ft": (bs.Table.snooker_12ft(), SNOOKER),
}


def corner_of(table: bs.Table) -> complex:
    """Of the noses at low x and y, in the frame `table`."""
    return complex(table.x_min, table.y_min)


def random_shot(random: np.random.Generator, table: bs.Table, physics: bs.Physics) -> bs.Scene:
    """One ball anywhere on the table, half of the time on its way to a mouth; it slides, rolls or spins."""
    radius = physics.radius
    low = np.array([table.x_min, table.y_min]) + radius
    high = np.array([table.x_max, table.y_max]) - radius
    position = random.uniform(low, high)
    angle = random.uniform(0.0, 2.0 * math.pi)
    if random.random() < 0.7:
        mouth = table.mouths[random.integers(len(table.mouths))]
        to = np.add(mouth.centre, table.centre) + random.normal(0.0, 0.05, 2) - position
        angle = math.atan2(to[1], to[0])
    speed = 10.0 ** random.uniform(-1.0, 1.0)
    velocity = np.array([speed * math.cos(angle), speed * math.sin(angle)])
    spins = (np.zeros(3), np.array([-velocity[1], velocity[0], 0.0]) / radius, random.uniform(-150.0, 150.0, 3))
    return bs.Scene([position], [velocity], [spins[random.integers(3)]], table=table, physics=physics)


def mouth_scene(seed: int) -> bs.Scene:
    """One to four balls in a mouth, at jaws, at points and at each other, slow and with spin."""
    random = np.random.default_rng(seed)
    table, base = list(TABLES.values())[seed % len(TABLES)]
    radius = base.radius
    physics = bs.Physics(
        radius=radius,
        rail_restitution=float(random.choice([0.0, 0.3, 0.7, 0.85, 1.0])),
        ball_restitution=float(random.choice([0.0, 0.5, 0.95, 1.0])),
        rail_friction=float(random.choice([0.0, 0.0, 0.2])),
        ball_friction=float(random.choice([0.0, 0.06])),
    )
    room = 0.5 * np.array([table.length, table.width]) - radius
    count = int(random.integers(1, 5))
    while True:
        mouth = table.mouths[random.integers(len(table.mouths))]
        places: list[Array] = []
        for _ in range(count):
            kind, edge = random.integers(4), mouth.edges[random.integers(2)]
            place = np.clip(np.array(mouth.centre) + random.normal(0.0, 0.08, 2), -room, room)
            if kind == 0:
                share = random.random()
                place = (
                    (1.0 - share) * np.array(edge.start) + share * np.array(edge.end) + radius * np.array(edge.normal)
                )
            elif kind == 1:
                turn = random.uniform(-0.5, 0.5) * (math.pi - mouth.pocket.cut_angle)
                angle = math.atan2(edge.middle[1], edge.middle[0]) + turn
                reach = mouth.pocket.point_radius + radius
                place = np.array(edge.point) + reach * np.array([math.cos(angle), math.sin(angle)])
            elif kind == 2 and places:
                angle = random.uniform(0.0, 2.0 * math.pi)
                place = places[-1] + 2.0 * radius * np.array([math.cos(angle), math.sin(angle)])
            places.append(place)
        speeds = 10.0 ** random.uniform(-3.0, 0.3, (count, 1)) * (random.random((count, 1)) < 0.7)
        spins = 10.0 ** random.uniform(-2.0, 0.0, (count, 1)) * (random.random((count, 1)) < 0.8)
        try:
            return bs.Scene(
                np.array(places) + table.centre,
                random.normal(0.0, 1.0, (count, 2)) * speeds,
                random.uniform(-60.0, 60.0, (count, 3)) * spins,
                table=table,
                physics=physics,
            )
        except ValueError:
            continue


@dataclass
class PocketExtremes:
    """The worst of a run on a table with pockets, at every instant."""

    overlap: float
    """m, of two balls"""
    outside: float
    """m, into rubber"""
    fallen: float
    """m, beyond the slate's cut of one that has not been pocketed"""
    energy_rise: float
    """relative, from one instant to the next"""
    events: int


MOST_TIMES = 6000


def pocket_extremes(simulation: bs.Simulation) -> PocketExtremes:
    """Run a simulation to rest and look at it at each change of any motion and three times between."""
    scene = simulation.start_scene
    table, radius, physics = scene.table, scene.physics.radius, scene.physics
    run = bs.record(simulation)
    assert simulation.at_rest
    times = np.unique(run._times)
    times = times[:: 1 + 4 * len(times) // MOST_TIMES]
    steps = np.diff(np.append(times, run.end))
    times = np.unique((times[:, np.newaxis] + steps[:, np.newaxis] * np.arange(4) / 4.0).ravel())
    times = times[(times >= run.start) & (times <= run.end)]
    positions = run.positions(times)
    falls = np.full(len(scene), np.inf)
    falls[~scene.in_play] = -np.inf
    for event in run.events:
        if event.kind == "pocketed":
            falls[scene.names.index(event.balls[0])] = event.time
    on = times[:, np.newaxis] < falls
    shape = outline(table)
    away = gap(shape, positions[..., 0] + 1j * positions[..., 1] - corner_of(table), radius)
    rubber = np.max([-value for name, value in away.items() if name not in shape.captures], axis=0)
    slate = np.max([-value for name, value in away.items() if name in shape.captures], axis=0)
    linear = 0.5 * physics.mass * (run.velocities(times) ** 2).sum((1, 2))
    energy = linear + 0.5 * physics.moment_of_inertia * (run.angular_velocities(times) ** 2).sum((1, 2))
    rise = np.diff(energy) / np.maximum(energy[:-1], 1e-12)
    one, other = np.triu_indices(len(scene), 1)
    apart = np.hypot(*np.moveaxis(positions[:, one] - positions[:, other], -1, 0))
    closest = np.min(apart, where=on[:, one] & on[:, other], initial=np.inf)
    return PocketExtremes(
        overlap=float(2.0 * radius - closest),
        outside=float(np.max(rubber, where=on, initial=-np.inf)),
        fallen=float(np.max(slate, where=on, initial=-np.inf)),
        energy_rise=float(rise.max(initial=-np.inf)),
        events=len(run.events),
    )
