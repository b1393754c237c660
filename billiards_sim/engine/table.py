# SPDX-License-Identifier: Apache-2.0
"""The table: playing area, rails and spots."""

from __future__ import annotations

from dataclasses import dataclass

from billiards_sim.engine.quantity import check_quantities, quantity


@dataclass(frozen=True)
class Table:
    """A rectangular table without pockets; the defaults are the paper's 8 ft table.

    Frame `table`: origin at the outer corner of the rails, x along the length, y along the width, z up, z = 0 on the
    cloth. All values but `nose_height` are m. A value out of bounds raises `ValueError`.
    """

    length: float = quantity(2.34, "m", "playing area along x, nose to nose", above=0.0, maximum=1e4)
    width: float = quantity(1.17, "m", "playing area along y, nose to nose", above=0.0, maximum=1e4)
    rail_thickness: float = quantity(0.0508, "m", "outer edge of a rail to its nose", minimum=0.0, maximum=1e4)
    nose_height: float = quantity(
        0.5, "diameters", "height of a rail's nose over the cloth, in diameters of a ball", minimum=0.3, maximum=0.8
    )

    def __post_init__(self) -> None:
        check_quantities(self)

    @property
    def x_min(self) -> float:
        """Nose of the rail at low x, m."""
        return self.rail_thickness

    @property
    def x_max(self) -> float:
        """Nose of the rail at high x, m."""
        return self.rail_thickness + self.length

    @property
    def y_min(self) -> float:
        """Nose of the rail at low y, m."""
        return self.rail_thickness

    @property
    def y_max(self) -> float:
        """Nose of the rail at high y, m."""
        return self.rail_thickness + self.width

    @property
    def centre(self) -> tuple[float, float]:
        """Centre of the playing area (x, y), m."""
        return (self.rail_thickness + 0.5 * self.length, self.rail_thickness + 0.5 * self.width)

    @property
    def head_spot(self) -> tuple[float, float]:
        """A quarter of the length from the rail at low x, on the long axis (x, y), m."""
        return self.rail_thickness + 0.25 * self.length, self.centre[1]

    @property
    def foot_spot(self) -> tuple[float, float]:
        """A quarter of the length from the rail at high x, on the long axis (x, y), m."""
        return self.rail_thickness + 0.75 * self.length, self.centre[1]
