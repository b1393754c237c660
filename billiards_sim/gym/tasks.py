# SPDX-License-Identifier: Apache-2.0
"""What is to be learnt: where the balls lie at first, and what a shot is worth."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.noise import ShooterNoise
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.quantity import listed, shown
from billiards_sim.engine.rollout import Rollout
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.scenes import CAROM_PHYSICS, POOL_PHYSICS, POOL_TABLE
from billiards_sim.engine.simulation import check_comes_to_rest
from billiards_sim.engine.table import Table

SMALL_CAROM_TABLE = Table.carom_10ft(length=1.22, width=0.61)
"""That of pooltool's sum to three, 3.05 m by 1.525 m made 2.5 times smaller."""

MOST_BALLS = 15
"""Object balls of a game of pool."""

ATTEMPTS = 10_000
"""At places that are free."""


class Verdict(NamedTuple):
    """What K shots were worth."""

    rewards: NDArray[np.float64]  # (K,)
    ended: NDArray[np.bool_]  # (K,), whether the game is over
    infos: dict[str, NDArray[Any]]  # (K,) each


class Task(ABC):
    """What is played.

    Args:
        scene: its first ball is the cue ball; where the balls lie there means nothing.
        speeds: least and largest of a shot, m/s.
        noise: of the shooter; None: shots are played as they are meant.

    Raises:
        ValueError: an argument of a wrong kind, or balls that never come to rest.
    """

    needs_events = False
    """Whether the judge looks at the events of shots."""

    def __init__(self, scene: Scene, speeds: tuple[float, float], noise: ShooterNoise | None) -> None:
        if noise is not None and not isinstance(noise, ShooterNoise):
            raise ValueError(f"noise must be a ShooterNoise or None, got {shown(noise)}")
        check_comes_to_rest(scene.physics)
        self.scene = scene
        self.speeds = speeds
        self.noise = noise

    @abstractmethod
    def start(self, random: np.random.Generator) -> NDArray[np.float64]:
        """(N, 2) m: where the balls lie when a game begins."""

    @abstractmethod
    def judge(self, result: Rollout, in_play: NDArray[np.bool_]) -> Verdict:
        """What shots were worth that all were played, with (K, N) what was in play before."""

    def begin(
        self, random: np.random.Generator, options: Mapping[str, Any] | None
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """(N, 2) m and (N,): where the balls lie at first, and which are in play; as `options` say, if they do.

        Raises:
            ValueError: options that are not known, or balls that cannot lie like that.
        """
        options = options or {}
        if not isinstance(options, Mapping):
            raise ValueError(f"options of reset must be a dict or None, got {shown(options)}")
        unknown = options.keys() - {"positions", "in_play"}
        if unknown:
            raise ValueError(f"options of reset are positions and in_play, got {listed(sorted(map(str, unknown)))}")
        if not options:
            return self.start(random), np.ones(len(self.scene), np.bool_)
        if "positions" not in options:
            raise ValueError("options of reset need positions beside in_play")
        given: dict[str, Any] = {"in_play": None, **options}
        scene = replace(self.scene, **given)
        if len(scene) != len(self.scene) or not (scene.in_play[0] and scene.in_play[1:].any()):
            raise ValueError("options of reset must leave the cue ball and another one in play")
        return scene.positions.copy(), scene.in_play.copy()


class Pool(Task):
    """Pot the object balls: 1 for each that falls, and the end when none is left; -1 and the end if the cue ball falls.

    Args:
        balls: number of object balls, 1 to 15. They and the cue ball lie anywhere at first.
        table, physics: default to a 9 ft pool table and pool.
        noise: of the shooter.

    Shots have 0.3 to 4.5 m/s, the largest that the computer pool tournaments allowed (FastFiz).
    """

    def __init__(
        self,
        balls: int = 1,
        table: Table = POOL_TABLE,
        physics: Physics = POOL_PHYSICS,
        noise: ShooterNoise | None = None,
    ) -> None:
        if isinstance(balls, bool) or not isinstance(balls, (int, np.integer)) or not 1 <= balls <= MOST_BALLS:
            raise ValueError(f"balls must be a whole number from 1 to {MOST_BALLS}, got {shown(balls)}")
        _check(table, physics)
        if not table.mouths:
            raise ValueError("the table of pool must have pockets")
        self._room = Room(balls + 1, table, physics)
        places = self._room.places(np.random.default_rng(0))
        super().__init__(Scene(places, table=table, physics=physics), (0.3, 4.5), noise)

    def start(self, random: np.random.Generator) -> NDArray[np.float64]:
        return self._room.places(random)

    def judge(self, result: Rollout, in_play: NDArray[np.bool_]) -> Verdict:
        fell = in_play & ~result.in_play
        scratch = fell[:, 0]
        rewards = np.where(scratch, -1.0, fell[:, 1:].sum(axis=1))
        return Verdict(rewards, scratch | ~result.in_play[:, 1:].any(axis=1), {})


class SumToThree(Task):
    """Hit the other ball, so that the two hit cushions three times altogether: 1 for that, else 0.

    Args:
        random_start: whether the balls lie anywhere at first, or on the head and the foot spot.
        table, physics: default to a small carom table, 1.22 m by 0.61 m, and carom billiards.
        noise: of the shooter.

    The game, its table, its speeds of 0.3 to 3 m/s and its ten shots are those that E. Kiefl made for pooltool and
    LightZero (2024; LightZero's `zoo/pooltool`). His cut angle is up to 70 degrees, here up to 90; there the tip is in
    the middle, and a hit alone is worth 0.1.
    """

    needs_events = True

    def __init__(
        self,
        random_start: bool = False,
        table: Table = SMALL_CAROM_TABLE,
        physics: Physics = CAROM_PHYSICS,
        noise: ShooterNoise | None = None,
    ) -> None:
        if not isinstance(random_start, bool):
            raise ValueError(f"random_start must be a bool, got {shown(random_start)}")
        _check(table, physics)
        if table.mouths:
            raise ValueError("the table of sum to three must not have pockets")
        scene = Scene([table.head_spot, table.foot_spot], table=table, physics=physics)
        super().__init__(scene, (0.3, 3.0), noise)
        self._room = Room(2, table, physics) if random_start else None

    def start(self, random: np.random.Generator) -> NDArray[np.float64]:
        return self.scene.positions.copy() if self._room is None else self._room.places(random)

    def judge(self, result: Rollout, in_play: NDArray[np.bool_]) -> Verdict:
        cushions = np.array([result.events(shot).kinds.count("ball_rail") for shot in range(len(result))])
        scored = (cushions == 3) & (result.first_hit == 1)
        return Verdict(scored.astype(np.float64), np.zeros(len(result), np.bool_), {"cushions": cushions})


class Room:
    """Where balls can lie on a table that is otherwise empty.

    Raises:
        ValueError: so many find no place.
    """

    def __init__(self, count: int, table: Table, physics: Physics) -> None:
        self._count = count
        self._what = f"{count} balls of radius {physics.radius:g} m"
        self._low = np.array([table.x_min, table.y_min]) + physics.radius
        self._size = np.array([table.x_max, table.y_max]) - physics.radius - self._low
        self._pairs = list(combinations(range(count), 2))
        self._least = 2.0 * physics.radius
        self.places(np.random.default_rng(0))

    def places(self, random: np.random.Generator) -> NDArray[np.float64]:
        """(count, 2) m: places of the balls, each as probable as any where none overlap."""
        for _ in range(ATTEMPTS):
            places = self._low + self._size * random.random((self._count, 2))
            if self._are_free(places.tolist()):
                return places
        raise ValueError(f"{self._what} find no room on this table")

    def _are_free(self, places: list[list[float]]) -> bool:
        return all(math.dist(places[one], places[other]) > self._least for one, other in self._pairs)


def _check(table: Any, physics: Any) -> None:
    for name, given, kind in (("table", table, Table), ("physics", physics, Physics)):
        if not isinstance(given, kind):
            raise ValueError(f"{name} must be {kind.__name__}, got {shown(given)}")
