# SPDX-License-Identifier: Apache-2.0
"""Balls that overlap moved apart, no further than needed: the nearest places where none overlaps.

What is minimised is the sum of the squared displacements of the balls, subject to |x_i - x_j| >= 2 R for each pair and
to the box that the rails leave to the centres. Each round replaces |x_i - x_j| by its part along the present line of
centres, which is never longer: what the round finds is free of overlaps, and its own lines of centres lead the next
round to a nearer place (the convex-concave procedure, Yuille and Rangarajan 2003). A round is a least-squares problem
with linear inequalities and one solution, so the order of the balls does not matter, up to rounding.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

TOUCHING = 1e-10
"""m. Overlap at which balls count as touching: a tenth of what a scene allows."""

SETTLED = 1e-7
"""m. The rounds end when no ball moves by more: far below what a camera sees."""

MOST_ROUNDS = 15
"""A noisy rack takes 4. A row that is too long for its place and has to buckle takes all, and later ones move its balls
by less than a hundredth of their displacements."""

REACH = 1.5
"""In diameters: pairs that are further apart are left out of a round."""

STEP = 0.25
"""In diameters: the furthest that a ball moves in a round, along each axis. Two balls that are left out do not meet."""

STIFFNESS = 1e6
"""What a squared overlap weighs against a squared displacement. The higher, the fewer corrections; 1e6 leaves half the
digits to each."""

MOST_CORRECTIONS = 6
"""Of the multipliers in a round. A long row takes 3; where there is no room, none of any number is enough."""

MOST_NEWTON_STEPS = 60
"""For one correction: each finds more of the pairs that touch in the end, ten or so in a long row."""

EXACT = 1e-12
"""m. By which a round's solution may miss its inequalities: some roundings of a position."""

MOST_NAMES = 8
"""Balls that a refusal names."""


def separated(positions: Floats, low: Floats, high: Floats, diameter: float, names: Sequence[str]) -> Floats:
    """Balls moved apart until none overlap by more than `TOUCHING`, and into the box; those that are free stay.

    Args:
        positions: (N, 2) m.
        low, high: (2,) or (N, 2) m, the box for the centres, or one for each.
        diameter: m.
        names: of the balls.

    Raises:
        ValueError: there is no room, or two balls share one centre. The text names the balls.
    """
    first, second = np.triu_indices(len(positions), 1)
    places = np.clip(positions, low, high)
    _, distances = _lines(places, first, second)
    if not (diameter - distances > TOUCHING).any():
        return places
    if not distances.all():
        one = int(np.argmin(distances))
        raise ValueError(
            f"balls {names[first[one]]!r} and {names[second[one]]!r} share one centre: there is no telling how to "
            "separate them"
        )
    forces = np.zeros(len(first) + 4 * len(positions))  # multipliers of the pairs, and of the balls at the box
    for _ in range(MOST_ROUNDS):
        before = places
        places, forces = _nearer(positions, before, forces, low, high, diameter)
        if np.abs(places - before).max() <= SETTLED:
            break
    _, distances = _lines(places, first, second)
    deep = diameter - distances > TOUCHING
    if deep.any():
        jammed = sorted({*first[deep].tolist(), *second[deep].tolist()})
        told = ", ".join(repr(names[ball]) for ball in jammed[:MOST_NAMES])
        more = f" and {len(jammed) - MOST_NAMES} more" if len(jammed) > MOST_NAMES else ""
        raise ValueError(
            f"no room to separate balls {told}{more}: some still overlap by {diameter - distances.min():.6g} m"
        )
    return places


def _nearer(
    positions: Floats, places: Floats, forces: Floats, low: Floats, high: Floats, diameter: float
) -> tuple[Floats, Floats]:
    # One round: the places nearest to the positions, by the lines of centres at the present places, with its
    # multipliers, which start from those of the round before.
    count = len(positions)
    first, second = np.triu_indices(count, 1)
    normals, distances = _lines(places, first, second)
    near = distances < REACH * diameter
    used = np.concatenate((near, np.ones(4 * count, bool)))
    first, second, normals = first[near], second[near], normals[near]
    pairs = np.arange(len(first))
    rows = np.zeros((len(first), count, 2))
    rows[pairs, first], rows[pairs, second] = normals, -normals
    axes = np.eye(2 * count)
    inequalities = np.concatenate((rows.reshape(len(first), 2 * count), axes, -axes))
    gaps = np.concatenate(
        (
            diameter - np.sum((positions[first] - positions[second]) * normals, axis=1),
            (np.maximum(low, places - STEP * diameter) - positions).ravel(),
            (positions - np.minimum(high, places + STEP * diameter)).ravel(),
        )
    )
    after = np.zeros_like(forces)
    moves, after[used] = shortest(inequalities, gaps, forces[used])
    return np.clip(positions + moves.reshape(count, 2), low, high), after


def shortest(inequalities: Floats, gaps: Floats, start: Floats) -> tuple[Floats, Floats]:
    """The shortest d with A d >= c, and its multipliers, by the method of multipliers (Rockafellar 1973).

    For given multipliers f it minimises |d|^2/2 + s/2 |max(0, c + f/s - A d)|^2, a piecewise quadratic function, by
    Newton steps with an exact line search; then f becomes s max(0, c + f/s - A d).

    Args:
        inequalities: A, (M, D).
        gaps: c, (M,).
        start: multipliers to start from, (M,) >= 0.

    Returns:
        d (D,), exactly 0 where no inequality that holds it back concerns it; and f (M,), 0 where the inequalities
        contradict each other: d is then where the squares of what is missing are least, or close to it.
    """
    forces = start
    moves = forces @ inequalities
    for _ in range(MOST_CORRECTIONS):
        aims = gaps + forces / STIFFNESS
        for _ in range(MOST_NEWTON_STEPS):
            missing = aims - inequalities @ moves
            step = _newton_target(inequalities, aims, missing > 0.0) - moves
            slopes = -(inequalities @ step)
            if np.array_equal(missing + slopes > 0.0, missing > 0.0):
                moves = moves + step
                break
            moves = moves + _best_share(moves, step, missing, slopes) * step
        before, forces = forces, STIFFNESS * np.maximum(aims - inequalities @ moves, 0.0)
        if np.abs(forces - before).max() <= STIFFNESS * EXACT:
            return moves, forces
    return moves, np.zeros_like(forces)


def _newton_target(inequalities: Floats, aims: Floats, active: NDArray[np.bool_]) -> Floats:
    # Where the quadratic function is least that only the active inequalities make.
    held = inequalities[active]
    stiffness = held @ held.T
    stiffness.flat[:: len(held) + 1] += 1.0 / STIFFNESS
    return np.linalg.solve(stiffness, aims[active]) @ held


def _best_share(moves: Floats, step: Floats, missing: Floats, slopes: Floats) -> float:
    # Of the step, at which the piecewise quadratic function is least: its derivative along the step rises piece by
    # piece, and each inequality that begins or ceases to count changes it by its own terms.
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = -missing / slopes
    crossing = np.flatnonzero(np.isfinite(crossings) & (crossings > 0.0))
    crossing = crossing[np.argsort(crossings[crossing], kind="stable")]
    active = missing > 0.0
    sign = np.where(active[crossing], -STIFFNESS, STIFFNESS)
    begin = moves @ step + STIFFNESS * (missing[active] @ slopes[active])
    rise = step @ step + STIFFNESS * (slopes[active] @ slopes[active])
    begins = begin + np.concatenate(([0.0], np.cumsum(sign * missing[crossing] * slopes[crossing])))
    rises = rise + np.concatenate(([0.0], np.cumsum(sign * slopes[crossing] ** 2)))
    ends = np.concatenate((crossings[crossing], [np.inf]))
    zeros = -begins / rises
    return float(zeros[np.argmax(zeros <= ends)])


def _lines(places: Floats, first: NDArray[np.intp], second: NDArray[np.intp]) -> tuple[Floats, Floats]:
    # Of the pairs: unit vectors from the second to the first (0 where they share a centre), and distances.
    apart = places[first] - places[second]
    distances = np.hypot(apart[:, 0], apart[:, 1])
    return apart / np.maximum(distances, np.finfo(float).tiny)[:, np.newaxis], distances
