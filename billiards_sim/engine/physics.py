# SPDX-License-Identifier: Apache-2.0
"""The physical constants of balls, cloth, rails and cue."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.quantity import check_quantities, quantity

LARGEST = 1e6
"""In SI units, of every constant that has no bound by its nature: beyond, products of them overflow."""

SMALLEST = 1e-6
"""In SI units, of every constant that is not 0: below, quotients of them overflow, and a ball would be no larger than
what its position is rounded by."""


SPEED_LIMIT = 299_792_458.0
"""m/s. Largest speed, and spin times radius, of a ball at the start or after a shot: light's. Far below where the
powers in the formulas overflow."""


@dataclass(frozen=True)
class Physics:
    """Constants of the model; the defaults are the paper's (sections 1 and 2).

    All values are SI. A value out of bounds raises `ValueError`.
    """

    mass: float = quantity(0.160, "kg", "mass of a ball", minimum=SMALLEST, maximum=LARGEST)
    radius: float = quantity(0.028575, "m", "radius of a ball", minimum=SMALLEST, maximum=LARGEST)
    gravity: float = quantity(9.81, "m/s^2", "gravitational acceleration", minimum=SMALLEST, maximum=LARGEST)
    sliding_friction: float = quantity(
        0.2, "1", "friction coefficient of a ball sliding on the cloth", minimum=0.0, maximum=LARGEST
    )
    rolling_friction: float = quantity(
        0.01, "1", "resistance coefficient of a ball rolling on the cloth", minimum=0.0, maximum=LARGEST
    )
    youngs_modulus: float = quantity(
        0.0, "Pa", "of the balls: their contacts take time; 0: rigid", minimum=0.0, maximum=1e13
    )
    poisson_ratio: float = quantity(0.34, "1", "of the balls", minimum=0.0, maximum=0.5)
    ball_restitution: float = quantity(
        1.0, "1", "share of the normal speed that two balls give back", minimum=0.0, maximum=1.0
    )
    ball_friction: float = quantity(
        0.0, "1", "friction coefficient of two balls that slip fast: a of a + b exp(-c slip)", minimum=0.0, maximum=1.0
    )
    ball_friction_slow: float = quantity(
        0.0, "1", "what is added to it where they slip slowly: b", minimum=0.0, maximum=1.0
    )
    ball_friction_decay: float = quantity(
        1.088, "s/m", "how fast that falls with their slip: c", minimum=0.0, maximum=LARGEST
    )
    rail_restitution: float = quantity(
        0.7, "1", "share of the normal speed that a rail gives back", minimum=0.0, maximum=1.0
    )
    rail_friction: float = quantity(0.0, "1", "friction coefficient of a ball and a rail", minimum=0.0, maximum=1.0)
    spin_friction: float = quantity(
        0.0, "1", "friction coefficient of a ball spinning about the vertical", minimum=0.0, maximum=LARGEST
    )
    cue_contact_time: float = quantity(
        0.01, "s", "time for which the cue tip pushes the ball", minimum=SMALLEST, maximum=LARGEST
    )
    cue_end_mass: float = quantity(
        0.0, "kg", "mass at the tip that english pushes aside: squirt; 0: none", minimum=0.0, maximum=LARGEST
    )
    miscue_limit: float = quantity(
        1.0, "radii", "largest distance of the tip from the middle of the ball", above=0.0, maximum=1.0
    )

    def __post_init__(self) -> None:
        check_quantities(self)

    @property
    def moment_of_inertia(self) -> float:
        """2/5 m R^2 of a solid sphere, kg m^2 (equation 11)."""
        return 0.4 * self.mass * self.radius * self.radius

    def kinetic_energy(self, velocities: NDArray[np.float64], angular_velocities: NDArray[np.float64]) -> float:
        """Linear and rotational, J, of balls with velocities (N, 2) m/s and angular velocities (N, 3) rad/s."""
        linear = 0.5 * self.mass * float(np.sum(velocities**2))
        return linear + 0.5 * self.moment_of_inertia * float(np.sum(angular_velocities**2))
