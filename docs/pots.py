# SPDX-License-Identifier: Apache-2.0
"""How often `plan` pots a ball from random positions, and what geometry allows there; prints the table of docs/pots.md.

What geometry allows is looked for in two ways, both by a grid over all azimuths, speeds and places of the tip, which
knows nothing of pockets or ghost balls. Without errors each shot of it scores 1 or 0. Averaged over the error of the
azimuth, the largest value bounds what any shot of the grid can reach: errors of speed and tip lead from shot to shot of
it, each of which is worth no more. The best of the grid, with all errors, are what an exhaustive search finds.
"""

from __future__ import annotations

import argparse
import math
from typing import Any, NamedTuple

import numpy as np

import billiards_sim as bs
from billiards_sim.engine.potting import pots
from billiards_sim.engine.record import record
from billiards_sim.engine.shot_kind import cut_of

Array = np.ndarray[Any, np.dtype[np.float64]]

NOISE = bs.ShooterNoise.tournament()
ENOUGH = 0.9

SPEEDS = np.geomspace(0.7, 5.0, 8)
TIPS = [(side, up) for side in (-0.2, 0.0, 0.2) for up in (-0.35, 0.0, 0.35)]
"""m/s, and side and up in radii, of the grid."""

KEPT = 4
"""Azimuths of the grid that are played with errors, for each speed and place of the tip."""

SAMPLES = (40, 400, 4000)
"""Of what is kept, of the best twentieth of these, and of the best of all."""


class Grid(NamedTuple):
    """What an exhaustive search of a position found."""

    bound: float  # of the probability, by the error of the azimuth alone
    best: float  # probability with all errors
    played: int


def positions(count: int, seed: int) -> list[bs.Scene]:
    """Two balls anywhere on a 9 ft pool table, but in no pocket and not in each other."""
    table, physics = bs.Table.pool_9ft(), bs.Physics.pool()
    low = np.array((table.x_min, table.y_min)) + physics.radius
    high = np.array((table.x_max, table.y_max)) - physics.radius
    random = np.random.default_rng(seed)
    found: list[bs.Scene] = []
    while len(found) < count:
        try:
            found.append(bs.Scene(random.uniform(low, high, (2, 2)), table=table, physics=physics))
        except ValueError:
            continue
    return found


def searched(scene: bs.Scene, goal: Any, step: float) -> Grid:
    """All that a grid knows, with azimuths about `step` rad apart."""
    azimuths = np.linspace(0.0, math.tau, round(math.tau / step), endpoint=False)
    shots, values = [], []
    for side, up in TIPS:
        for speed in SPEEDS.tolist():
            smooth = averaged(goal(bs.rollout(scene, bs.Shots(speed, azimuths, side, up))), azimuths[1])
            for index in apart(np.argsort(-smooth)[: 20 * KEPT + 200], azimuths):
                shots.append((speed, azimuths[index], side, up))
                values.append(smooth[index])
    played = len(TIPS) * len(SPEEDS) * len(azimuths)
    kept = np.array(shots)
    worth = np.array(values)
    for samples in SAMPLES:
        worth = noisy(scene, goal, kept, samples)
        kept = kept[np.argsort(-worth)[: max(len(kept) // 20, 1)]]
        played += len(worth) * samples
    return Grid(max(values), float(worth.max()), played)


def averaged(scores: Array, step: float) -> Array:
    """Scores all round, each averaged over the error of the azimuth."""
    reach = math.ceil(5.0 * NOISE.azimuth / step)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / NOISE.azimuth) ** 2)
    return np.convolve(np.concatenate((scores[-reach:], scores, scores[:reach])), weights / weights.sum(), "valid")


def apart(order: Any, azimuths: Array) -> list[int]:
    """The first ones that errors do not blur."""
    found: list[int] = []
    for index in order.tolist():
        if all(abs(math.remainder(azimuths[index] - azimuths[one], math.tau)) > NOISE.azimuth for one in found):
            found.append(index)
    return found[:KEPT]


def noisy(scene: bs.Scene, goal: Any, shots: Array, samples: int) -> Array:
    """(M,) how probably shots, (M, 4), succeed; by errors that no search has seen."""
    score = goal(bs.rollout(scene, bs.Shots(*shots.T), noise=NOISE, samples=samples, seed=10_000 + samples))
    return score.mean(axis=-1)


def row(number: int, scene: bs.Scene, arguments: argparse.Namespace) -> tuple[str, bool, bool]:
    """Of the table; whether the plan is good enough, and whether the grid has a shot that is."""
    goal = bs.goals.pocket(scene, "1")
    found = bs.search(scene, goal, noise=NOISE, budget=arguments.budget)
    shot = found.shots.columns()[0, :4]
    success = float(noisy(scene, goal, shot[np.newaxis], SAMPLES[-1])[0])
    simulation = bs.Simulation(scene)
    simulation.shoot(*shot[:2].tolist(), side=float(shot[2]), up=float(shot[3]))
    run = record(simulation)
    kind = goal.way(run.events)
    (cue, ball), mouths = scene.positions, {mouth.name: mouth for mouth in scene.table.mouths}
    hit = next((event.time for event in run.events if event.kind == "ball_ball"), math.nan)
    way = (
        math.nan
        if math.isnan(hit)
        else float(np.hypot(*np.diff(run.path("cue")[:, 1:][run.path("cue")[:, 0] <= hit], axis=0).T).sum())
    )
    to_pocket = (
        math.dist(ball, np.array(mouths[kind.pocket].centre) + scene.table.centre)
        if kind.pocket in mouths
        else math.nan
    )
    ghost = max((one.probability(NOISE.azimuth) for one in pots(scene, "1")), default=0.0)
    grid = searched(scene, goal, arguments.step)
    why = ""
    if success < ENOUGH:
        why = "azimuth alone" if grid.bound < ENOUGH else "all errors together" if grid.best < ENOUGH else "missed"
    cells = (
        f"{number}",
        f"{cue[0]:.3f} {cue[1]:.3f}",
        f"{ball[0]:.3f} {ball[1]:.3f}",
        f"{kind.kind}, {kind.pocket}",
        f"{math.degrees(cut_of(run)):.0f}",
        f"{way:.2f}",
        f"{to_pocket:.2f}",
        f"{shot[0]:.2f}",
        *(f"{100.0 * value:.1f}" for value in (success, ghost, grid.bound, grid.best)),
        why,
    )
    return f"| {' | '.join(cells)} |", success >= ENOUGH, grid.best >= ENOUGH


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--positions", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--step", type=float, default=4e-4, help="rad between azimuths of the grid")
    parser.add_argument("--budget", type=int, default=300_000, help="of the search")
    arguments = parser.parse_args()
    print(
        "| | cue ball | ball 1 | plan | cut | way | to pocket | speed | success | ghost ball | bound | grid | limit |"
    )
    print("|--:|---|---|---|--:|--:|--:|--:|--:|--:|--:|--:|---|", flush=True)
    good = possible = 0
    for number, scene in enumerate(positions(arguments.positions, arguments.seed), 1):
        text, is_good, is_possible = row(number, scene, arguments)
        print(text, flush=True)
        good += is_good
        possible += is_possible
    print(f"\n{good} of {arguments.positions} with 90 % or more by the plan, {possible} by the grid.")


if __name__ == "__main__":
    main()
