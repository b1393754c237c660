# SPDX-License-Identifier: Apache-2.0
"""One table at a time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import NDArray

from billiards_sim.gym.tables import Observations, Tables, as_actions
from billiards_sim.gym.tasks import Pool, SumToThree, Task

RENDER_MODES = ("human", "rgb_array")

FRAME_RATE = 30
"""Of the shots that `human` shows, frames a second."""


class BilliardsEnv(gymnasium.Env[Observations, NDArray[np.floating[Any]]]):
    """A table on which one shot is an action.

    An action has four numbers from -1 to 1:

    1. azimuth: how far beside the middle of the nearest ball the cue ball is aimed, in diameters of a ball: 0 hits it
       full, 1 and -1 just graze its left and right side. It is the sine of the cut angle.
    2. speed: from the least to the largest of the task.
    3. side, 4. up: where the tip hits, 1 and -1 being 0.71 times the miscue limit, 0.354 radii with the presets; so
       both together never go beyond it.

    An observation has three numbers for each ball, the cue ball first: x and y from -1 to 1 over what a ball can reach,
    and whether it is in play; 0, 0, 0 if not.

    `info` has of a shot `duration`, s, `first_hit`, index of the ball that the cue ball met first or -1, and `error`,
    as in a `Rollout`: other than 0, the shot was not played and nothing moved; noise may take the tip off the ball.

    `reset` takes `options={"positions": ...}`, (N, 2) m, and with it `"in_play"`, (N,).

    Args:
        render_mode: "rgb_array": `render` gives a picture of the table; "human": a window shows each shot in its time.
        options: of the task.
    """

    task: ClassVar[Callable[..., Task]]
    """what is played"""

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FRAME_RATE}

    def __init__(self, *, render_mode: str | None = None, **options: Any) -> None:
        if render_mode is not None and render_mode not in RENDER_MODES:
            raise ValueError(f"render_mode must be None or one of {', '.join(RENDER_MODES)}, got {render_mode!r}")
        self.render_mode = render_mode
        self._tables = Tables(self.task(**options), 1)
        self.action_space = self._tables.action_space
        self.observation_space = self._tables.observation_space
        self._time = 0.0  # s, since the last reset
        self._show: Any = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Lay the balls for a new game."""
        super().reset(seed=seed)
        self._tables.begin(0, self.np_random, options)
        self._time = 0.0
        if self.render_mode == "human":
            self._shown.hold(self._tables.scene(0), 0.0)
        return self._tables.observations()[0], {}

    def step(self, action: NDArray[np.floating[Any]]) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Play a shot, until everything rests.

        Raises:
            ValueError: the action is out of bounds, or the game is over.
        """
        actions = as_actions(action, self.action_space.shape or ())[np.newaxis]
        shots = self._tables.shots([0], actions, [self.np_random])
        before = self._tables.scene(0, shots[0]) if self.render_mode == "human" else None
        outcome = self._tables.play([0], shots)
        info = {key: values.tolist()[0] for key, values in outcome.infos.items()}
        if before is not None and info["error"] == 0:
            self._shown.play(before, self._time)
        self._time += info["duration"]
        return self._tables.observations()[0], float(outcome.rewards[0]), bool(outcome.ended[0]), False, info

    def render(self) -> Any:
        """With "rgb_array", (height, width, 3): the table as it is."""
        if self.render_mode == "rgb_array":
            return self._shown.picture(self._tables.scene(0), self._time)
        if self.render_mode == "human":
            self._shown.hold(self._tables.scene(0), self._time)
        return None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._show is not None:
            self._show.close()
            self._show = None

    @property
    def _shown(self) -> Any:
        if self._show is None:
            from billiards_sim.gym.rendering import Pictures, Window

            self._show = Window(FRAME_RATE) if self.render_mode == "human" else Pictures()
        return self._show


class PoolEnv(BilliardsEnv):
    """`billiards_sim/Pool-v0`; takes what `tasks.Pool` takes."""

    task = Pool


class SumToThreeEnv(BilliardsEnv):
    """`billiards_sim/SumToThree-v0`; takes what `tasks.SumToThree` takes. `info` also has `cushions`, how many."""

    task = SumToThree
