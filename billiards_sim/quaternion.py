# SPDX-License-Identifier: Apache-2.0
"""Unit quaternions x y z w, rows of arrays: how balls are turned. The engine's kernel is in `orientation.py`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IDENTITY = (0.0, 0.0, 0.0, 1.0)
"""Of a ball that has not turned."""


def product(later: Array, earlier: Array) -> Array:
    """(N, 4) the earlier rotations followed by the later ones, both (N, 4), or one of them (1, 4)."""
    u, c = later[:, :3], later[:, 3:]
    v, w = earlier[:, :3], earlier[:, 3:]
    return np.hstack((c * v + w * u + np.cross(u, v), c * w - (u * v).sum(axis=1, keepdims=True)))


def turned(orientations: Array, spins: Array, duration: float) -> Array:
    """(N, 4) orientations turned by constant angular velocities, (N, 3) rad/s, for a time, s."""
    rate = np.sqrt((spins * spins).sum(axis=1, keepdims=True))
    axis = np.divide(spins, rate, out=np.zeros_like(spins), where=rate > 0.0)
    half = 0.5 * rate * duration
    after = product(np.hstack((np.sin(half) * axis, np.cos(half))), orientations)
    unit: Array = after / np.sqrt((after * after).sum(axis=1, keepdims=True))
    return unit


def rotation_matrices(orientations: Array) -> Array:
    """(N, 3, 3) matrices that take directions in a ball to the frame `table`, of orientations (N, 4)."""
    x, y, z, w = orientations.T
    rows = (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)),
        (2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)),
        (2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)),
    )
    return np.moveaxis(np.array(rows), 2, 0)
