# SPDX-License-Identifier: Apache-2.0
"""Pockets: what a maker states of them, and where their parts stand.

A mouth is as wide as it is between the tips where the lines of a nose and of a jaw would meet. There the rubber is
rounded: a point, a disc that touches nose and jaw, rho/tan(cut/2) from the tip. The slate ends in a circle, the shelf
behind the middle of the mouth: a ball whose centre reaches it falls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from billiards_sim.engine.quantity import check_quantities, quantity

CORNERS = ("x_min_y_min", "x_min_y_max", "x_max_y_min", "x_max_y_max")
SIDES = ("y_min", "y_max")
"""Names of pockets: the rails that they lie between, or the long rail whose middle they are."""

MOST_PUSHES = 100
"""Rounds in which a ball is pushed out of jaws, points and circle. Two parts at right angles take one, at 45 degrees 30
for all digits; between jaws that nearly face each other the ball is stuck."""

Place = tuple[float, float]


@dataclass(frozen=True)
class Pocket:
    """A kind of pocket. A value out of bounds raises `ValueError`."""

    mouth: float = quantity(
        None, "m", "between the tips, where the lines of noses and jaws meet", above=0.0, maximum=1e4
    )
    cut_angle: float = quantity(
        None, "rad", "between the lines of nose and jaw, in the rubber", minimum=0.5 * math.pi, maximum=3.0
    )
    shelf: float = quantity(None, "m", "from the middle of the mouth to the cut of the slate", minimum=0.0, maximum=1e4)
    point_radius: float = quantity(None, "m", "of the rounding between nose and jaw", above=0.0, maximum=1e4)
    slate_radius: float = quantity(None, "m", "of the circle that the slate is cut by", above=0.0, maximum=1e4)

    def __post_init__(self) -> None:
        check_quantities(self)

    @property
    def setback(self) -> float:
        """From the tip to where the point begins, along the nose and along the jaw, m."""
        return self.point_radius / math.tan(0.5 * self.cut_angle)


class Edge(NamedTuple):
    """One of the two edges of a mouth: a point and a jaw. Places in m, directions of length 1."""

    side: str
    """the side of the table towards which it lies"""
    point: Place
    """centre of the disc"""
    middle: Place
    """from there to the middle of the arc between nose and jaw"""
    start: Place
    """of the jaw, at the point"""
    end: Place
    normal: Place
    """of the jaw, into the pocket"""


class Mouth(NamedTuple):
    """A pocket in its place."""

    name: str
    pocket: Pocket
    centre: Place
    """of the circle that the slate is cut by, m"""
    edges: tuple[Edge, Edge]

    @property
    def inward(self) -> Place:
        """From its middle into the table, of length 1."""
        one, other = self.edges
        x, y = (one.start[i] + other.start[i] - one.end[i] - other.end[i] for i in (0, 1))
        length = math.hypot(x, y)
        return x / length, y / length

    def check_takes(self, radius: float) -> None:
        """Whether balls of a radius, m, can fall into it, and only from between its jaws.

        Raises:
            ValueError: they cannot; with the reason and the figures.
        """
        pocket = self.pocket
        if not pocket.mouth > 2.0 * radius:
            raise ValueError(
                f"pocket {self.name}: its mouth of {pocket.mouth:.6g} m must be wider than a ball of {2 * radius:.6g} m"
            )
        edge = self.edges[0]
        place = (edge.end[0] + radius * edge.normal[0], edge.end[1] + radius * edge.normal[1])
        away = math.dist(place, self.centre)
        if not away < pocket.slate_radius:
            raise ValueError(
                f"pocket {self.name}: a ball of radius {radius:.6g} m that runs along a jaw must fall before the jaw "
                f"ends, there it is {away:.6g} m from the middle of the circle of radius {pocket.slate_radius:.6g} m"
            )

    def freed(self, x: float, y: float, radius: float, tolerance: float) -> Place | None:
        """Where a ball in its opening comes to lie that is pushed out of its parts; None where there is no room, m."""
        for _ in range(MOST_PUSHES):
            if not self.trouble_at(x, y, radius, tolerance):
                return x, y
            for edge in self.edges:
                away = _product((x - edge.start[0], y - edge.start[1]), edge.normal)
                along = (edge.end[0] - edge.start[0], edge.end[1] - edge.start[1])
                if _product((x - edge.start[0], y - edge.start[1]), along) >= 0.0 and away < radius:
                    x, y = x + (radius - away) * edge.normal[0], y + (radius - away) * edge.normal[1]
                x, y = _pushed(x, y, edge.point, self.pocket.point_radius + radius)
            x, y = _pushed(x, y, self.centre, self.pocket.slate_radius)
        return None

    def trouble_at(self, x: float, y: float, radius: float, tolerance: float) -> str:
        """Why a ball in its opening cannot lie at (x, y), m; empty where it can, or but for a tolerance, m."""
        for edge in self.edges:
            from_start = (x - edge.start[0], y - edge.start[1])
            along = (edge.end[0] - edge.start[0], edge.end[1] - edge.start[1])
            away = _product(from_start, edge.normal)
            if _product(from_start, along) >= 0.0 and radius - away > tolerance:
                return f"reaches {radius - away:.6g} m into {self.name}_jaw_{edge.side}"
            overlap = self.pocket.point_radius + radius - math.dist((x, y), edge.point)
            if overlap > tolerance:
                return f"reaches {overlap:.6g} m into {self.name}_point_{edge.side}"
        away = math.dist((x, y), self.centre)
        behind = _product((x - self.centre[0], y - self.centre[1]), self.inward) < 0.0
        if behind or self.pocket.slate_radius - away > tolerance:
            return (
                f"lies in the pocket {self.name}: {away:.6g} m from the middle of the circle by which its slate is "
                f"cut, the radius is {self.pocket.slate_radius:.6g} m"
            )
        return ""


def _pushed(x: float, y: float, centre: Place, reach: float) -> Place:
    # Out of a circle, if it lies in it.
    away = math.dist((x, y), centre)
    if away >= reach or away == 0.0:
        return x, y
    return centre[0] + (x - centre[0]) * reach / away, centre[1] + (y - centre[1]) * reach / away


def _product(a: Place, b: Place) -> float:
    return a[0] * b[0] + a[1] * b[1]


def mouths(
    length: float, width: float, corner: Pocket | None, side: Pocket | None, jaw_depth: float
) -> tuple[Mouth, ...]:
    """The pockets of a table, in the order of `CORNERS` and `SIDES`; places from the centre of the playing area.

    What is mirrored has the same numbers but for the sign.
    """
    found = []
    if corner is not None:
        reach = math.sqrt(0.5) * (corner.slate_radius - (0.5 * corner.mouth - corner.shelf))
        edge = _edge("", corner, math.sqrt(0.5) * corner.mouth, jaw_depth)
        for name, sign_x, sign_y in zip(CORNERS, (-1.0, -1.0, 1.0, 1.0), (-1.0, 1.0, -1.0, 1.0), strict=True):
            corner_x, corner_y = sign_x * 0.5 * length, sign_y * 0.5 * width
            along_x = _placed(edge, name[6:], corner_x, corner_y, -sign_x, -sign_y)
            along_y = _placed(_swapped(edge), name[:5], corner_x, corner_y, -sign_x, -sign_y)
            centre = (corner_x + sign_x * reach, corner_y + sign_y * reach)
            found.append(Mouth(name, corner, centre, (along_y, along_x)))
    if side is not None:
        reach = side.shelf + side.slate_radius
        edge = _edge("", side, 0.5 * side.mouth, jaw_depth)
        for name, sign_y in zip(SIDES, (-1.0, 1.0), strict=True):
            low = _placed(edge, "x_min", 0.0, sign_y * 0.5 * width, -1.0, -sign_y)
            high = _placed(edge, "x_max", 0.0, sign_y * 0.5 * width, 1.0, -sign_y)
            found.append(Mouth(name, side, (0.0, sign_y * (0.5 * width + reach)), (low, high)))
    return tuple(found)


def _edge(side: str, pocket: Pocket, tip: float, depth: float) -> Edge:
    # Of a nose that runs along x from (tip, 0) on, the table above it.
    cut = pocket.cut_angle
    x, y = math.cos(cut), -math.sin(cut)  # along the jaw
    setback, turn = pocket.setback, 0.5 * (math.pi - cut)
    return Edge(
        side,
        point=(tip + setback, -pocket.point_radius),
        middle=(-math.sin(turn), math.cos(turn)),
        start=(tip + setback * x, setback * y),
        end=(tip - depth * x / y, -depth),
        normal=(y, -x),
    )


def _swapped(edge: Edge) -> Edge:
    # Of a nose that runs along y.
    return Edge(edge.side, *((y, x) for x, y in edge[1:]))


def _placed(edge: Edge, side: str, x: float, y: float, sign_x: float, sign_y: float) -> Edge:
    # With its origin at (x, y), and its axes turned.
    def place(at: Place) -> Place:
        return x + sign_x * at[0], y + sign_y * at[1]

    def direction(at: Place) -> Place:
        return sign_x * at[0], sign_y * at[1]

    return Edge(
        side, place(edge.point), direction(edge.middle), place(edge.start), place(edge.end), direction(edge.normal)
    )
