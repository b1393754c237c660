# SPDX-License-Identifier: Apache-2.0
"""The table: playing area, rails, pockets and spots."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from billiards_sim.engine.pocket import Mouth, Pocket, mouths
from billiards_sim.engine.quantity import check_quantities, part, quantity

INCH = 0.0254

RAIL_THICKNESS = 5.0 * INCH
"""m, of the tables of real games: pockets have room in it. The WPA has 4 to 7 1/2 in, others leave it open."""

POOL_CORNER = Pocket(4.5 * INCH, math.radians(142.0), 1.625 * INCH, 0.003, 0.062)
POOL_SIDE = Pocket(5.0 * INCH, math.radians(104.0), 0.1875 * INCH, 0.003, 0.0645)
"""Of a pool table: mouths and angles after the WPA's equipment specifications, shelves after the BCA's. Neither says
how round a point is, nor the slate: 3 mm, 62 and 64.5 mm are a choice."""

SNOOKER_CORNER = Pocket(0.089, math.radians(140.0), 0.030, 0.012, 0.0476)
SNOOKER_SIDE = Pocket(0.105, math.radians(105.0), 0.0, 0.012, 0.0476)
"""Of a snooker table. Its pockets follow templates that the WPBSA does not publish: all of this is a choice, after the
3.5 in that people quote for the corners."""


@dataclass(frozen=True)
class Table:
    """A rectangular table, with pockets in its corners and in the middle of its long rails, or without.

    The defaults are the paper's 8 ft table, which has none.

    Frame `table`: origin at the outer corner of the rails, x along the length, y along the width, z up, z = 0 on the
    cloth. All values but `nose_height` are m. A value out of bounds, and pockets that do not fit, raise `ValueError`.
    """

    length: float = quantity(2.34, "m", "playing area along x, nose to nose", above=0.0, maximum=1e4)
    width: float = quantity(1.17, "m", "playing area along y, nose to nose", above=0.0, maximum=1e4)
    rail_thickness: float = quantity(0.0508, "m", "outer edge of a rail to its nose", minimum=0.0, maximum=1e4)
    nose_height: float = quantity(
        0.5, "diameters", "height of a rail's nose over the cloth, in diameters of a ball", minimum=0.3, maximum=0.8
    )
    corner_pocket: Pocket | None = part(Pocket)
    side_pocket: Pocket | None = part(Pocket)
    jaw_depth: float = quantity(
        2.0 * INCH, "m", "how far the jaws of pockets reach behind the noses", above=0.0, maximum=1e4
    )

    def __post_init__(self) -> None:
        check_quantities(self)
        for name in ("corner_pocket", "side_pocket"):
            value = getattr(self, name)
            if value is not None:
                self._check_jaws(name, value)
        self._check_noses()

    @classmethod
    def pool_9ft(cls, **changed: Any) -> Table:
        """A 9 ft pool table, 100 in by 50 in (WPA); keywords replace single values: `Table.pool_9ft(nose_height=0.6)`.

        Raises:
            ValueError: a value out of bounds, pockets that do not fit.
        """
        return cls._pool(100.0, 50.0, changed)

    @classmethod
    def pool_8ft(cls, **changed: Any) -> Table:
        """An 8 ft pool table, 92 in by 46 in (WPA), otherwise as `pool_9ft`."""
        return cls._pool(92.0, 46.0, changed)

    @classmethod
    def pool_7ft(cls, **changed: Any) -> Table:
        """A 7 ft pool table, 78 in by 39 in (BCA), otherwise as `pool_9ft`."""
        return cls._pool(78.0, 39.0, changed)

    @classmethod
    def _pool(cls, length: float, width: float, changed: dict[str, Any]) -> Table:
        figures = {
            "length": length * INCH,
            "width": width * INCH,
            "rail_thickness": RAIL_THICKNESS,
            "nose_height": 0.635,  # the WPA has 0.625 to 0.645
            "corner_pocket": POOL_CORNER,
            "side_pocket": POOL_SIDE,
        }
        return cls(**{**figures, **changed})

    @classmethod
    def snooker_12ft(cls, **changed: Any) -> Table:
        """A 12 ft snooker table, 3.569 m by 1.778 m (WPBSA); keywords replace single values.

        Noses are at 7/5 of a ball's radius (Mathavan, Jackson and Parkin, Proc. IMechE C 224, 2010). How pockets are
        cut is not published: theirs are a choice.

        Raises:
            ValueError: a value out of bounds, pockets that do not fit.
        """
        figures = {
            "length": 3.569,
            "width": 1.778,
            "rail_thickness": RAIL_THICKNESS,
            "nose_height": 0.7,
            "corner_pocket": SNOOKER_CORNER,
            "side_pocket": SNOOKER_SIDE,
        }
        return cls(**{**figures, **changed})

    @classmethod
    def carom_10ft(cls, **changed: Any) -> Table:
        """A 10 ft carom table, 2.84 m by 1.42 m, noses 37 mm high for balls of 61.5 mm (UMB); keywords replace values.

        Raises:
            ValueError: a value out of bounds.
        """
        return cls(
            **{"length": 2.84, "width": 1.42, "rail_thickness": RAIL_THICKNESS, "nose_height": 37.0 / 61.5, **changed}
        )

    @cached_property
    def mouths(self) -> tuple[Mouth, ...]:
        """The pockets in their places; these are measured from the centre of the playing area."""
        return mouths(self.length, self.width, self.corner_pocket, self.side_pocket, self.jaw_depth)

    def _check_jaws(self, name: str, pocket: Pocket) -> None:
        setback = pocket.setback * math.sin(pocket.cut_angle)
        if not self.jaw_depth > setback:
            raise ValueError(
                f"the jaws of table.{name} do not begin: its points reach {setback:.6g} m behind the noses, "
                f"table.jaw_depth is {self.jaw_depth:.6g} m"
            )
        # A jaw leans towards the middle of the pocket, by which it must not come: there it would cross the other one.
        corner = name == "corner_pocket"
        tip = math.sqrt(0.5) * pocket.mouth if corner else 0.5 * pocket.mouth
        end = tip + self.jaw_depth / math.tan(pocket.cut_angle) + (self.jaw_depth if corner else 0.0)
        if not end > 0.0:
            raise ValueError(
                f"the jaws of table.{name} cross: mouth {pocket.mouth:.6g} m, cut_angle {pocket.cut_angle:.6g} rad, "
                f"table.jaw_depth {self.jaw_depth:.6g} m"
            )

    def _check_noses(self) -> None:
        corner, side = self.corner_pocket, self.side_pocket
        at_corner = 0.0 if corner is None else math.sqrt(0.5) * corner.mouth + corner.setback
        at_side = 0.0 if side is None else 0.5 * side.mouth + side.setback
        for name, room in (("length", 0.5 * self.length - at_side), ("width", 0.5 * self.width)):
            if not room > at_corner:
                raise ValueError(f"table.{name} {getattr(self, name):.6g} m leaves no nose between its pockets")

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


PRESETS: dict[str, Callable[..., Table]] = {
    "pool_9ft": Table.pool_9ft,
    "pool_8ft": Table.pool_8ft,
    "pool_7ft": Table.pool_7ft,
    "snooker_12ft": Table.snooker_12ft,
    "carom_10ft": Table.carom_10ft,
}
"""Tables of real games, by the name that scene files and the node know."""
