# SPDX-License-Identifier: Apache-2.0
"""Where balls lie before each of many shots, where that is another place each time."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_sim.engine.quantity import float_array, shown
from billiards_sim.engine.scene import Scene

MARGIN = 1e-9
"""m. Balls this far from each other and from what they could reach into need no closer look."""


class Starts(NamedTuple):
    """What lies where, at rest."""

    positions: NDArray[np.float64]  # (M, N, 2) m, nan off the table
    in_play: NDArray[np.bool_]  # (M, N)

    @classmethod
    def of(cls, scene: Scene, count: int, positions: ArrayLike | None, in_play: ArrayLike | None) -> Starts | None:
        """From what `rollout` is given for `count` shots; None: they begin as the scene does.

        Raises:
            ValueError: wrong shapes, no numbers or truth values, or balls of the scene move.
        """
        if positions is None and in_play is None:
            return None
        if scene.velocities.any() or scene.angular_velocities.any():
            raise ValueError("positions and in_play of each shot need a scene in which nothing moves or spins")
        shape = count, len(scene)
        places = np.tile(scene.positions, (count, 1, 1)) if positions is None else _numbers(positions)
        on_table = np.tile(scene.in_play, (count, 1)) if in_play is None else np.array(in_play)
        if places.shape != (*shape, 2):
            raise ValueError(f"positions must have shape {(*shape, 2)}, got {places.shape}")
        if on_table.dtype.kind != "b" or on_table.shape != shape:
            raise ValueError(f"in_play must be truth values of shape {shape}, got {shown(in_play)}")
        places[~on_table] = np.nan
        return cls(places, on_table)

    def scene(self, scene: Scene, shot: int) -> Scene:
        """That before a shot.

        Raises:
            ValueError: the balls cannot lie like that.
        """
        return replace(scene, positions=self.positions[shot], in_play=self.in_play[shot], shot=None)

    def refusals(self, scene: Scene, ball: str) -> dict[int, str]:
        """Why the balls cannot lie like that, or the one that is to be struck is not there, by shot."""
        reasons = {}
        struck = scene.names.index(ball)
        for shot in self._doubtful(scene):
            try:
                self.scene(scene, shot)
            except ValueError as error:
                reasons[shot] = str(error)
        for shot in np.flatnonzero(~self.in_play[:, struck]).tolist():
            reasons.setdefault(shot, f"ball {ball!r} is not in play")
        return reasons

    def _doubtful(self, scene: Scene) -> list[int]:
        # Those with a ball near another one, a rail or a pocket, or nowhere.
        radius, table = scene.physics.radius, scene.table
        room = 0.5 * np.array([table.length, table.width]) - radius - MARGIN
        with np.errstate(invalid="ignore"):
            inside = (np.abs(self.positions - table.centre) < room).all(axis=2) | ~self.in_play
            doubtful = ~inside.all(axis=1)
            for first in range(len(scene)):  # not all pairs at once: of many balls they would take too much memory
                apart = self.positions[:, first + 1 :] - self.positions[:, first, np.newaxis]
                near = np.hypot(apart[..., 0], apart[..., 1]) < 2.0 * radius + MARGIN
                doubtful |= near.any(axis=1)
        return np.flatnonzero(doubtful).tolist()


def _numbers(positions: ArrayLike) -> NDArray[np.float64]:
    try:
        return float_array(positions)
    except ValueError:
        raise ValueError(f"positions must be numbers, got {shown(positions)}") from None
