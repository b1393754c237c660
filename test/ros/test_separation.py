# SPDX-License-Identifier: Apache-2.0
import re

import numpy as np
import pytest

import billiards_sim as bs
from billiards_sim.ros.separation import TOUCHING, separated

RADIUS = bs.Physics().radius
DIAMETER = 2.0 * RADIUS
TABLE = bs.Table()
LOW = np.array([TABLE.x_min, TABLE.y_min]) + RADIUS
HIGH = np.array([TABLE.x_max, TABLE.y_max]) - RADIUS


def apart(points: np.ndarray) -> np.ndarray:
    """The points where the table's balls come to lie."""
    names = [str(number) for number in range(len(points))]
    found = separated(points, LOW, HIGH, DIAMETER, names)
    bs.Scene(found)  # which checks overlaps and rails
    assert distances(found).min() >= DIAMETER - TOUCHING
    return found


def distances(points: np.ndarray) -> np.ndarray:
    return np.hypot(*(points[:, np.newaxis] - points).T)[np.triu_indices(len(points), 1)]


def row(count: int, overlap: float = 0.0, start: np.ndarray = LOW) -> np.ndarray:
    """Along x, from a place on."""
    return start + np.outer(np.arange(count), (DIAMETER - overlap, 0.0))


def turned(points: np.ndarray, angle: float) -> np.ndarray:
    cos, sin = np.cos(angle), np.sin(angle)
    return points @ np.array([[cos, sin], [-sin, cos]])


def noisy(points: np.ndarray, size: float, seed: int) -> np.ndarray:
    return np.clip(points + np.random.default_rng(seed).uniform(-size, size, points.shape), LOW, HIGH)


def in_a_line(places: np.ndarray, low: float) -> np.ndarray:
    """The least squares solution for balls on a line behind a rail: with the diameters taken out the places have to
    rise, and neighbours that would not share their mean (pool adjacent violators, Ayer and others 1955)."""
    taken_out = np.arange(len(places)) * DIAMETER
    pools: list[list[float]] = []
    for place in places - taken_out:
        pools.append([place])
        while len(pools) > 1 and np.mean(pools[-2]) >= np.mean(pools[-1]):
            last = pools.pop()
            pools[-1] += last
    return np.maximum(np.concatenate([np.full(len(pool), np.mean(pool)) for pool in pools]), low) + taken_out


@pytest.mark.parametrize("overlap", [1e-9, 1e-6, 1e-3, 1.9e-3])
@pytest.mark.parametrize("count", [2, 16, 22])
def test_a_row_from_a_corner_ends_one_diameter_after_the_other(count: int, overlap: float) -> None:
    assert apart(row(count, overlap)) == pytest.approx(row(count), abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_free_row_spreads_evenly_about_its_middle(angle: float) -> None:
    squeezed = turned(row(22, 1e-3, np.zeros(2)), angle) + (0.5, 0.3)
    wanted = turned(row(22, 0.0, np.zeros(2)), angle)
    wanted += squeezed.mean(axis=0) - wanted.mean(axis=0)
    assert apart(squeezed) == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_a_straight_row_with_random_gaps_ends_at_the_least_squares_solution(seed: int) -> None:
    gaps = np.random.default_rng(seed).uniform(-0.001, 0.001, 22)
    start = np.column_stack([LOW[0] - 0.001 + np.cumsum(DIAMETER + gaps) - DIAMETER, np.full(22, 0.6)])
    wanted = np.column_stack([in_a_line(start[:, 0], LOW[0]), start[:, 1]])
    assert apart(start) == pytest.approx(wanted, abs=1e-9)


def test_balls_that_are_free_stay_to_the_bit() -> None:
    free = np.array([[0.3, 0.3], [0.4, 0.9], [2.0, 0.5]])
    start = np.concatenate([free, row(5, 1e-3, np.array([1.0, 0.6]))])
    assert np.array_equal(apart(start)[:3], free)


def test_two_rows_into_a_corner_share_its_ball() -> None:
    along_y = LOW + np.outer(np.arange(1, 11), (0.0, DIAMETER - 1e-4))
    found = apart(np.concatenate([row(12, 1e-4), along_y]))
    assert found[:12] == pytest.approx(row(12), abs=1e-9)
    assert found[12:] == pytest.approx(LOW + np.outer(np.arange(1, 11), (0.0, DIAMETER)), abs=1e-9)


def test_a_full_table_corner_of_rows_spreads_from_the_corner() -> None:
    squares = np.array([(column, line) for column in range(5) for line in range(4)]) * DIAMETER
    assert apart(LOW + 0.98 * squares) == pytest.approx(LOW + squares, abs=1e-9)


RACK = bs.scenes.rack(0.0).positions
NOISY = {
    "rack": RACK,
    "rack in a corner": RACK - RACK.min(axis=0) + LOW,
    "row of 22 along a rail": row(22),
    "row of 22 in the open": row(22, 0.0, np.array([0.4, 0.6])),
    "row of 20 from rail to rail": turned(row(20, 0.0, np.zeros(2)), np.pi / 2) + LOW,
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("case", NOISY)
def test_noise_is_taken_out_by_displacements_of_its_own_size(case: str, seed: int) -> None:
    start = noisy(NOISY[case], 0.0007, seed)
    moves = np.linalg.norm(apart(start) - start, axis=1)
    # The places without noise are free of overlaps, so the nearest ones cannot be further off in the mean square.
    assert 0.0 < np.linalg.norm(moves) <= np.linalg.norm(NOISY[case] - start)


@pytest.mark.parametrize("case", NOISY)
def test_no_place_that_scipy_finds_is_nearer(case: str) -> None:
    optimize = pytest.importorskip("scipy.optimize")
    start = noisy(NOISY[case], 0.0005, 1)
    first, second = np.triu_indices(len(start), 1)
    near = np.hypot(*(start[first] - start[second]).T) < 1.3 * DIAMETER
    first, second = first[near], second[near]
    pairs = np.arange(len(first))

    def lines(moves: np.ndarray) -> np.ndarray:
        places = start + moves.reshape(-1, 2) / 1000.0
        return (places[first] - places[second]) / DIAMETER

    def room(moves: np.ndarray) -> np.ndarray:
        return np.linalg.norm(lines(moves), axis=1) - 1.0

    def slopes(moves: np.ndarray) -> np.ndarray:
        units = lines(moves)
        units /= 1000.0 * DIAMETER * np.linalg.norm(units, axis=1, keepdims=True)
        rows = np.zeros((len(pairs), len(start), 2))
        rows[pairs, first], rows[pairs, second] = units, -units
        return rows.reshape(len(pairs), -1)

    found = optimize.minimize(  # moves in mm
        lambda moves: 0.5 * np.sum(moves**2),
        np.zeros(start.size),
        jac=lambda moves: moves,
        method="SLSQP",
        bounds=list(zip((1000.0 * (LOW - start)).ravel(), (1000.0 * (HIGH - start)).ravel())),
        constraints={"type": "ineq", "fun": room, "jac": slopes},
        options={"ftol": 1e-12, "maxiter": 200},
    )
    assert found.success
    assert apart(start) == pytest.approx(start + found.x.reshape(-1, 2) / 1000.0, abs=1e-6)


@pytest.mark.parametrize("case", NOISY)
def test_the_order_of_the_balls_does_not_matter(case: str) -> None:
    start = noisy(NOISY[case], 0.0007, 3)
    order = np.random.default_rng(3).permutation(len(start))
    assert apart(start[order]) == pytest.approx(apart(start)[order], abs=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_a_noisy_row_that_is_too_long_for_the_table_buckles(seed: int) -> None:
    count = 21  # 20 fit between the long rails
    middle = np.column_stack([np.full(count, 1.0), np.linspace(LOW[1], HIGH[1], count)])
    start = noisy(middle, 2e-4, seed)
    moves = np.linalg.norm(apart(start) - start)
    # Of a zigzag each ball goes half of what neighbours are apart across the row, s along it; where two neighbours go
    # the same way it is a little more.
    spacing = (HIGH[1] - LOW[1]) / (count - 1)
    zigzag = 0.5 * (count * (DIAMETER**2 - spacing**2)) ** 0.5
    assert 0.9 * zigzag < moves < 1.1 * zigzag


def test_a_row_with_too_little_room_is_refused_by_name() -> None:
    line = row(3, 0.001, np.array([LOW[0], 0.5]))
    others = np.array([[LOW[0] + 0.01, 1.0]])
    with pytest.raises(
        ValueError, match=re.escape("no room to separate balls 'a', 'b', 'c': some still overlap by 0.00")
    ):
        separated(np.concatenate([line, others]), line[0] * [1, 0], line[-1] * [1, 3], DIAMETER, ["a", "b", "c", "d"])
    with pytest.raises(ValueError, match=re.escape("'0', '1', '2', '3', '4', '5', '6', '7' and 13 more: some")):
        straight = np.column_stack([np.full(21, LOW[0]), np.linspace(LOW[1], HIGH[1], 21)])
        apart(straight)  # nothing says to which side it should buckle


def test_balls_at_one_place_are_refused_by_name() -> None:
    with pytest.raises(ValueError, match="balls 'b' and 'c' share one centre"):
        separated(np.array([[0.5, 0.5], [1.0, 0.5], [1.0, 0.5]]), LOW, HIGH, DIAMETER, ["a", "b", "c"])
