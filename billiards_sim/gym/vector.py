# SPDX-License-Identifier: Apache-2.0
"""Many tables at a time, whose shots go into one rollout."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from billiards_sim.engine.quantity import shown
from billiards_sim.gym.tables import Observations, Tables, as_actions
from billiards_sim.gym.tasks import Pool, SumToThree, Task

MODES = (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP)


class BilliardsVectorEnv(VectorEnv[Observations, NDArray[np.floating[Any]], NDArray[Any]]):
    """Tables side by side; each gives the bits of a `BilliardsEnv` of the same task and seed.

    `reset(seed=s)` gives table k the seed s + k; a list gives each its own. After the last shot of a game, a table is
    laid anew by itself: with NEXT_STEP, Gymnasium's habit, at the next step, which ignores the action for it and
    rewards nothing; with SAME_STEP at once, and `infos["final_obs"]` and `infos["final_info"]` are what there was
    before.

    Args:
        num_envs: number of tables.
        max_episode_steps: shots of an episode, after which it is truncated; None: it goes on.
        autoreset_mode: one of `MODES`, or its value.
        render_mode: "rgb_array": `render` gives a picture of each table.
        options: of the task.
    """

    task: ClassVar[Callable[..., Task]]
    """what is played"""

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **options: Any,
    ) -> None:
        for name, value in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            optional = name == "max_episode_steps" and value is None
            if not optional and (isinstance(value, bool) or not isinstance(value, int) or value < 1):
                raise ValueError(f"{name} must be a whole number >= 1, got {shown(value)}")
        if autoreset_mode not in (*MODES, *(mode.value for mode in MODES)):
            allowed = " or ".join(mode.value for mode in MODES)
            raise ValueError(f"autoreset_mode must be {allowed}, got {shown(autoreset_mode)}")
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or rgb_array, got {shown(render_mode)}")
        self.num_envs = num_envs
        self.render_mode = render_mode
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self._tables = Tables(self.task(**options), num_envs)
        self._most_shots = max_episode_steps
        self._shots = np.zeros(num_envs, np.int64)  # of each episode
        self._over = np.zeros(num_envs, np.bool_)  # to be laid anew at the next step
        self._randoms: list[np.random.Generator | None] = [None] * num_envs
        self.single_action_space = self._tables.action_space
        self.single_observation_space = self._tables.observation_space
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Lay the balls of every table for a new game."""
        seeds = self._seeds(seed)
        for row, given in enumerate(seeds):
            if given is not None or self._randoms[row] is None:
                self._randoms[row], _ = seeding.np_random(given)
            self._begin(row, options)
        self._over[:] = False
        return self._tables.observations(), {}

    def step(
        self, actions: NDArray[np.floating[Any]]
    ) -> tuple[Observations, NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Play a shot at each table, until everything rests.

        Raises:
            ValueError: an action is out of bounds, or `reset` was not called.
        """
        wanted = as_actions(actions, self.action_space.shape or ())
        if None in self._randoms:
            raise ValueError("reset must be called before step")
        rows = np.flatnonzero(~self._over).tolist()
        randoms = [random for row in rows if (random := self._randoms[row]) is not None]
        shots = self._tables.shots(rows, wanted[rows], randoms)  # refuses, before anything changes
        for row in np.flatnonzero(self._over).tolist():
            self._begin(row)
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros((2, self.num_envs), np.bool_)
        found: dict[str, NDArray[Any]] = {}
        if rows:
            outcome = self._tables.play(rows, shots)
            self._shots[rows] += 1
            rewards[rows] = outcome.rewards
            terminated[rows] = outcome.ended
            found = outcome.infos
            if self._most_shots is not None:
                truncated[rows] = self._shots[rows] >= self._most_shots
        self._over = terminated | truncated
        infos = self._spread(found, np.array(rows, np.intp))
        seen = self._tables.observations()
        if self.autoreset_mode == AutoresetMode.SAME_STEP and self._over.any():
            infos = self._begin_anew(seen, infos)
        return seen, rewards, terminated, truncated, infos

    def render(self) -> tuple[Any, ...] | None:
        """With "rgb_array", a picture (height, width, 3) of each table as it is."""
        if self.render_mode is None:
            return None
        from billiards_sim.gym.rendering import Pictures

        return tuple(Pictures().picture(self._tables.scene(row), 0.0) for row in range(self.num_envs))

    def _seeds(self, seed: int | Sequence[int | None] | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, (int, np.integer)):
            return [int(seed) + row for row in range(self.num_envs)]
        if not isinstance(seed, Sequence):
            raise ValueError(f"seed must be a whole number, a list of {self.num_envs}, or None, got {shown(seed)}")
        if len(seed) != self.num_envs:
            raise ValueError(f"seed must be a number or a list of {self.num_envs}, got {len(seed)} of them")
        return list(seed)

    def _begin(self, row: int, options: dict[str, Any] | None = None) -> None:
        random = self._randoms[row]
        assert random is not None
        self._tables.begin(row, random, options)
        self._shots[row] = 0

    def _begin_anew(self, seen: Observations, infos: dict[str, Any]) -> dict[str, Any]:
        # The tables whose game is over: `seen` becomes what they look like then.
        over, self._over = self._over, np.zeros(self.num_envs, np.bool_)
        rows = np.flatnonzero(over)
        last = np.full(self.num_envs, None, object)
        for row in rows.tolist():
            last[row] = seen[row].copy()
            self._begin(row)
        seen[rows] = self._tables.observations(rows.tolist())
        keys = [key for key in infos if not key.startswith("_")]
        left = np.flatnonzero(~over)
        return {
            "final_obs": last,
            "_final_obs": over,
            "final_info": self._spread({key: infos[key][rows] for key in keys}, rows),
            "_final_info": over.copy(),
            **self._spread({key: infos[key][left] for key in keys}, left),
        }

    def _spread(self, values: dict[str, NDArray[Any]], rows: NDArray[np.intp]) -> dict[str, Any]:
        # As Gymnasium has the infos of vectors: of all tables, and beside each which ones have it.
        infos: dict[str, Any] = {}
        for key, some in values.items() if len(rows) else ():
            infos[key] = np.zeros(self.num_envs, some.dtype)
            infos[key][rows] = some
            infos[f"_{key}"] = np.zeros(self.num_envs, np.bool_)
            infos[f"_{key}"][rows] = True
        return infos


class PoolVectorEnv(BilliardsVectorEnv):
    """Many of `billiards_sim/Pool-v0`; takes what `tasks.Pool` takes beside what a vector does."""

    task = Pool


class SumToThreeVectorEnv(BilliardsVectorEnv):
    """Many of `billiards_sim/SumToThree-v0`; takes what `tasks.SumToThree` takes beside what a vector does."""

    task = SumToThree
