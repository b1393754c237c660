# SPDX-License-Identifier: Apache-2.0
"""What there is to see of a simulation at a tick."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.simulation import Simulation
from billiards_sim.quaternion import product

Array = NDArray[np.float64]


class Look:
    """Each part is made when it is first asked for, before the simulation goes on.

    Args:
        simulation: what is on the table.
        at_rest: whether every ball rests.
        turned: (N, 4) how the balls were turned where the simulation starts; None for upright.
    """

    def __init__(self, simulation: Simulation, at_rest: bool, turned: Array | None) -> None:
        self.at_rest = at_rest
        self._simulation = simulation
        self._turned = turned

    @cached_property
    def in_play(self) -> NDArray[np.bool_]:
        """(N,)."""
        return self._simulation.in_play

    @cached_property
    def positions(self) -> Array:
        """(N, 2) m."""
        return self._simulation.positions

    @cached_property
    def velocities(self) -> Array:
        """(N, 2) m/s."""
        return self._simulation.velocities

    @cached_property
    def spins(self) -> Array:
        """(N, 3) rad/s."""
        return self._simulation.angular_velocities

    @cached_property
    def orientations(self) -> Array | None:
        """(N, 4) unit quaternions x y z w; None where they are not tracked."""
        if not self._simulation.start_scene.track_orientation:
            return None
        orientations = self._simulation.orientations
        return orientations if self._turned is None else product(orientations, self._turned)

    @cached_property
    def still(self) -> bool:
        """Whether nothing changes until something happens. A ball that rests may spin about the vertical for ever."""
        return self.at_rest and not self.spins.any()
