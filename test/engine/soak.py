# SPDX-License-Identifier: Apache-2.0
"""Random scenes by the thousand, dense and touching ones among them, each checked against the laws until rest.

python test/engine/soak.py [--scenes 10000] [--breaks 20000] [--rows 10000] [--provoking 100000]
    [--shots 300000]
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from multiprocessing import Pool

import numpy as np
from checks import POOL_TABLE, Extremes, depth_at_every_instant, extremes, random_scene
from numpy.typing import NDArray
from pocket_checks import TABLES, corner_of, gap, outline, random_shot
from provoke import frozen_row, provoking_scene

import billiards_sim as bs
from billiards_sim.engine.tables import column

RADIUS = bs.Physics().radius
TABLE = bs.Table()
GAPS = (0.0, 0.0, 1e-9, 1e-7, 1e-5, 1e-4, 5e-4)
"""m, between the balls of a rack."""


def rack(random: np.random.Generator) -> NDArray[np.float64]:
    """(N, 2) m: a triangle of up to 21 balls, apex towards the first one, which stands free."""
    rows = int(random.integers(2, 7))
    pitch = 2.0 * RADIUS + float(random.choice(GAPS))
    triangle = [
        (1.5 + 0.5 * math.sqrt(3.0) * pitch * row, 0.6358 + pitch * (place - 0.5 * row))
        for row in range(rows)
        for place in range(row + 1)
    ]
    return np.array([(random.uniform(0.1, 1.2), random.uniform(0.1, 1.17)), *triangle])


def cluster(random: np.random.Generator) -> NDArray[np.float64]:
    """(N, 2) m: touching balls grown at random on a hexagonal lattice, half of the time against a rail."""
    steps = [(1, 0), (0, 1), (-1, 1), (-1, 0), (0, -1), (1, -1)]
    places = [(0, 0)]
    for _ in range(int(random.integers(1, 22))):
        a, b = places[random.integers(len(places))]
        da, db = steps[random.integers(6)]
        if (a + da, b + db) not in places:
            places.append((a + da, b + db))
    turn = random.uniform(0.0, 2.0 * math.pi) if random.random() < 0.5 else 0.0
    lattice = np.array([(a + 0.5 * b, 0.5 * math.sqrt(3.0) * b) for a, b in places])
    spread = (
        2.0 * RADIUS * (1.0 + 1e-15) * lattice @ [[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]]
    )
    low, high = spread.min(axis=0), spread.max(axis=0)
    least = np.array([TABLE.x_min, TABLE.y_min]) + RADIUS - low
    most = np.array([TABLE.x_max, TABLE.y_max]) - RADIUS - high
    offset = random.uniform(least, most)
    if random.random() < 0.5:
        offset[0] = most[0]
    return spread + offset


def dense_scene(seed: int) -> bs.Scene:
    """A rack or a touching cluster of which some balls move or spin."""
    random = np.random.default_rng(seed)
    positions = rack(random) if random.random() < 0.5 else cluster(random)
    count = len(positions)
    velocities = np.zeros((count, 2))
    spins = np.zeros((count, 3))
    for index in {0, *random.integers(0, count, int(random.integers(0, 4))).tolist()}:
        speed, angle = 10.0 ** random.uniform(-3.0, 1.0), random.uniform(0.0, 2.0 * math.pi)
        velocities[index] = speed * math.cos(angle), speed * math.sin(angle)
        spins[index] = random.uniform(-150.0, 150.0, 3) * (random.random() < 0.5)
    if random.random() < 0.5 and count > 1:  # the first one at another
        aim = positions[random.integers(1, count)] - positions[0]
        velocities[0] = np.hypot(*velocities[0]) * aim / np.hypot(*aim)
    return bs.Scene(positions, velocities, spins)


def run_scene(seed: int) -> Extremes:
    """Every other scene is dense."""
    return extremes(dense_scene(seed) if seed % 2 else random_scene(seed, most=22))


def break_shot(seed: int) -> tuple[bs.Scene, bs.Shot]:
    """A break with random speed, aim, english and gaps."""
    random = np.random.default_rng(seed)
    scene = bs.scenes.rack(float(random.choice(GAPS)))
    force, angle = random.uniform(5.0, 200.0), random.uniform(-0.1, 0.1)
    side, up = random.uniform(-0.45, 0.45, 2) * RADIUS
    return scene, bs.Shot((force * math.cos(angle), force * math.sin(angle), 0.0), (side, up))


def run_break(seed: int) -> Extremes:
    """A break with random speed, aim, english and gaps."""
    scene, shot = break_shot(seed)
    return extremes(scene, lambda simulation: simulation.strike(shot.force, shot.offset))


def with_every_effect(scene: bs.Scene, seed: int) -> bs.Scene:
    """The same in pool: in every other pair of scenes the noses are above the centre of the balls."""
    return replace(scene, physics=bs.Physics.pool(youngs_modulus=0.0), table=POOL_TABLE if seed % 4 < 2 else TABLE)


def pool_scene(seed: int) -> bs.Scene:
    """A random or a dense scene with every effect."""
    return with_every_effect(dense_scene(seed) if seed % 2 else random_scene(seed, most=22), seed)


def pool_break(seed: int) -> tuple[bs.Scene, Callable[[bs.Simulation], None]]:
    """A break with every effect, some with a raised butt, within the miscue limit."""
    scene, shot = break_shot(seed)
    part = bs.Physics.pool(youngs_modulus=0.0).cue_contact_time / bs.Physics().cue_contact_time
    x, y, _ = shot.force
    side, up = shot.offset
    raised = -0.3 * math.hypot(x, y) if seed % 3 == 0 else 0.0
    force, offset = (x / part, y / part, raised / part), (0.7 * side, 0.7 * up)
    return with_every_effect(scene, seed), lambda simulation: simulation.strike(force, offset)


def run_pool_scene(seed: int) -> Extremes:
    """A scene with every effect."""
    return extremes(pool_scene(seed))


def run_pool_break(seed: int) -> Extremes:
    """A break with every effect."""
    return extremes(*pool_break(seed))


@dataclass
class Depth:
    """The worst of a row, at every instant."""

    overlap: float
    """m, of two balls, or into a rail"""


@dataclass
class Effort:
    """What a scene takes that was built to provoke."""

    events: int
    seconds: float
    """s of the processor"""


def run_row(seed: int) -> Depth:
    """A row that friction presses together."""
    return Depth(depth_at_every_instant(frozen_row(seed)))


def effort(scene: bs.Scene, prepare: Callable[[bs.Simulation], None] = lambda simulation: None) -> Effort:
    """What it takes to play a scene to rest."""
    simulation = bs.Simulation(scene)
    prepare(simulation)
    began = time.process_time()
    events = simulation.run()
    took = time.process_time() - began
    assert simulation.at_rest
    return Effort(len(events), took)


def run_provoking(seed: int) -> Effort:
    """A scene built to provoke, to rest."""
    return effort(provoking_scene(seed))


def run_pool_provoking(seed: int) -> Effort:
    """The same with every effect, and any restitution between the balls too."""
    scene = provoking_scene(seed)
    names = ("sliding_friction", "rolling_friction", "rail_restitution")
    kept = {name: getattr(scene.physics, name) for name in names}
    restitution = (0.95, 1.0, 0.5, 0.0)[seed % 4]
    physics = bs.Physics.pool(**kept, ball_restitution=restitution, youngs_modulus=0.0)
    return effort(replace(scene, physics=physics, table=POOL_TABLE))


def run_pool_effort(seed: int) -> Effort:
    """A scene or a break with every effect."""
    return effort(*pool_break(seed // 2)) if seed % 2 else effort(pool_scene(seed // 2))


@dataclass
class Played:
    """The worst of a run, where no elastic contact is in the middle of it."""

    overlap: float
    """m, of two balls"""
    outside: float
    """m, into rubber, or beyond the slate's cut without having fallen"""
    energy_rise: float
    """relative, from one look to the next"""
    events: int
    seconds: float
    """s of the processor, without looks"""


SPARSE_LOOKS = np.linspace(0.2, 2.0, 10)
DENSE_LOOKS = np.concatenate((np.linspace(1e-3, 0.05, 50), SPARSE_LOOKS))
"""s. When a run is looked at, and at its end."""


def played(
    scene: bs.Scene,
    looks: NDArray[np.float64] | None,
    prepare: Callable[[bs.Simulation], None] = lambda simulation: None,
) -> Played:
    """Play a scene to rest and look at it on the way, or at each of its events."""
    simulation, looked_at = bs.Simulation(scene), bs.Simulation(scene)
    prepare(simulation)
    prepare(looked_at)
    began = time.process_time()
    events = simulation.run()
    took = time.process_time() - began
    assert simulation.at_rest
    worst = Played(-math.inf, -math.inf, -math.inf, len(events), took)
    energy = looked_at.kinetic_energy
    times = np.unique([event.time for event in events]) if looks is None else looks
    for look in (*times.tolist(), None):
        looked_at.run(until=look)
        if presses(looked_at) or not looked_at.in_play.any():
            continue
        places = looked_at.positions[looked_at.in_play]
        one, other = np.triu_indices(len(places), 1)
        apart = np.hypot(*(places[one] - places[other]).T).min(initial=math.inf)
        before, energy = energy, looked_at.kinetic_energy
        worst.overlap = max(worst.overlap, float(2.0 * scene.physics.radius - apart))
        worst.outside = max(worst.outside, outside(scene, places))
        worst.energy_rise = max(worst.energy_rise, energy / before - 1.0 if before > 0.0 else energy)
    assert np.array_equal(looked_at.positions, simulation.positions)
    return worst


def outside(scene: bs.Scene, places: NDArray[np.float64]) -> float:
    """How far any ball is in rubber, or beyond the slate's cut, m; negative where none is."""
    table, radius = scene.table, scene.physics.radius
    if table.mouths:
        away = gap(outline(table), places @ (1.0, 1j) - corner_of(table), radius)
        return -float(min(value.min() for value in away.values()))
    low = np.array([table.x_min, table.y_min]) + radius
    high = np.array([table.x_max, table.y_max]) - radius
    return float(max((low - places).max(), (places - high).max()))


def presses(simulation: bs.Simulation) -> bool:
    """Whether bodies are in the middle of an elastic contact: they give by up to 1 mm, and hold energy."""
    return bool(column(simulation._now.state.clock, "touches")[0])


def run_shot(seed: int) -> Played:
    """One ball on a table with pockets, often into a mouth."""
    scene = random_shot(np.random.default_rng(seed), *list(TABLES.values())[seed % len(TABLES)])
    return played(scene, SPARSE_LOOKS)


def run_game(seed: int) -> Played:
    """A break of eight-ball or nine-ball, with everything on, from behind the head string."""
    random = np.random.default_rng(seed)
    make = (bs.scenes.eight_ball, bs.scenes.nine_ball)[seed % 2]
    scene = make(float(random.choice(GAPS)), float(random.choice((0.0, 5e-5))), seed)
    positions = scene.positions.copy()
    positions[0] += (-random.uniform(0.0, 0.3), random.uniform(-0.4, 0.4))
    to = positions[1] - positions[0]
    azimuth = math.atan2(to[1], to[0]) + random.normal(0.0, 0.005)
    speed, side, up = random.uniform(3.0, 13.0), random.uniform(-0.25, 0.25), random.uniform(-0.4, 0.4)
    scene = replace(scene, positions=positions)
    return played(scene, DENSE_LOOKS, lambda simulation: simulation.shoot(speed, azimuth, side=side, up=up))


def run_elastic_break(seed: int) -> Played:
    """A break of the rack at 8 m/s with random aim, english and gaps, with everything on."""
    random = np.random.default_rng(seed)
    scene = bs.scenes.rack(float(random.choice(GAPS)), physics=bs.Physics.pool())
    azimuth, side, up = random.uniform(-0.05, 0.05), random.uniform(-0.3, 0.3), random.uniform(-0.3, 0.3)
    return played(scene, None, lambda simulation: simulation.shoot(8.0, azimuth, side=side, up=up))


def run_elastic_scene(seed: int) -> Played:
    """A random or a dense scene with everything on."""
    scene = dense_scene(seed) if seed % 2 else random_scene(seed, most=22)
    return played(replace(scene, physics=bs.Physics.pool(), table=POOL_TABLE if seed % 4 < 2 else TABLE), None)


Worst = Extremes | Depth | Effort | Played

ALLOWED: dict[type[Worst], Worst] = {
    Extremes: Extremes(overlap=1e-9, outside=1e-9, energy_rise=1e-12, events=20_000),
    Depth: Depth(overlap=1e-9),
    Effort: Effort(events=20_000, seconds=1.0),
    Played: Played(overlap=1e-9, outside=1e-9, energy_rise=2e-5, events=20_000, seconds=1.0),
}


@dataclass
class Outcome:
    seed: int
    worst: Worst | None
    error: str
    seconds: float


def attempt(job: tuple[Callable[[int], Worst], int]) -> Outcome:
    run, seed = job
    began = time.perf_counter()
    try:
        worst, error = run(seed), ""
    except Exception as failure:  # what fails is reported, and the others go on
        worst, error = None, f"{type(failure).__name__}: {failure}"
    return Outcome(seed, worst, error, time.perf_counter() - began)


def broken_laws(worst: Worst) -> list[str]:
    """What a run did more than it may."""
    limits = vars(ALLOWED[type(worst)])
    return [f"{name} {value:.3g}" for name, value in vars(worst).items() if value > limits[name]]


def soak(name: str, run: Callable[[int], Worst], count: int) -> bool:
    """Run `count` seeds, print the worst figures; returns whether every law held."""
    from tqdm import tqdm

    outcomes = []
    with Pool(os.cpu_count()) as pool:
        jobs = pool.imap_unordered(attempt, [(run, seed) for seed in range(count)], chunksize=8)
        for outcome in tqdm(jobs, total=count, desc=name, unit="run"):
            outcomes.append(outcome)
            failure = outcome.error or (outcome.worst and ", ".join(broken_laws(outcome.worst)))
            if failure:
                tqdm.write(f"{name} {outcome.seed}: {failure}")
    ended = [outcome for outcome in outcomes if outcome.worst is not None]
    print(f"{name}: {len(ended)} of {count} came to rest")
    for key in vars(ended[0].worst):
        values = sorted((vars(one.worst)[key], one.seed) for one in ended)
        print(
            f"  {key.replace('_', ' ')}: median {values[len(values) // 2][0]:.3g}, largest {values[-1][0]:.3g}", end=""
        )
        print(f" (seed {values[-1][1]})")
        if key == "events":
            print(f"  more than 1000 events: {sum(value > 1000 for value, _ in values)} runs")
    slowest = max(outcomes, key=lambda one: one.seconds)
    print(f"  slowest: {slowest.seconds:.2f} s with its checks (seed {slowest.seed})")
    return len(ended) == count and not any(broken_laws(one.worst) for one in ended)  # type: ignore[arg-type]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=10_000, help="random scenes of 2 to 22 balls (%(default)s)")
    parser.add_argument("--breaks", type=int, default=20_000, help="random breaks (%(default)s)")
    parser.add_argument("--rows", type=int, default=10_000, help="rows that friction presses together (%(default)s)")
    parser.add_argument("--provoking", type=int, default=100_000, help="scenes built to provoke (%(default)s)")
    parser.add_argument("--shots", type=int, default=300_000, help="shots of one ball at pockets (%(default)s)")
    given = parser.parse_args()
    kept = [
        soak("scene", run_scene, given.scenes),
        soak("break", run_break, given.breaks),
        soak("pool scene", run_pool_scene, given.scenes),
        soak("pool break", run_pool_break, given.breaks),
        soak("pool effort", run_pool_effort, given.scenes + given.breaks),
        soak("elastic scene", run_elastic_scene, given.scenes),
        soak("elastic break", run_elastic_break, given.breaks),
        soak("row", run_row, given.rows),
        soak("provoking", run_provoking, given.provoking),
        soak("pool provoking", run_pool_provoking, given.provoking),
        soak("shot at pockets", run_shot, given.shots),
        soak("game", run_game, 2 * given.breaks),
    ]
    return 0 if all(kept) else 1


if __name__ == "__main__":
    sys.exit(main())
