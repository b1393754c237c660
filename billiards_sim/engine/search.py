# SPDX-License-Identifier: Apache-2.0
"""Finds shots that reach a goal, and go on reaching it with a shooter's noise.

1. Sweep. Around directions, by geometry and all round, azimuths are played without noise for a few speeds and heights
   of the tip; scores are averaged over the azimuth by its error. This finds the aim that throw and rails have moved.
2. Trial. The best few are played with noise, the better half of them again with twice as many samples, and so on.
3. Refinement of each by a response surface (Box and Wilson 1951): shots are drawn around it, normally distributed in
   azimuth, log speed, side and up, and played once each, with noise; a quadratic is fitted to their scores, and its
   highest point within a deviation is where the next ones are drawn. So every play tells of all four.
4. Choice. What came of it is played again, and the best shots once more, with errors of their own: the value that is
   told was not picked for its luck.

A goal can tell what a shot does, as which ball falls where. Of all that is found so, something stays in the trial and
in the refinement, however good other shots are, and of each the best shot is chosen. Without that, shots differ by
their direction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.noise import ShooterNoise
from billiards_sim.engine.physics import SPEED_LIMIT, Physics
from billiards_sim.engine.potting import Direction
from billiards_sim.engine.quantity import number, shown
from billiards_sim.engine.rollout import Rollout, rollout
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.shots import Shots

Array = NDArray[np.float64]
T = TypeVar("T")
Goal = Callable[[Rollout], Any]

SPEEDS = 4
TIPS = [(side, up) for side in (0.0, -0.5, 0.5) for up in (0.0, -0.6, 0.6)]
"""Of a sweep: speeds between the bounds, in equal ratios, and side and up of the tip as shares of the room for it. With
side some pots are safer, and it moves the aim by more than the refinement could follow."""

SWEEP = (9, 201)
"""Fewest and most azimuths of a sweep."""

FINENESS = 0.7
"""Share of the tolerance between two azimuths of a sweep: three lie within it."""

ALL_ROUND = 180
"""Starts all round. Geometry does not know every shot; one that noise does not spoil is wide enough to be found so."""

TIP_ROOM = 0.5
"""Radii from the centre that the tip stays within, where the miscue limit is further out."""

SAFE = 3.0
"""Standard deviations that the tip stays away from the miscue limit."""

TRIALS = 8
"""Directions that are tried with noise, and shots that are refined, for each shot that is asked for. Of a direction
several are: soft and hard ones, or such with side, can be far from each other."""

ROUNDS = 6
NARROWING = 1
SHRINKING = 0.7
"""Of the refinement: rounds, the one after which only the best go on, and what remains of the deviations from one round
to the next."""

VARIANTS = 2
"""Best shots that go on, for each that is asked for, wherever they go; beside them as many as are asked for go on in a
direction of their own."""

REFINED = 0.3
"""Share of the budget for the refinement."""

LEAST_POPULATION = 30
"""Shots in a direction in each round: what is fitted to their scores has nine coefficients."""

SPREAD = (0.25, 0.1, 0.15)
"""First standard deviations of log speed, side and up, radii."""

SAME = 1e-3
"""rad between directions that count as two."""

APART = 2.0
"""The same in standard deviations of the noise."""

FEWEST, MOST = 8, 1000
"""Samples of a shot while the search goes on."""

LEAST_BUDGET = 100

TRIES = 100
"""Plays with noise of a shot that fails without, to find one that shows how it succeeds."""


@dataclass(frozen=True, eq=False)
class Found:
    """What `search` found, the best shot first.

    Attributes:
        shots: K of them, at most as many as were asked for, no two of which do the same.
        values: (K,) mean score of each, over fresh samples of the noise.
        errors: (K,) standard error of that mean; 0 without noise.
        result: of the last rollout, (K, S) with noise, else (K,): where balls end.
        scores: of the goal for it, of the same shape.
        played: number of shots that the search played.
    """

    shots: Shots
    values: Array
    errors: Array
    result: Rollout
    scores: Array
    played: int

    def __len__(self) -> int:
        return len(self.shots)


class _Lead(NamedTuple):
    """A shot that is worth a closer look."""

    shot: Array  # (4,) azimuth, speed, side, up
    spread: float  # rad, how exactly its azimuth is known
    direction: int  # index of the one that it was found in


def search(
    scene: Scene,
    goal: Goal,
    *,
    noise: ShooterNoise | None = None,
    samples: int = 400,
    best: int = 5,
    seed: int = 0,
    budget: int = 300_000,
    speeds: tuple[float, float] = (0.7, 5.0),
    directions: Sequence[Direction] | None = None,
    until: float | None = None,
    executor: Executor | None = None,
    ball: str = "cue",
) -> Found:
    """Search for the shots with the highest mean score under a shooter's noise.

    Args:
        goal: a function of a `Rollout` that gives each shot a number, an array of the shape of its `error`; higher is
            better. `goals` has some.
        noise: of the shooter; None: each shot is played as it is meant.
        samples: with which the shots that are returned are valued.
        best: how many shots are wanted. No two do the same, where the goal has a method `way(events)` that says, by
            anything that can be a key of a dict, what a shot does that scores more than 0 (which ball falls where);
            without it, no two go in the same direction. Where fewer are found, fewer are returned.
        seed: of all that is drawn; the same one gives the same shots, to the bit.
        budget: about how many shots may be played before the last valuation; up to a third more, where there are many
            ways to reach the goal.
        speeds: lowest and highest, m/s.
        directions: where to search; None: all round, and where the goal says, by its method `directions(scene)`.
        until, executor, ball: as of `rollout`.

    Raises:
        ValueError: an argument is wrong, or the goal's scores are no numbers, have another shape, or are not finite.
            Where a shot has an error, nan is as good as 0.
        BrokenRollout: the executor broke.
    """
    return _Search(scene, goal, noise, samples, best, seed, budget, speeds, until, executor, ball).run(directions)


def as_it_succeeds(
    scene: Scene,
    meant: Shots,
    goal: Goal,
    noise: ShooterNoise | None,
    seed: int,
    *,
    until: float | None = None,
    ball: str = "cue",
) -> Shots:
    """A shot as it is meant, if it scores more than 0 so; else the one with the highest score of some with noise."""
    tried = meant.columns()
    if noise is not None:
        tried = np.concatenate((tried, noise.samples(tried, 0, TRIES, seed)[0]))
    for some in (tried[:1], tried):
        shots = Shots(*some.T)
        scores = np.nan_to_num(np.asarray(goal(rollout(scene, shots, until=until, on_error="mask", ball=ball))))
        if scores.max() > 0.0:
            return shots[int(scores.argmax())]
    return meant


class _Search:
    def __init__(
        self,
        scene: Scene,
        goal: Goal,
        noise: ShooterNoise | None,
        samples: int,
        best: int,
        seed: int,
        budget: int,
        speeds: tuple[float, float],
        until: float | None,
        executor: Executor | None,
        ball: str,
    ) -> None:
        if not isinstance(scene, Scene):
            raise ValueError(f"scene must be Scene, got {shown(scene)}")
        if not callable(goal):
            raise ValueError(f"goal must be a function of a rollout's result, got {shown(goal)}")
        if noise is not None and not isinstance(noise, ShooterNoise):
            raise ValueError(f"noise must be a ShooterNoise or None, got {shown(noise)}")
        for name, value, least in (
            ("samples", samples, 1),
            ("best", best, 1),
            ("seed", seed, 0),
            ("budget", budget, LEAST_BUDGET),
        ):
            if not isinstance(value, (int, np.integer)) or isinstance(value, bool) or value < least:
                raise ValueError(f"{name} must be a whole number >= {least}, got {shown(value)}")
        struck = getattr(goal, "struck", ball)
        if struck != ball:
            raise ValueError(f"goal is for shots of ball {shown(struck)}, and ball {shown(ball)} is struck")
        self.scene, self.goal, self.noise, self.samples, self.best = scene, goal, noise, int(samples), int(best)
        self.seed, self.budget, self.until, self.executor, self.ball = int(seed), int(budget), until, executor, ball
        self.speeds = _bounds(speeds)
        self.room = _tip_room(scene.physics, noise)
        self.played = self.stage = 0

    def run(self, given: Sequence[Direction] | None) -> Found:
        return self._choose(self._refine(self._trial(self._sweep(self._directions(given)))))

    def _directions(self, given: Sequence[Direction] | None) -> list[tuple[Direction, int]]:
        # With the number of azimuths to be played around each.
        affordable = max(self.budget // (2 * SPEEDS * len(TIPS)), 1)
        if given is None:
            known = self.goal.directions(self.scene) if hasattr(self.goal, "directions") else []
            directions = _fitting(known, affordable // 2)
            rest = max(affordable - sum(width for _, width in directions), 0 if directions else 1)
            around = min(ALL_ROUND, rest)
            azimuths = np.linspace(0.0, math.tau, around, endpoint=False).tolist()
            every = [Direction(azimuth, math.pi / around, math.nan) for azimuth in azimuths]
            return directions + [(direction, rest // around) for direction in every]
        if not isinstance(given, Sequence) or not given or not all(isinstance(one, Direction) for one in given):
            raise ValueError(f"directions must be `Direction`s, one at least, or None; got {shown(given)}")
        for one in given:
            if not (math.isfinite(one.azimuth) and 0.0 <= one.window <= math.pi and not one.tolerance < 0.0):
                raise ValueError(
                    "directions must have a finite azimuth, a window from 0 to pi rad and a tolerance >= 0 or nan, got "
                    f"{one.azimuth:.9g}, {one.window:.9g} and {one.tolerance:.9g}"
                )
        return _fitting(given, affordable)

    def _sweep(self, directions: list[tuple[Direction, int]]) -> list[_Lead]:
        # The best shots around each start without noise, best first.
        grid = self._grid()
        offsets = [
            np.linspace(-direction.window, direction.window, 2 * width + 1)[1::2] for direction, width in directions
        ]
        azimuths = np.concatenate([direction.azimuth + offset for (direction, _), offset in zip(directions, offsets)])
        shots = np.column_stack((np.repeat(azimuths, len(grid)), np.tile(grid, (len(azimuths), 1))))
        scores = self._scores(shots)[1].reshape(len(azimuths), len(grid))
        shots = shots.reshape(*scores.shape, 4)
        leads = []
        first = 0
        for place, ((direction, width), offset) in enumerate(zip(directions, offsets)):
            step = 2.0 * direction.window / width
            smooth = self._weights(offset, step) @ scores[first : first + width]
            for column, row in enumerate(smooth.argmax(axis=0).tolist()):
                spread = step if math.isnan(direction.tolerance) else min(step, 0.5 * direction.tolerance)
                leads.append((float(smooth[row, column]), _Lead(shots[first + row, column], spread, place)))
            first += width
        leads.sort(key=lambda scored: -scored[0])
        return [lead for _, lead in leads]

    def _grid(self) -> Array:
        # (G, 3): speed, side, up.
        speeds = np.geomspace(*self.speeds, SPEEDS)
        return np.array([(speed, side * self.room, up * self.room) for side, up in TIPS for speed in speeds])

    def _weights(self, offsets: Array, step: float) -> Array:
        # (W, W): how likely the error of the azimuth leads from one offset to another. Near ones count a little in any
        # case, so that of many that are as good a middle one is taken. Beyond the window nothing is won.
        deviation = max(0.0 if self.noise is None else self.noise.azimuth, step, 1e-300)
        reach = math.ceil(4.0 * deviation / step) if step else 0
        whole = np.exp(-0.5 * (np.arange(-reach, reach + 1) * step / deviation) ** 2).sum()
        return np.exp(-0.5 * ((offsets[:, np.newaxis] - offsets) / deviation) ** 2) / whole

    def _trial(self, leads: list[_Lead]) -> list[_Lead]:
        # With noise, by halves; of each way something stays.
        wanted = self._tried
        taken = self._apart([lead.shot[0] for lead in leads], wanted, SPEEDS * len(TIPS))
        firsts = list({lead.direction: index for index, lead in reversed(list(enumerate(leads)))}.values())
        ways = self._ways(np.array([leads[index].shot for index in firsts]))
        taken += _some(firsts, _first_of_each(ways, range(len(firsts)), wanted))
        leads = _some(leads, sorted(set(taken)))
        ways = self._ways(np.array([lead.shot for lead in leads]))
        size = len(leads)
        while size > wanted:
            size = max(size // 2, wanted)
            means = self._means(np.array([lead.shot for lead in leads]), self._samples(len(leads), 0.04))
            order = np.argsort(-means, kind="stable").tolist()
            kept = {*order[:size], *_first_of_each(ways, order, wanted)}
            order = [index for index in order if index in kept]
            leads, ways = _some(leads, order), _some(ways, order)
        return leads

    @property
    def _tried(self) -> int:
        # How many shots are refined: as many as the budget allows.
        affordable = int(REFINED / ROUNDS * self.budget) // LEAST_POPULATION
        return max(min(TRIALS * self.best, affordable), self.best)

    def _ways(self, shots: Array) -> list[Hashable]:
        # What shots, (M, 4), do without noise; None for those that fail, and where the goal does not tell.
        if not hasattr(self.goal, "way"):
            return [None] * len(shots)
        result, scores = self._scores(shots, events=True)
        return [self.goal.way(result.events(row)) if score > 0.0 else None for row, score in enumerate(scores.tolist())]

    def _best_apart(self, azimuths: Sequence[float], values: Array, count: int, variants: int = 1) -> list[int]:
        # Indices as of `_apart`, where the best come first.
        order = np.argsort(-values, kind="stable").tolist()
        return _some(order, self._apart(_some(azimuths, order), count, variants))

    def _apart(self, azimuths: Sequence[float], count: int, variants: int) -> list[int]:
        # Indices of the first ones in so many directions, and so many in each: what errors blur is one.
        blur = SAME if self.noise is None else max(SAME, APART * self.noise.azimuth)
        directions: list[list[int]] = []
        for index, azimuth in enumerate(azimuths):
            near = (kept for kept in directions if abs(math.remainder(azimuth - azimuths[kept[0]], math.tau)) <= blur)
            kept = next(near, None)
            if kept is None and len(directions) < count:
                directions.append([index])
            elif kept is not None and len(kept) < variants:
                kept.append(index)
        return [index for kept in directions for index in kept]

    def _refine(self, leads: list[_Lead]) -> list[_Lead]:
        # The best of them, each with what the refinement makes of it, and with the best of its last round. Those that
        # are there for their way alone are played beside the budget: they take nothing from the others.
        blur = math.inf if self.noise is None else self.noise.azimuth or math.inf
        mean = np.array([_free(lead.shot) for lead in leads])
        deviation = np.array([(min(lead.spread, blur), *SPREAD) for lead in leads])
        for turn in range(ROUNDS):
            counted = min(len(mean), self._tried if turn <= NARROWING else (1 + VARIANTS) * self.best)
            size = max(int(REFINED / ROUNDS * self.budget) // counted, LEAST_POPULATION)
            random = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(1, turn)))
            errors = random.standard_normal((len(mean), size, 4))
            drawn = self._allowed(mean[:, np.newaxis] + errors * deviation[:, np.newaxis])
            values = self._means(_shot(drawn.reshape(-1, 4)), 1).reshape(len(mean), size)
            away = (drawn - mean[:, np.newaxis]) / np.maximum(deviation[:, np.newaxis], 1e-300)
            steps = np.array([_uphill(*one) for one in zip(away, values)])
            mean = self._allowed(mean + steps * deviation)
            deviation = SHRINKING * deviation
            if turn == NARROWING:
                means = values.mean(axis=1)
                order = np.argsort(-means, kind="stable").tolist()
                kept = self._best_apart(mean[:, 0].tolist(), means, self.best)
                kept += [one for one in order[: VARIANTS * self.best] if one not in kept]
                before = self._ways(np.array([lead.shot for lead in leads]))
                ways = [now or then for now, then in zip(self._ways(_shot(mean)), before)]
                kept += [one for one in _first_of_each(ways, order, self.best) if one not in kept]
                mean, deviation, leads = mean[kept], deviation[kept], _some(leads, kept)
                drawn, values = drawn[kept], values[kept]
        found = []
        for index, lead in enumerate(leads):
            shots = _shot(np.array([mean[index], drawn[index, values[index].argmax()]]))
            found += [lead._replace(shot=shots[0]), lead._replace(shot=shots[1]), lead]
        return found

    def _choose(self, leads: list[_Lead]) -> Found:
        counted = min(len(leads), 3 * self.best)
        means = self._means(np.array([lead.shot for lead in leads]), self._samples(counted, 0.05))
        chosen = _some(leads, self._best_of_each(leads, means))
        result, scores = self._scores(np.array([lead.shot for lead in chosen]), self.samples)
        values, errors = scores, np.zeros(len(chosen))
        if scores.ndim > 1:
            values = scores.mean(axis=1)
            errors = scores.std(axis=1) / math.sqrt(self.samples)
        rank = np.argsort(-values, kind="stable")
        chosen = [chosen[index] for index in rank.tolist()]
        return Found(
            _shots(np.array([lead.shot for lead in chosen])),
            values[rank],
            errors[rank],
            _reordered(result, rank),
            scores[rank],
            self.played,
        )

    def _best_of_each(self, leads: list[_Lead], means: Array) -> list[int]:
        # Indices of the best lead of each way, or direction; of one at least, even if nothing succeeds.
        if not hasattr(self.goal, "way"):
            return self._best_apart([lead.shot[0] for lead in leads], means, self.best)
        chosen: dict[Hashable, int] = {}
        for index in np.argsort(-means, kind="stable").tolist():
            if chosen and (means[index] <= 0.0 or len(chosen) == self.best):
                break
            meant = _shots(leads[index].shot[np.newaxis])
            shown = as_it_succeeds(
                self.scene, meant, self.goal, self.noise, self.seed, until=self.until, ball=self.ball
            )
            (way,) = self._ways(shown.columns()[:, [1, 0, 2, 3]])
            chosen.setdefault(way, index)
        return list(chosen.values())

    def _samples(self, shots: int, share: float) -> int:
        # Of each of so many shots, for this share of the budget.
        if self.noise is None:
            return 1
        return min(max(int(share * self.budget) // shots, FEWEST), MOST)

    def _means(self, shots: Array, samples: int) -> Array:
        # (M,) of shots (M, 4).
        scores = self._scores(shots, samples if self.noise is not None else 0)[1]
        return scores.mean(axis=1) if scores.ndim > 1 else scores

    def _scores(self, shots: Array, samples: int = 0, events: bool = False) -> tuple[Rollout, Array]:
        # (M, S) of shots (M, 4), or (M,) without noise: for 0 samples, or where there is none or only one.
        self.stage += 1
        entropy = np.random.SeedSequence(self.seed, spawn_key=(0, self.stage)).generate_state(2, np.uint64)
        noise = self.noise if samples else None
        result = rollout(
            self.scene,
            _shots(shots),
            until=self.until,
            noise=noise,
            samples=samples if noise is not None else 1,
            seed=int(entropy[0]),
            events=events,
            executor=self.executor,
            ball=self.ball,
        )
        self.played += result.error.size
        given = np.asarray(self.goal(result))
        if given.dtype.kind not in "biuf":
            raise ValueError(f"goal must give numbers, got {shown(given.tolist())}")
        if given.shape != result.error.shape:
            raise ValueError(f"goal must give scores of shape {result.error.shape}, got {given.shape}")
        scores = given.astype(np.float64)
        scores[np.isnan(scores) & (result.error != 0)] = 0.0
        wrong = scores[~np.isfinite(scores)]
        if len(wrong):
            raise ValueError(f"goal gives {wrong[0]:g} for {len(wrong)} of {scores.size} shots")
        return result, scores

    def _allowed(self, free: Array) -> Array:
        # Drawn shots, (..., 4), with speed and tip within their bounds.
        inside = free.copy()
        inside[..., 1] = np.clip(free[..., 1], *np.log(self.speeds))
        away = np.hypot(free[..., 2], free[..., 3])
        inside[..., 2:] *= np.minimum(1.0, self.room / np.maximum(away, 1e-300))[..., np.newaxis]
        return inside


def _fitting(directions: Sequence[Direction], affordable: int) -> list[tuple[Direction, int]]:
    # As many of the first ones as can be afforded, but at least one, each with the number of azimuths around it.
    found: list[tuple[Direction, int]] = []
    for index, direction in enumerate(directions):
        if math.isnan(direction.tolerance):
            wanted = affordable / (len(directions) - index)
        else:
            wanted = 2.0 * direction.window / (FINENESS * max(direction.tolerance, 1e-300))
        width = int(min(max(wanted, SWEEP[0]), SWEEP[1]))
        if found and width > affordable:
            break
        found.append((direction, width))
        affordable -= width
    return found


def _uphill(away: Array, values: Array) -> Array:
    """Where scores are highest within 1 of the middle, in each of the K dimensions, by a fit without mixed terms.

    Where they do not bend, a slope that is no larger than its standard error leads as far as its share of that.

    Args:
        away: (M, K) places.
        values: (M,) scores there.
    """
    if np.ptp(values) == 0.0:
        return np.zeros(away.shape[1])
    terms = np.concatenate((np.ones((len(away), 1)), away, 0.5 * away**2), axis=1)
    fitted = np.linalg.lstsq(terms, values, rcond=None)[0]
    _, slope, bend = np.split(fitted, (1, 1 + away.shape[1]))
    error = (values - terms @ fitted).std() / math.sqrt(len(values))
    step: Array = np.clip(slope / np.maximum(-bend, max(float(error), 1e-300)), -1.0, 1.0)
    return step


def _first_of_each(ways: Sequence[Hashable], order: Iterable[int], count: int) -> list[int]:
    # Indices of the first of each way that is known, in this order; no more than `count`.
    firsts: dict[Hashable, int] = {}
    for index in order:
        if ways[index] is not None:
            firsts.setdefault(ways[index], index)
    return list(firsts.values())[:count]


def _some(given: Sequence[T], indices: Sequence[int]) -> list[T]:
    return [given[index] for index in indices]


def _free(shot: Array) -> Array:
    # Azimuth, log speed, side, up: in which errors are drawn.
    return np.array([shot[0], math.log(shot[1]), shot[2], shot[3]])


def _shot(free: Array) -> Array:
    # (M, 4) the other way.
    shots = free.copy()
    shots[:, 1] = list(map(math.exp, free[:, 1].tolist()))
    return shots


def _shots(rows: Array) -> Shots:
    azimuth, speed, side, up = rows.T
    return Shots(speed, azimuth, side, up)


def _bounds(speeds: Any) -> tuple[float, float]:
    try:
        low, high = (number("speeds", speed) for speed in speeds)
    except (TypeError, ValueError):
        raise ValueError(f"speeds must be two numbers, lowest and highest in m/s, got {shown(speeds)}") from None
    if not 0.0 < low <= high <= SPEED_LIMIT:
        raise ValueError(f"speeds must be > 0, in order and <= {SPEED_LIMIT:g} m/s, got {low:.9g} and {high:.9g}")
    return low, high


def _tip_room(physics: Physics, noise: ShooterNoise | None) -> float:
    # Radii from the centre within which the tip is aimed.
    error = 0.0 if noise is None else SAFE * max(noise.side, noise.up)
    return max(min(physics.miscue_limit, TIP_ROOM) - error, 0.0)


def _reordered(result: Rollout, rank: NDArray[np.intp]) -> Rollout:
    # With its shots in another order.
    arrays: dict[str, Any] = {
        field.name: value[rank]
        for field in fields(result)
        if isinstance(value := getattr(result, field.name), np.ndarray)
    }
    places = {old: new for new, old in enumerate(rank.tolist())}
    reasons: dict[Any, str] = {
        (places[key[0]], key[1]) if isinstance(key, tuple) else places[key]: reason
        for key, reason in result.reasons.items()
    }
    return replace(result, **arrays, reasons=dict(sorted(reasons.items())))
