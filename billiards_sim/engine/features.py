# SPDX-License-Identifier: Apache-2.0
"""What stands on a table, as records for the kernels."""

from __future__ import annotations

from billiards_sim.engine.kernels.state import Feature
from billiards_sim.engine.table import Table

RAILS = ("x_min", "x_max", "y_min", "y_max")
"""Names of the features, in their order."""


def features_of(table: Table, radius: float) -> list[Feature]:
    """The noses of the rails for balls of a radius, m, in the order of `RAILS`; places are centred."""
    along, across = 0.5 * table.length - radius, 0.5 * table.width - radius
    normals = ((1.0, 0.0, along), (-1.0, 0.0, along), (0.0, 1.0, across), (0.0, -1.0, across))
    return [Feature(*normal) for normal in normals]
