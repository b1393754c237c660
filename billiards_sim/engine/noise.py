# SPDX-License-Identifier: Apache-2.0
"""How far off a shooter is: what a shot becomes when somebody, or a robot, tries to play it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.quantity import check_quantities, number, quantity

TOURNAMENT_BALL = 0.028575
"""m, radius of the ball whose millimetres are meant."""


@dataclass(frozen=True)
class ShooterNoise:
    """Standard deviations of normal errors, each independent of the others. A value out of bounds raises `ValueError`.

    A tip that an error takes beyond the miscue limit slips off: `rollout` marks the shot as a miscue and does not play
    it, since how the ball then goes is not modelled.
    """

    speed: float = quantity(None, "1", "of the speed of the ball, as a share of it", minimum=0.0, maximum=1.0)
    azimuth: float = quantity(None, "rad", "of the direction of the cue along the table", minimum=0.0, maximum=math.pi)
    side: float = quantity(None, "radii", "of where the tip hits, to the left", minimum=0.0, maximum=1.0)
    up: float = quantity(None, "radii", "of where the tip hits, up", minimum=0.0, maximum=1.0)

    def __post_init__(self) -> None:
        check_quantities(self)

    @classmethod
    def tournament(cls, level: float = 1.0, cue_speed: float = 3.0) -> ShooterNoise:
        """The errors that the computer pool tournaments put on every shot, times `level`.

        They are those of FastFiz (`GaussianNoise` in its Noise.h; Archibald, Altman and Shoham, "Analysis of a winning
        computational billiards player", IJCAI 2009): 0.5 mm of each offset of the tip, 0.125 degrees of the azimuth,
        0.075 m/s of the speed of the cue, 0.1 degrees of its elevation. Here the offsets are in radii of their ball,
        57.15 mm across; the speed is relative, as 0.075 m/s are at `cue_speed`, m/s, of which they allow up to 4.5; the
        elevation, which changes the speed of a level shot by 2e-6, is left out.

        Raises:
            ValueError: a value out of bounds.
        """
        level, cue_speed = number("level", level), number("cue_speed", cue_speed)
        if not (level >= 0.0 and cue_speed > 0.0):
            raise ValueError(f"level must be >= 0 and cue_speed > 0 m/s, got {level:.9g} and {cue_speed:.9g}")
        offset = 0.0005 / TOURNAMENT_BALL
        return cls(
            speed=level * 0.075 / cue_speed,
            azimuth=level * math.radians(0.125),
            side=level * offset,
            up=level * offset,
        )

    def samples(self, shots: NDArray[np.float64], first: int, count: int, entropy: int) -> NDArray[np.float64]:
        """(M, count, 5): what shots, (M, 5), become, `count` times each.

        Errors of shot m are those of the m-th child of a seed sequence with this entropy, `first` the m of the first
        row: the same whatever shots are beside it, and however many samples follow.
        """
        deviations = np.array([self.speed, self.azimuth, self.side, self.up])
        played = np.repeat(shots[:, np.newaxis], count, axis=1)
        for row in range(len(shots)):
            seed = np.random.SeedSequence(entropy, spawn_key=(first + row,))
            errors = np.random.default_rng(seed).standard_normal((count, 4)) * deviations
            played[row, :, 0] *= 1.0 + errors[:, 0]
            played[row, :, 1:4] += errors[:, 1:]
        return played
