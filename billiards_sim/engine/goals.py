# SPDX-License-Identifier: Apache-2.0
"""What a shot is to achieve, for `search`: functions of a rollout's result that give each shot a score.

A goal of one's own is any function from a `Rollout` to an array of floats of the shape of its `error`, higher is
better. `search` takes the score of a shot with an error as given, or as 0 where it is nan.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.events import Event
from billiards_sim.engine.potting import Direction, pots
from billiards_sim.engine.quantity import listed, shown
from billiards_sim.engine.rollout import Rollout
from billiards_sim.engine.scene import Scene, index_of
from billiards_sim.engine.shot_kind import ShotKind, kind_of


@dataclass(frozen=True)
class Potting:
    """Scores 1 where a ball falls and the struck one does not, else 0; made by `pocket`.

    Attributes:
        ball: that is to fall; None: any but the struck one.
        pocket: name of the one that it is to fall into; None: any.
        keep_cue: whether the struck ball must stay on the table.
        first: ball that the struck one must meet first; None: any.
        struck: name of the struck ball.
    """

    ball: str | None = None
    pocket: str | None = None
    keep_cue: bool = True
    first: str | None = None
    struck: str = "cue"

    def __call__(self, result: Rollout) -> NDArray[np.float64]:
        """(M,) or (M, S): 1 or 0."""
        names = result.scene.names
        balls = [self.ball] if self.ball is not None else [name for name in names if name != self.struck]
        done = np.zeros(result.error.shape, np.bool_)
        for ball in balls:
            done |= result.pocketed(ball, self.pocket)
        if self.keep_cue:
            done &= ~result.pocketed(self.struck)
        if self.first is not None:
            done &= result.first_hit == index_of(names, self.first)
        return done.astype(np.float64)

    def way(self, events: Sequence[Event]) -> ShotKind:
        """What a shot does, by its events: how which ball falls where."""
        return kind_of(events, self.struck, self.ball, self.pocket)

    def directions(self, scene: Scene) -> list[Direction]:
        """Where to search: the aims that geometry gives."""
        return pots(scene, self.ball, self.pocket, self.struck)


def pocket(
    scene: Scene,
    ball: str | None = None,
    pocket: str | None = None,
    keep_cue: bool = True,
    first: str | None = None,
    struck: str = "cue",
) -> Potting:
    """The goal to pot a ball of a scene: see `Potting`.

    Raises:
        ValueError: no such ball or pocket, balls that are not in play, or a table without pockets.
    """
    if not isinstance(scene, Scene):
        raise ValueError(f"scene must be Scene, got {shown(scene)}")
    for name in (struck, ball, first):
        if name is None:
            continue
        if not scene.in_play[index_of(scene.names, name)]:
            raise ValueError(f"ball {shown(name)} is not in play")
    for role, name in (("potted", ball), ("met first", first)):
        if name == struck:
            raise ValueError(f"the ball to be {role} must be another than {shown(struck)}, which is struck")
    if ball is None and np.count_nonzero(scene.in_play) < 2:
        raise ValueError(f"there is no ball to pot but {shown(struck)}, which is struck")
    known = [mouth.name for mouth in scene.table.mouths]
    if not known:
        raise ValueError("the table of the scene has no pockets")
    if pocket is not None and pocket not in known:
        raise ValueError(f"no pocket is named {shown(pocket)}; the pockets are {listed(known)}")
    return Potting(ball, pocket, keep_cue, first, struck)
