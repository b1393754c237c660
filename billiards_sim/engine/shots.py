# SPDX-License-Identifier: Apache-2.0
"""Many shots in people's words, and what the cue does in each: as `Aim` and `cue.checked` say it of one."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_sim.engine import cue
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.physics import SPEED_LIMIT, Physics
from billiards_sim.engine.quantity import float_array, shown

MARGIN = 1e-6
"""Relative: shots this far inside every bound need no closer look. NumPy may round otherwise than `math` does."""

LEAST_SPEED = 1e-100
"""m/s. Products of anything slower may be 0."""

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, init=False)
class Shots:
    """Shots at a resting ball, as `Simulation.shoot` takes them; each an array (M,), or a number that all share.

    Args:
        speed: of the ball after the shot, along the table, m/s.
        azimuth: where the cue points along the table, rad, counter-clockwise from the x axis.
        side, up: where the tip hits, to the left and up in shares of the radius, seen along the cue.
        elevation: of the butt over the tip, rad.

    Arrays are copied and made read-only. `shots[index]` are some of them; `index` is what NumPy takes.

    Raises:
        ValueError: no numbers, or shapes that do not go together. Whether each can be played is for `rollout` to say.
    """

    speed: Array
    azimuth: Array
    side: Array
    up: Array
    elevation: Array

    def __init__(
        self,
        speed: ArrayLike,
        azimuth: ArrayLike,
        side: ArrayLike = 0.0,
        up: ArrayLike = 0.0,
        elevation: ArrayLike = 0.0,
    ) -> None:
        given = {"speed": speed, "azimuth": azimuth, "side": side, "up": up, "elevation": elevation}
        arrays = {name: _row(name, value) for name, value in given.items()}
        counts = {len(array) for array in arrays.values() if array.ndim}
        if len(counts) > 1:
            sizes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items() if array.ndim)
            raise ValueError(f"the arrays of shots must have one length, got {sizes}")
        count = counts.pop() if counts else 1
        for name, array in arrays.items():
            self._keep(name, array if array.ndim else np.full(count, array))

    def __len__(self) -> int:
        return len(self.speed)

    def __getitem__(self, index: Any) -> Shots:
        some = object.__new__(Shots)
        for field in fields(self):
            some._keep(field.name, np.atleast_1d(getattr(self, field.name)[index]).copy())
        return some

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, array in state.items():
            self._keep(name, array)  # unpickled arrays are not read-only

    def _keep(self, name: str, array: Array) -> None:
        array.flags.writeable = False
        object.__setattr__(self, name, array)

    def columns(self) -> Array:
        """(M, 5): speed, azimuth, side, up, elevation; a copy."""
        return np.stack([getattr(self, field.name) for field in fields(self)], axis=1)


def _row(name: str, given: ArrayLike) -> Array:
    try:
        array = float_array(given)
    except ValueError:
        raise ValueError(f"{name} of shots must be numbers, got {shown(given)}") from None
    if array.ndim > 1:
        raise ValueError(f"{name} of shots must be a number or have shape (M,), got {array.shape}")
    return array


def refusals(shots: Array, physics: Physics) -> dict[int, str]:
    """Why shots, (M, 5) as `Shots.columns`, cannot be played, by row; what `Simulation.shoot` says of them."""
    reasons = {}
    for row in _doubtful(shots, physics):
        try:
            _blow(shots[row], physics)
        except ValueError as error:
            reasons[row] = str(error)
    return reasons


def blows(shots: Array, physics: Physics) -> Array:
    """(M, 6): the numbers of the `Blow` of shots that can be played, (M, 5), to the bit as `Simulation.shoot` does."""
    speed, azimuth, side, up, elevation = shots.T
    force = physics.mass * speed / physics.cue_contact_time
    found = np.zeros((len(shots), 6))
    # Not by NumPy, whose functions may differ in the last bit.
    found[:, 0] = force * list(map(math.cos, azimuth.tolist()))
    found[:, 1] = force * list(map(math.sin, azimuth.tolist()))
    raised = np.flatnonzero(elevation)
    found[raised, 2] = -force[raised] * list(map(math.tan, elevation[raised].tolist()))
    found[:, 3] = list(map(math.hypot, found[:, 0].tolist(), found[:, 1].tolist()))
    found[:, 4] = side * physics.radius
    found[:, 5] = up * physics.radius
    return found


def _doubtful(shots: Array, physics: Physics) -> list[int]:
    # The rows that are not so far inside every bound that they need no closer look.
    speed, azimuth, side, up, elevation = shots.T
    limit = min(1.0, physics.miscue_limit)
    with np.errstate(all="ignore"):
        plain = (
            (speed > LEAST_SPEED)
            & (speed < SPEED_LIMIT * (1.0 - MARGIN) * np.cos(elevation))
            & np.isfinite(azimuth)
            & (np.hypot(side, up) < limit * (1.0 - MARGIN))
            & (elevation >= 0.0)
            & (elevation < 0.5 * math.pi * (1.0 - MARGIN))
        )
    return np.flatnonzero(~plain).tolist()


def _blow(shot: Array, physics: Physics) -> cue.Blow:
    wanted = Aim(*shot.tolist()).shot(physics)
    return cue.checked(wanted.force, wanted.offset, physics)
