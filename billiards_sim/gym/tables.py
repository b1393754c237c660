# SPDX-License-Identifier: Apache-2.0
"""Tables on which the same task is played side by side: what a single environment and a vector of them have in common.

So both give the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from billiards_sim.engine.aim import Aim
from billiards_sim.engine.player import MISCUE
from billiards_sim.engine.quantity import shown
from billiards_sim.engine.rollout import Rollout, rollout
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.shots import Shots
from billiards_sim.gym.tasks import Task

ACTION = ("azimuth", "speed", "side", "up")
"""What the numbers of an action stand for."""

MOST_OFFSET = 0.99
"""Radii of the ball, where the physics have no miscue limit below."""

Observations = NDArray[np.float32]


class Outcome(NamedTuple):
    """What became of K shots."""

    rewards: NDArray[np.float64]  # (K,)
    ended: NDArray[np.bool_]  # (K,)
    infos: dict[str, NDArray[Any]]  # (K,) each


class InThisThread(Executor):
    """Does at once what it is given."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


class Tables:
    """Of a task, so many.

    Attributes:
        action_space: of one table: `ACTION`, each from -1 to 1.
        observation_space: of one table: x, y and 1 of each ball in play, 0, 0 and 0 of one that is not. x and y go from
            -1 to 1 over what a ball can reach: the playing area and, on a table with pockets, as far as their jaws.
        positions: (K, N, 2) m.
        in_play: (K, N).
    """

    def __init__(self, task: Task, count: int) -> None:
        self._task = task
        scene = task.scene
        self.positions = np.full((count, len(scene), 2), math.nan)
        self.in_play = np.zeros((count, len(scene)), np.bool_)
        jaws = scene.table.jaw_depth if scene.table.mouths else 0.0
        self._reach = 0.5 * np.array([scene.table.length, scene.table.width]) + jaws
        self._offset = math.sqrt(0.5) * min(scene.physics.miscue_limit, MOST_OFFSET)
        self.action_space = spaces.Box(-1.0, 1.0, (len(ACTION),), np.float32)
        low = np.tile(np.array([-1.0, -1.0, 0.0], np.float32), len(scene))
        self.observation_space = spaces.Box(low, 1.0, dtype=np.float32)

    def begin(self, row: int, random: np.random.Generator, options: Mapping[str, Any] | None = None) -> None:
        """Lay the balls of a table as at the start of a game.

        Raises:
            ValueError: they cannot lie as the options say.
        """
        self.positions[row], self.in_play[row] = self._task.begin(random, options)

    def observations(self, rows: Sequence[int] | slice = slice(None)) -> Observations:
        """(K, 3 N) of some tables."""
        on_table = self.in_play[rows]
        places = (self.positions[rows] - self._task.scene.table.centre) / self._reach
        seen = np.zeros((*on_table.shape, 3), np.float32)
        seen[..., :2] = np.where(on_table[..., np.newaxis], places, 0.0)
        seen[..., 2] = on_table
        return seen.reshape(len(seen), -1)

    def shots(
        self, rows: Sequence[int], actions: NDArray[np.float64], randoms: Sequence[np.random.Generator]
    ) -> NDArray[np.float64]:
        """(K, 5): the shots, as `Shots.columns`, that actions (K, 4) at some tables are, with the shooter's errors.

        Raises:
            ValueError: an action out of bounds, or a game that is over.
        """
        self._check(rows, actions)
        shots = np.zeros((len(rows), 5))
        slowest, fastest = self._task.speeds
        shots[:, 0] = slowest + 0.5 * (actions[:, 1] + 1.0) * (fastest - slowest)
        shots[:, 1] = self._azimuths(rows, actions[:, 0].tolist())
        shots[:, 2:4] = self._offset * actions[:, 2:]
        noise = self._task.noise
        if noise is not None:
            errors = np.array([random.standard_normal(4) for random in randoms]).reshape(-1, 4)
            errors *= (noise.speed, noise.azimuth, noise.side, noise.up)
            shots[:, 0] *= 1.0 + errors[:, 0]
            shots[:, 1:4] += errors[:, 1:]
        return shots

    def play(self, rows: Sequence[int], shots: NDArray[np.float64]) -> Outcome:
        """Play a shot, a row of (K, 5), at each of some tables. One that cannot be played changes nothing."""
        index = np.asarray(rows)
        before = self.in_play[index]
        result = rollout(
            self._task.scene,
            Shots(*shots.T),
            positions=self.positions[index],
            in_play=before,
            events=self._task.needs_events,
            executor=InThisThread(),
            on_error="mask",
            piece=len(index),
        )
        verdict = self._task.judge(result, before)
        self._keep(index, result)
        played = result.error == 0
        infos = {
            "error": np.where(self._miscues(shots) & ~played, MISCUE, result.error).astype(np.int64),
            "duration": np.where(played, result.duration, 0.0),
            "first_hit": result.first_hit.astype(np.int64),
            **verdict.infos,
        }
        return Outcome(np.where(played, verdict.rewards, 0.0), played & verdict.ended, infos)

    def scene(self, row: int, shot: NDArray[np.float64] | None = None) -> Scene:
        """A table as it is, with a shot, (5,), if one is given."""
        whole = self._task.scene
        struck = None if shot is None else Aim(*shot.tolist()).shot(whole.physics)
        return Scene(
            self.positions[row],
            names=whole.names,
            table=whole.table,
            physics=whole.physics,
            in_play=self.in_play[row],
            shot=struck,
            track_orientation=True,
        )

    def _check(self, rows: Sequence[int], actions: NDArray[np.float64]) -> None:
        inside = np.abs(actions) <= 1.0
        if not inside.all():
            row, number = np.argwhere(~inside)[0].tolist()
            raise ValueError(
                f"{ACTION[number]} of the action for table {rows[row]} must be >= -1 and <= 1, "
                f"got {actions[row, number]:.9g}"
            )
        for row in rows:
            if not (self.in_play[row, 0] and self.in_play[row, 1:].any()):
                raise ValueError(f"the game of table {row} is over, or has not begun: reset it")

    def _azimuths(self, rows: Sequence[int], offsets: Sequence[float]) -> list[float]:
        # One by one, not by NumPy, whose functions may round otherwise where there are more.
        apart = self.positions[rows, 1:] - self.positions[rows, :1]
        squares = np.where(self.in_play[rows, 1:], (apart * apart).sum(axis=2), math.inf)
        nearest = apart[np.arange(len(apart)), squares.argmin(axis=1)].tolist()
        diameter = 2.0 * self._task.scene.physics.radius
        return [
            math.atan2(y, x) + math.asin(offset * min(diameter / math.hypot(x, y), 1.0))
            for (x, y), offset in zip(nearest, offsets, strict=True)
        ]

    def _miscues(self, shots: NDArray[np.float64]) -> NDArray[np.bool_]:
        return np.hypot(shots[:, 2], shots[:, 3]) > self._task.scene.physics.miscue_limit

    def _keep(self, rows: NDArray[np.intp], result: Rollout) -> None:
        played = result.error == 0
        self.positions[rows[played]] = result.positions[played]
        self.in_play[rows[played]] = result.in_play[played]


def as_actions(given: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Actions as numbers.

    Raises:
        ValueError: they are none, or have another shape.
    """
    try:
        actions = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"actions must be numbers of shape {shape}, got {shown(given)}") from None
    if actions.shape != shape:
        raise ValueError(f"actions must have shape {shape}, got {actions.shape}")
    return actions
