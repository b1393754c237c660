# SPDX-License-Identifier: Apache-2.0
"""The physical constants of balls, cloth, rails and cue."""

from __future__ import annotations

from collections.abc import Callable
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

    All values are SI, the miscue limit is in radii. A value out of bounds raises `ValueError`. `pool`, `snooker` and
    `carom` are those of real games.
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

    @classmethod
    def pool(cls, **changed: float) -> Physics:
        """Those of pool; keywords replace single ones: `Physics.pool(ball_restitution=1.0)`.

        Ball: WPA, "Tournament table & equipment specifications", 2 1/4 in, 5 1/2 to 6 oz, here 6. Friction of two
        balls: Alciatore, TP A.14, a fit to Marlow's measurements (1995). Everything else is about the middle of what
        Alciatore's "Physical properties" lists as measured: restitution of two balls 0.92 to 0.98, of a cushion 0.6 to
        0.9, sliding 0.15 to 0.4, rolling 0.005 to 0.015, spin 5 to 15 rad/s^2 (here 10), contact with the tip some
        0.001 s, miscue at half a radius. Young's modulus and Poisson's ratio are phenolic resin's. The friction of a
        cushion (Han 2005 measured 0.09 to 0.47, falling with the angle of incidence) and the end mass of the cue, which
        gives 1.9 degrees of squirt there, are choices.

        Raises:
            ValueError: a value out of bounds.
        """
        figures = {
            "mass": 0.17,
            "youngs_modulus": 5.8e9,
            "ball_restitution": 0.95,
            "ball_friction": 9.951e-3,
            "ball_friction_slow": 0.108,
            "ball_friction_decay": 1.088,
            "rail_restitution": 0.85,
            "rail_friction": 0.2,
            "spin_friction": 0.01165,
            "cue_contact_time": 0.001,
            "cue_end_mass": 5.7e-3,
            "miscue_limit": 0.5,
        }
        return cls(**{**figures, **changed})

    @classmethod
    def snooker(cls, **changed: float) -> Physics:
        """Those of snooker; keywords replace single ones.

        Ball: WPBSA, "Official rules", 52.5 mm; its mass, which they leave open, and restitution and friction of a
        cushion from Mathavan, Jackson and Parkin (Proc. IMechE C 224, 2010), with a nose at 7/5 of the radius, 0.7
        diameters; sliding friction theirs, too (Am. J. Phys. 77, 2009). They found the cushion's with the cloth's
        friction during the impact, which is left out here. The rest are those of `pool`, a choice; so is the spin, that
        falls by 10 rad/s^2 as there.

        Raises:
            ValueError: a value out of bounds.
        """
        figures = {
            "mass": 0.1406,
            "radius": 0.02625,
            "sliding_friction": 0.212,
            "rail_restitution": 0.98,
            "rail_friction": 0.14,
            "spin_friction": 0.0107,
        }
        return cls.pool(**{**figures, **changed})

    @classmethod
    def carom(cls, **changed: float) -> Physics:
        """Those of carom billiards; keywords replace single ones.

        Ball: UMB, "World rules of carom billiard", 61 to 61.5 mm, 205 to 220 g, here 61.5 mm and 210 g. Cushion: Han
        (J. Mech. Sci. Tech. 19, 2005) measured a restitution of 0.39 + 0.257 v - 0.044 v^2, v in m/s, 0.71 to 0.77 for
        2 to 4 m/s, and a friction of 0.471 - 0.241 theta, theta the angle of incidence in rad, 0.28 at 45 degrees. The
        cloth is heated and without nap: rolling near the low end of Alciatore's 0.005 to 0.015, a choice. The rest are
        those of `pool`, a choice; so is the spin, that falls by 10 rad/s^2 as there.

        Raises:
            ValueError: a value out of bounds.
        """
        figures = {
            "mass": 0.21,
            "radius": 0.03075,
            "rolling_friction": 0.006,
            "rail_restitution": 0.75,
            "rail_friction": 0.28,
            "spin_friction": 0.01254,
        }
        return cls.pool(**{**figures, **changed})

    @property
    def spin_deceleration(self) -> float:
        """5 mu_sp g/(2 R), rad/s^2, by which the spin about the vertical falls."""
        return 2.5 * self.spin_friction * self.gravity / self.radius

    @property
    def moment_of_inertia(self) -> float:
        """2/5 m R^2 of a solid sphere, kg m^2 (equation 11)."""
        return 0.4 * self.mass * self.radius * self.radius

    def kinetic_energy(self, velocities: NDArray[np.float64], angular_velocities: NDArray[np.float64]) -> float:
        """Linear and rotational, J, of balls with velocities (N, 2) m/s and angular velocities (N, 3) rad/s."""
        linear = 0.5 * self.mass * float(np.sum(velocities**2))
        return linear + 0.5 * self.moment_of_inertia * float(np.sum(angular_velocities**2))


PRESETS: dict[str, Callable[..., Physics]] = {
    "pool": Physics.pool,
    "snooker": Physics.snooker,
    "carom": Physics.carom,
}
"""Physics of real games, by the name that scene files and the node know."""
