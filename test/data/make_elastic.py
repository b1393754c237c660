# SPDX-License-Identifier: Apache-2.0
"""Reference solutions of elastic contacts: Hertz' law integrated by brute force, all contacts at once.

Independent of the engine it is meant to check: no shared code, only the same physical model. NumPy alone.

    make_elastic.py OUT.json              integrate the cases below and write them (half an hour)
    make_elastic.py --verify FILE.json    integrate a file's cases again and print the largest differences
    make_elastic.py --truth OUT.json      integrate the racks that `benchmark` measures errors against:
                                          billiards_sim/study/elastic.json
    make_elastic.py --figures             print the figures that the law is known by
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

MODEL = """\
Two balls give by d = 2R - |x1 - x2| and push each other apart with F = K d^1.5 + c d^0.25 d' while d > 0, where
K = 4/3 E* sqrt(R/2), E* = E/(2 (1 - nu^2)), and c = alpha sqrt(m_eff K), alpha = -sqrt(5) ln e/sqrt(ln^2 e + pi^2)
(Tsuji, Tanaka, Ishida 1992; tension is kept, so F < 0 before the contact ends at d = 0). m_eff = m/2.
A rail is a plane with the same K, its own e and m_eff = m: d = R - distance of the centre from the plane.
Friction of two balls: T = mu F against the slip s = (v1 - v2)_t - R (w1 + w2) x n, n from the second to the first,
mu = a + b exp(-c s) taken when the contact begins; made smooth, T = mu F s/sqrt(s^2 + q^2) with a small q. Both balls
take a turn of the same sense. A ball keeps the vertical velocity that friction gives it while it has a contact, and
loses it then; it never leaves the plane. The cloth does nothing.
"""

ABOUT = """\
Balls that push each other by `model`, integrated by brute force. `law` holds for every case but for what the case's own
`law` says. State at `time` in s, m, m/s and rad/s; rails are (normal x, normal y, offset). `in_contact`: balls that are
pressed at the end, to be left out of comparisons. `error`: the largest difference of two solutions, of what is free, in
m, m/s and, for spins times R, m/s. `clusters` and `sweep` are rows of whole numbers, their units in `cluster_columns`
and `sweep_columns`, all with the law as it is. A row of `sweep` is a rack of that gap, at 8 m/s 4 mm beside the middle.
"""

MASS, RADIUS = 0.16, 0.028575  # kg, m
YOUNGS_MODULUS, POISSON_RATIO = 5.8e9, 0.34  # Pa; phenolic resin
RACK_AIM = 4e-3  # m, of the racks that differ in the law
LONGEST_WAY = 3e-5  # m, of the fastest ball in a step: a tenth of how far balls give, and no touch goes unseen
WAY_TO_TOUCH = 0.25  # of the least gap, where that is further and nothing is pressed
TOLERANCES = (1e-12, 1e-13)  # m/s a step: the first gives the error of the second
COARSE_TOLERANCES = (
    1e-9,
    1e-10,
)  # with friction, whose error is another's, and of what is told in micrometres a second
SLIP_SCALES = (3e-4, 1e-4)  # m/s: q, of the two solutions with friction
CUE_GAP = 1e-5  # m, of the cue ball from the rack at the start
CLUSTERS = 500
SWEEP, SWEEP_TIME = 100, 0.004  # steps of the gap from 0 to 0.5 mm; s
DIGITS = 12  # of what is written
NO_RAILS: Array = np.zeros((0, 3))
SAME_AS_ERROR = 1e-4  # s: an error in position counts as one in velocity over this time


@dataclass(frozen=True)
class Law:
    """What bodies are made of; SI units. `friction` is (a, b, c) of mu = a + b exp(-c s)."""

    youngs_modulus: float = YOUNGS_MODULUS
    poisson_ratio: float = POISSON_RATIO
    mass: float = MASS
    radius: float = RADIUS
    ball_restitution: float = 1.0
    rail_restitution: float = 0.7
    friction: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def stiffness(self) -> float:
        """K, N/m^1.5."""
        return 4 / 3 * self.youngs_modulus / (2 * (1 - self.poisson_ratio**2)) * math.sqrt(self.radius / 2)

    def damping(self, restitution: float, effective_mass: float) -> float:
        """c, N s/m^1.25."""
        log = math.log(restitution)
        alpha = -math.sqrt(5) * log / math.hypot(log, math.pi)
        return alpha * math.sqrt(effective_mass * self.stiffness)


@dataclass(frozen=True)
class Outcome:
    """Balls at the end; `energies` are those at the start and at the end, J.

    Attributes:
        in_contact: (N,), of each ball: it is pressed against a ball or a rail.
    """

    positions: Array
    velocities: Array
    spins: Array
    in_contact: npt.NDArray[np.bool_]
    energies: tuple[float, float]
    steps: int


# Dormand and Prince 1980, order 5 with an embedded solution of order 4; the last stage is the next step's first.
STAGES = [
    np.array(row)
    for row in (
        [1 / 5],
        [3 / 40, 9 / 40],
        [44 / 45, -56 / 15, 32 / 9],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    )
]
ERROR_WEIGHTS = np.array(
    [71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40],
)


class Bodies:
    """N balls and their rails under a `Law`; the state is (3, N, 3): positions, velocities, spins.

    Args:
        law: of all of them.
        count: N.
        rails: (M, 3): unit normal into the table and offset, n . x = offset at the rail's nose.
        slip_scale: m/s, q of `MODEL`.
    """

    def __init__(self, law: Law, count: int, rails: Array, slip_scale: float) -> None:
        self.law = law
        self.first, self.second = np.triu_indices(count, 1)
        self.rails = rails
        self.slip_scale = slip_scale
        self.ball_damping = law.damping(law.ball_restitution, law.mass / 2)
        self.rail_damping = law.damping(law.rail_restitution, law.mass)
        self.rough = any(law.friction[:2])
        self.frozen_friction = np.full(self.first.size, np.nan)  # mu, of each pair that is in contact

    def depths(self, state: Array) -> tuple[Array, Array]:
        """Return by how much each pair, (P,), and each ball with each rail, (N, M), is pressed, m; < 0 is a gap."""
        apart = state[0, self.first, :2] - state[0, self.second, :2]
        pairs = 2 * self.law.radius - np.hypot(apart[:, 0], apart[:, 1])
        return pairs, self.law.radius - (state[0, :, :2] @ self.rails[:, :2].T - self.rails[:, 2])

    def rate(self, state: Array) -> Array:
        """Return the time derivative of a state."""
        law = self.law
        _, velocities, spins = state
        rates = np.zeros_like(state)
        rates[0, :, :2] = velocities[:, :2]
        pair_depths, rail_depths = self.depths(state)
        touching = np.flatnonzero(pair_depths > 0)
        if touching.size:
            one, two, depth = self.first[touching], self.second[touching], pair_depths[touching]
            apart = state[0, one] - state[0, two]
            normal = apart / (2 * law.radius - depth)[:, None]
            relative = velocities[one] - velocities[two]
            opening = (relative * normal).sum(axis=1)
            force = law.stiffness * depth**1.5 - self.ball_damping * depth**0.25 * opening
            push = force[:, None] * normal
            if self.rough:
                slip = relative - opening[:, None] * normal
                slip -= law.radius * np.cross(spins[one] + spins[two], normal)
                friction = -(self.friction(slip, touching) * force)[:, None] * self.direction(slip)
                push += friction
                # -R n x T acts on both: the contact lies at -R n from the first, and the other takes -T.
                turn = -law.radius * np.cross(normal, friction) / (0.4 * law.mass * law.radius**2)
                np.add.at(rates[2], one, turn)
                np.add.at(rates[2], two, turn)
            np.add.at(rates[1], one, push / law.mass)
            np.subtract.at(rates[1], two, push / law.mass)
        for ball, rail in zip(*np.nonzero(rail_depths > 0), strict=True):
            depth, normal = rail_depths[ball, rail], self.rails[rail, :2]
            opening = velocities[ball, :2] @ normal
            force = law.stiffness * depth**1.5 - self.rail_damping * depth**0.25 * opening
            rates[1, ball, :2] += force * normal / law.mass
        return rates

    def coefficient(self, slip: Array) -> Array:
        """Return mu of slips, (P, 3)."""
        a, b, c = self.law.friction
        return a + b * np.exp(-c * np.linalg.norm(slip, axis=1))

    def friction(self, slip: Array, touching: npt.NDArray[np.intp]) -> Array:
        """Return mu of the pairs in contact: of the first slip, or of this one where the contact has just begun."""
        frozen = self.frozen_friction[touching]
        return np.where(np.isnan(frozen), self.coefficient(slip), frozen)

    def direction(self, slip: Array) -> Array:
        """Return slips over their length, smoothly 0 where there is none."""
        return slip / np.sqrt((slip**2).sum(axis=1, keepdims=True) + self.slip_scale**2)

    def end_step(self, state: Array) -> None:
        """Keep mu of contacts that begin, forget that of those that end, drop vertical velocities of what is free."""
        if not self.rough:
            return
        pair_depths, _ = self.depths(state)
        touching = pair_depths > 0
        self.frozen_friction[~touching] = np.nan
        new = np.flatnonzero(touching & np.isnan(self.frozen_friction))
        one, two = self.first[new], self.second[new]
        normal = (state[0, one] - state[0, two]) / (2 * self.law.radius - pair_depths[new])[:, None]
        relative = state[1, one] - state[1, two]
        slip = relative - (relative * normal).sum(axis=1, keepdims=True) * normal
        slip -= self.law.radius * np.cross(state[2, one] + state[2, two], normal)
        self.frozen_friction[new] = self.coefficient(slip)
        state[1, ~self.in_contact(state), 2] = 0.0

    def longest_step(self, state: Array) -> float:
        """Return how long a step may be, s, so that no touch goes unseen."""
        gaps = -np.concatenate([depths.ravel() for depths in self.depths(state)])
        way = LONGEST_WAY if (gaps < 0).any() else max(LONGEST_WAY, WAY_TO_TOUCH * gaps.min())
        return float(way / (np.hypot(state[1, :, 0], state[1, :, 1]).max() + 1e-300))

    def in_contact(self, state: Array) -> npt.NDArray[np.bool_]:
        """Return which balls are pressed, (N,)."""
        pair_depths, rail_depths = self.depths(state)
        pressed = (rail_depths > 0).any(axis=1)
        pressed[self.first[pair_depths > 0]] = True
        pressed[self.second[pair_depths > 0]] = True
        return pressed

    def energy(self, state: Array) -> float:
        """Return kinetic and elastic energy, J."""
        law = self.law
        elastic = sum(float((np.maximum(depths, 0.0) ** 2.5).sum()) for depths in self.depths(state))
        kinetic = law.mass / 2 * (state[1] ** 2).sum() + 0.2 * law.mass * law.radius**2 * (state[2] ** 2).sum()
        return float(kinetic + 0.4 * law.stiffness * elastic)


def integrate(
    law: Law,
    positions: npt.ArrayLike,
    velocities: npt.ArrayLike,
    time: float,
    *,
    spins: npt.ArrayLike | None = None,
    rails: npt.ArrayLike = (),
    tolerance: float = TOLERANCES[1],
    slip_scale: float = SLIP_SCALES[1],
) -> Outcome:
    """Integrate balls for `time`, s: Dormand and Prince's method, the step chosen by its error.

    Args:
        law: of all bodies.
        positions: (N, 2) m.
        velocities: (N, 2) m/s.
        time: s.
        spins: (N, 3) rad/s; none where omitted.
        rails: (M, 3): unit normal into the table and offset of the nose.
        tolerance: m/s, the error of a step.
        slip_scale: m/s: friction is smooth below it.
    """
    state = np.zeros((3, len(np.asarray(positions)), 3))
    state[0, :, :2], state[1, :, :2] = positions, velocities
    if spins is not None:
        state[2] = spins
    bodies = Bodies(law, state.shape[1], np.reshape(np.asarray(rails, dtype=float), (-1, 3)), slip_scale)
    scale = np.array([SAME_AS_ERROR, 1.0, 1 / law.radius])[:, None, None] * tolerance
    first_energy = bodies.energy(state)
    bodies.end_step(state)
    stages = np.zeros((7, *state.shape))
    stages[0] = bodies.rate(state)
    now, step, count = 0.0, 1e-8, 0
    while now < time:
        step = min(step, bodies.longest_step(state), time - now)
        for stage, weights in enumerate(STAGES, 1):
            trial = state + step * np.tensordot(weights, stages[:stage], 1)
            stages[stage] = bodies.rate(trial)
        error = float(np.max(np.abs(step * np.tensordot(ERROR_WEIGHTS, stages, 1)) / scale))
        if error <= 1.0:
            now += step
            count += 1
            state = trial
            bodies.end_step(state)
            stages[0] = bodies.rate(state)
        step *= min(5.0, max(0.2, 0.9 * max(error, 1e-10) ** -0.2))
    return Outcome(
        state[0, :, :2],
        state[1, :, :2],
        state[2],
        bodies.in_contact(state),
        (first_energy, bodies.energy(state)),
        count,
    )


def rack(gap: float, aim: float) -> tuple[Array, Array]:
    """Return positions and velocities, (16, 2), of a cue ball at 8 m/s just before it meets 15 balls.

    Args:
        gap: m, between neighbours of the rack.
        aim: m, how far beside the middle of the first ball the cue ball is aimed.
    """
    pitch = 2 * RADIUS + gap
    balls = [(row * pitch * math.sqrt(0.75), (k - row / 2) * pitch) for row in range(5) for k in range(row + 1)]
    reach = 2 * RADIUS + CUE_GAP
    positions = np.array([(-math.sqrt(reach**2 - aim**2), aim), *balls])
    velocities = np.zeros_like(positions)
    velocities[0, 0] = 8.0
    return positions, velocities


def line(count: int, gap: float, speed: float) -> tuple[Array, Array]:
    """Return positions and velocities, (count, 2), of balls in line, `gap` m apart, the first at `speed` m/s."""
    positions, velocities = np.zeros((2, count, 2))
    positions[:, 0] = np.arange(count) * (2 * RADIUS + gap)
    velocities[0, 0] = speed
    return positions, velocities


def pair(speed: float, angle: float) -> tuple[Array, Array]:
    """Return a ball that meets one at rest, the line of centres turned by `angle`, rad, against its path."""
    positions = np.array([[0.0, 0.0], [math.cos(angle), math.sin(angle)]]) * (2 * RADIUS + 1e-6)
    return positions, np.array([[speed, 0.0], [0.0, 0.0]])


def cluster(seed: int) -> tuple[Array, Array]:
    """Return positions and velocities, (N, 2), of 3 to 6 balls that are about to meet, at 0.5 to 10 m/s.

    Balls lie one after the other beside one of those before, with a gap of 1 um to 10 mm; the last comes at one of
    them, half of the time with the others moving too. Coordinates are whole micrometres, velocities whole mm/s.
    """
    random = np.random.default_rng(seed)
    count = int(random.integers(3, 7))
    balls = [np.zeros(2)]
    while len(balls) < count:
        angle = random.uniform(0, 2 * math.pi)
        distance = 2 * RADIUS + 10 ** random.uniform(-6, -2)
        place = balls[random.integers(len(balls))] + distance * np.array([math.cos(angle), math.sin(angle)])
        if min(math.dist(place, ball) for ball in balls) > 2 * RADIUS + 1e-6:
            balls.append(place)
    positions = np.round(balls, 6)
    speed = 10 ** random.uniform(math.log10(0.5), 1)
    velocities = np.zeros((count, 2))
    if random.random() < 0.5:
        velocities = speed * random.uniform(-0.3, 0.3, (count, 2))
    aim = positions[random.integers(count - 1)] + random.uniform(-RADIUS, RADIUS, 2) - positions[-1]
    velocities[-1] = speed * aim / math.hypot(*aim)
    return positions, np.round(velocities, 3)


def solve(
    law: Law,
    positions: Array,
    velocities: Array,
    time: float,
    *,
    rails: Array = NO_RAILS,
    spins: Array | None = None,
    tolerances: tuple[float, float] = TOLERANCES,
) -> dict[str, Any]:
    """Integrate a case twice; return its end and `error`: the largest difference of the two among the free balls."""
    rough = any(law.friction[:2])
    coarse, fine = (
        integrate(
            law, positions, velocities, time, spins=spins, rails=rails, tolerance=tolerance, slip_scale=slip_scale
        )
        for tolerance, slip_scale in zip(COARSE_TOLERANCES if rough else tolerances, SLIP_SCALES, strict=True)
    )
    free = ~(coarse.in_contact | fine.in_contact)
    differences = [coarse.positions - fine.positions, coarse.velocities - fine.velocities]
    differences.append(RADIUS * (coarse.spins - fine.spins))
    error = (
        max((float(np.abs(difference[free]).max()) for difference in differences), default=0.0) if free.any() else 0.0
    )
    result = {
        "final_positions": np.round(fine.positions, DIGITS).tolist(),
        "final_velocities": np.round(fine.velocities[:, :2], DIGITS).tolist(),
        "in_contact": np.flatnonzero(~free).tolist(),
        "error": float(f"{error:.1e}"),
    }
    if rough:
        result["final_angular_velocities"] = np.round(fine.spins, DIGITS).tolist()
    return result


def case(
    name: str,
    balls: tuple[Array, Array],
    law: Law,
    time: float = 0.002,
    rails: Sequence[Sequence[float]] = (),
    spins: Array | None = None,
) -> dict[str, Any]:
    """Return a case with its solution, as it is written."""
    positions, velocities = balls
    what = {name: value for name, value in asdict(law).items() if value != asdict(Law())[name]}
    given: dict[str, Any] = {
        "name": name,
        "law": what,
        "time": time,
        "positions": positions.tolist(),
        "velocities": velocities.tolist(),
    }
    if rails:
        given["rails"] = rails
    if spins is not None:
        given["angular_velocities"] = spins.tolist()
    rails_array = np.reshape(np.array(rails, dtype=float), (-1, 3))
    return given | solve(law, positions, velocities, time, rails=rails_array, spins=spins)


def rack_cases() -> Iterator[dict[str, Any]]:
    """Solve racks of several gaps, the cue ball aimed at several places."""
    for gap in (0.0, 5e-5, 1e-4, 3e-4, 1e-3):
        for aim in (0.0, 4e-3, -11.3e-3, 25e-3):
            name = f"rack, gaps {gap * 1e3:g} mm, aim {aim * 1e3:g} mm"
            yield {"gap": gap} | case(name, rack(gap, aim), Law())


def cases() -> Iterator[dict[str, Any]]:
    """Solve all cases but the clusters."""
    hard = Law()
    for count in (3, 4, 5):
        for gap in (0.0, 5e-5):
            yield case(f"{count} in line, gaps {gap * 1e3:g} mm", line(count, gap, 3.0), hard)
    yield from rack_cases()
    for restitution in (0.8, 0.95):
        for gap in (0.0, 5e-5):
            law = replace(hard, ball_restitution=restitution)
            yield case(f"rack, gaps {gap * 1e3:g} mm, restitution {restitution:g}", rack(gap, RACK_AIM), law)
    for restitution in (0.8, 0.9, 0.95, 0.98, 1.0):
        for speed in (0.02, 0.2, 2.0, 10.0):
            law = replace(hard, ball_restitution=restitution)
            for angle in (0.0, 0.7):
                name = f"pair, restitution {restitution:g}, {speed:g} m/s, {angle:g} rad"
                yield case(name, pair(speed, angle), law, 0.002 + 4e-5 / speed)
    for speed in (0.5, 3.0, 8.0):
        balls = np.array([[3 * RADIUS, 0.0], [RADIUS, 0.0]]), np.array([[-speed, 0.0], [0.0, 0.0]])
        yield case(f"ball frozen to a rail, {speed:g} m/s", balls, hard, 0.003, [[1.0, 0.0, 0.0]])
        balls = np.array([[RADIUS + 1e-6, 0.0]]), np.array([[-speed, 0.4 * speed]])
        yield case(f"rail, {speed:g} m/s", balls, hard, 0.003, [[1.0, 0.0, 0.0]])
    for youngs_modulus in (1e9, 3e10):
        yield case(f"rack, E {youngs_modulus:g} Pa", rack(5e-5, RACK_AIM), replace(hard, youngs_modulus=youngs_modulus))
    pool = Law(mass=0.17, ball_restitution=0.95, friction=(9.951e-3, 0.108, 1.088))
    for speed, angle, spin in (
        (1.0, 0.5, (0.0, 0.0, 0.0)),
        (3.0, 0.1, (0.0, 0.0, 0.0)),
        (8.0, 1.0, (0.0, 0.0, 0.0)),
        (3.0, 0.5, (0.0, 100.0, 20.0)),
        (1.0, 0.0, (0.0, 30.0, 0.0)),
    ):
        name = f"friction, pair, {speed:g} m/s, {angle:g} rad, spin {spin}"
        yield case(name, pair(speed, angle), pool, spins=np.array([spin, (0.0, 0.0, 0.0)]))
    for gap in (0.0, 5e-5):
        yield case(f"friction, rack, gaps {gap * 1e3:g} mm", rack(gap, RACK_AIM), pool, spins=np.zeros((16, 3)))


def cluster_cases() -> Iterator[dict[str, Any]]:
    """Solve the clusters."""
    for seed in range(CLUSTERS):
        positions, velocities = cluster(seed)
        time = float(f"{0.002 + 0.03 / np.hypot(*velocities.T).max():.3g}")
        yield {
            "time": time,
            "positions": positions.tolist(),
            "velocities": velocities.tolist(),
            **solve(Law(), positions, velocities, time, tolerances=COARSE_TOLERANCES),
        }


CLUSTER_COLUMNS = {  # of a row: the unit that makes whole numbers of it
    "time": 1e-6,
    "positions": 1e-6,
    "velocities": 1e-3,
    "final_velocities": 1e-6,
    "in_contact": 1,
}


SWEEP_COLUMNS = {"gap": 1e-6, "time": 1e-6, "final_velocities": 1e-6, "in_contact": 1}


def sweep_cases() -> Iterator[dict[str, Any]]:
    """Solve racks with gaps of 0 to 0.5 mm."""
    for gap in np.arange(SWEEP + 1) * (5e-4 / SWEEP):
        positions, velocities = rack(gap, RACK_AIM)
        found = solve(Law(), positions, velocities, SWEEP_TIME, tolerances=COARSE_TOLERANCES)
        yield {"gap": gap, "time": SWEEP_TIME} | found


def row_of(one: dict[str, Any], columns: dict[str, float]) -> list[Any]:
    """Return a case as whole numbers of the columns' units."""
    return [np.rint(np.array(one[name]) / unit).astype(int).tolist() for name, unit in columns.items()]


def case_of(row: Sequence[Any], columns: dict[str, float]) -> dict[str, Any]:
    """Return a case from its row."""
    return {
        name: (np.round(np.array(whole) * unit, 6) if unit < 1 else np.array(whole, dtype=int)).tolist()
        for (name, unit), whole in zip(columns.items(), row, strict=True)
    }


def document(
    solved: Sequence[dict[str, Any]], clusters: Sequence[dict[str, Any]], sweep: Sequence[dict[str, Any]]
) -> str:
    """Return JSON, a case a line."""

    def lines(rows: Sequence[Any]) -> str:
        return "[\n" + ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows) + "\n]"

    parts = {
        "about": json.dumps(ABOUT),
        "model": json.dumps(MODEL),
        "law": json.dumps(asdict(Law())),
        "row_error": json.dumps(max(one["error"] for one in [*clusters, *sweep])),
        "cluster_columns": json.dumps(CLUSTER_COLUMNS),
        "sweep_columns": json.dumps(SWEEP_COLUMNS),
        "cases": lines(solved),
        "clusters": lines([row_of(one, CLUSTER_COLUMNS) for one in clusters]),
        "sweep": lines([row_of(one, SWEEP_COLUMNS) for one in sweep]),
    }
    return "{\n" + ",\n".join(f'"{name}":{text}' for name, text in parts.items()) + "\n}\n"


def truth(solved: Sequence[dict[str, Any]]) -> str:
    """Return JSON of cases alone, a case a line."""
    lines = ",\n".join(json.dumps(one, separators=(",", ":")) for one in solved)
    return f'{{\n"about":{json.dumps(ABOUT)},\n"model":{json.dumps(MODEL)},\n"cases":[\n{lines}\n]\n}}\n'


def told(found: Iterator[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return all cases, telling each as it is solved."""
    result = []
    for one in found:
        result.append(one)
        print(f"{len(result):4d}  error {one['error']:.1e}  {one.get('name', '')}", flush=True)
    return result


def verify(path: str) -> None:
    """Integrate a file's cases again, from what the file says, and print the largest differences from its ends."""
    data = json.loads(Path(path).read_text(encoding="utf-8"))
    clusters = [case_of(row, data["cluster_columns"]) for row in data["clusters"]]
    sweep = [case_of(row, data["sweep_columns"]) for row in data["sweep"]]
    for one in sweep:
        one["positions"], one["velocities"] = rack(one["gap"], RACK_AIM)
    for one in data["cases"] + clusters + sweep:
        law = Law(**data["law"] | one.get("law", {}))
        positions, velocities = np.array(one["positions"]), np.array(one["velocities"])
        rails = np.reshape(np.array(one.get("rails", []), dtype=float), (-1, 3))
        spins = np.array(one["angular_velocities"]) if "angular_velocities" in one else None
        again = solve(law, positions, velocities, one["time"], rails=rails, spins=spins)
        free = np.setdiff1d(np.arange(len(positions)), one["in_contact"])
        difference = np.abs(np.subtract(again["final_velocities"], one["final_velocities"])[free]).max(initial=0.0)
        error = one.get("error", data["row_error"])
        print(f"{difference:.1e} m/s, error {error:.1e}  {one.get('name', '')}", flush=True)


def figures() -> None:
    """Print the figures that the law is known by."""
    hard = Law()
    end = integrate(hard, *line(3, 0.0, 1.0), 0.003)
    print("three touching balls, one arriving:", *np.round(end.velocities[::-1, 0], 7))
    for restitution in (1.0, 0.98, 0.95, 0.9, 0.8):
        law = replace(hard, ball_restitution=restitution)
        depth = (5 * (law.mass / 2) / (4 * law.stiffness)) ** 0.4
        end = integrate(law, *line(2, 0.0, 1.0), 0.001)
        opening = end.velocities[1, 0] - end.velocities[0, 0]
        together = 0.001 - (end.positions[1, 0] - end.positions[0, 0] - 2 * RADIUS) / opening
        print(f"restitution {restitution:g}: {opening:.7f}, t_c = {together / depth:.7f} d_max/v")
    rail = np.array([[1.0, 0.0, 0.0]])
    end = integrate(hard, [[3 * RADIUS, 0.0], [RADIUS, 0.0]], [[-1.0, 0.0], [0.0, 0.0]], 0.003, rails=rail)
    print("ball frozen to a rail, hit squarely: ", *np.round(-end.velocities[:, 0], 7))
    for gap in (0.0, 1e-4, 1e-3):
        end = integrate(hard, *rack(gap, RACK_AIM), 0.002)
        speeds = np.sort(np.hypot(*end.velocities[:, :2].T))[::-1]
        print(f"rack, gaps {gap * 1e3:g} mm, speeds after 2 ms:", *(f"{speed:.1f}" for speed in speeds))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("out", nargs="?", metavar="OUT.json")
    what.add_argument("--verify", metavar="FILE.json")
    what.add_argument("--truth", metavar="OUT.json")
    what.add_argument("--figures", action="store_true")
    args = parser.parse_args()
    if args.verify:
        verify(args.verify)
    elif args.figures:
        figures()
    elif args.truth:
        Path(args.truth).write_text(truth(told(rack_cases())), encoding="utf-8")
    else:
        text = document(told(cases()), told(cluster_cases()), told(sweep_cases()))
        Path(args.out).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
