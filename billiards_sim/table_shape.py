# SPDX-License-Identifier: Apache-2.0
"""What a table looks like from above, for whoever draws it. All places are (x, y) m in the frame `table`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from billiards_sim.engine.pocket import Edge, Mouth, Place
from billiards_sim.engine.table import Table

SIGHTS = 8
"""Into so many parts the sights divide a long rail, and every second of them a short one."""


@dataclass(frozen=True)
class Shape:
    """A table from above.

    Attributes:
        cushions: polygons of the rubber, one between any two pockets or corners.
        pockets: the holes: name, middle (x, y), radius.
        spots: head spot and foot spot.
        sights: the marks on the rails.
    """

    cushions: tuple[tuple[Place, ...], ...]
    pockets: tuple[tuple[str, Place, float], ...]
    spots: tuple[Place, ...]
    sights: tuple[Place, ...]


def shape_of(table: Table) -> Shape:
    """What is drawn of a table."""
    centre_x, centre_y = table.centre

    def placed(place: Place) -> Place:
        return place[0] + centre_x, place[1] + centre_y

    return Shape(
        cushions=tuple(tuple(placed(place) for place in cushion) for cushion in _cushions(table)),
        pockets=tuple((mouth.name, placed(mouth.centre), mouth.pocket.slate_radius) for mouth in table.mouths),
        spots=(table.head_spot, table.foot_spot),
        sights=tuple(placed(place) for place in _sights(table)),
    )


def _cushions(table: Table) -> list[list[Place]]:
    # From the centre of the table. A nose runs from one end to the other; what lies behind is as deep as the jaws.
    mouths = {mouth.name: mouth for mouth in table.mouths}
    depth = min(table.jaw_depth, table.rail_thickness)
    found = []
    for rail in ("y_min", "y_max", "x_min", "x_max"):
        along, sign = ("y", "x").index(rail[0]), -1.0 if rail.endswith("min") else 1.0
        normal = (0.0, -sign) if along == 0 else (-sign, 0.0)
        ends = []
        for end in ("min", "max"):
            corner = f"x_{end}_{rail}" if along == 0 else f"{rail}_y_{end}"
            if corner in mouths:
                ends.append(_rounded(mouths[corner], rail, normal))
            else:
                ends.append(_mitred(table, along, -1.0 if end == "min" else 1.0, sign, depth))
        if rail in mouths:
            low, high = (_rounded(mouths[rail], side, normal) for side in ("x_min", "x_max"))
            found += [ends[0] + low[::-1], high + ends[1][::-1]]
        else:
            found.append(ends[0] + ends[1][::-1])
    return found


def _rounded(mouth: Mouth, side: str, normal: Place) -> list[Place]:
    # An end of a nose, from behind the jaw to where the nose begins.
    edge = next(edge for edge in mouth.edges if edge.side == side)
    radius = mouth.pocket.point_radius
    from_jaw = ((edge.start[0] - edge.point[0]) / radius, (edge.start[1] - edge.point[1]) / radius)
    return [edge.end, *(_on_point(edge, radius, way) for way in _turned(from_jaw, edge.middle, normal))]


def _turned(first: Place, middle: Place, last: Place) -> list[Place]:
    # Directions from the first to the last, by way of the middle one, so near that chords lie within 0.1 mm.
    ways = [first, middle, last]
    for _ in range(2):
        between = [(a[0] + b[0], a[1] + b[1]) for a, b in zip(ways, ways[1:])]
        ways = [way for pair in zip(ways, between) for way in map(_unit, pair)] + [last]
    return ways


def _unit(way: Place) -> Place:
    size = math.hypot(*way)
    return way[0] / size, way[1] / size


def _on_point(edge: Edge, radius: float, way: Place) -> Place:
    return edge.point[0] + radius * way[0], edge.point[1] + radius * way[1]


def _mitred(table: Table, along: int, end: float, sign: float, depth: float) -> list[Place]:
    # An end of a nose that meets another in a corner without a pocket.
    half = (0.5 * table.length, 0.5 * table.width)
    nose = [0.0, 0.0]
    nose[along], nose[1 - along] = end * half[along], sign * half[1 - along]
    behind = [nose[0], nose[1]]
    behind[along] += end * depth
    behind[1 - along] += sign * depth
    return [(behind[0], behind[1]), (nose[0], nose[1])]


def _sights(table: Table) -> list[Place]:
    # In the middle of the wood, which begins where the rubber ends.
    depth = min(table.jaw_depth, table.rail_thickness)
    behind = 0.5 * (depth + table.rail_thickness)
    pocketed = {mouth.name for mouth in table.mouths}
    found: list[Place] = []
    for number in range(1, SIGHTS):
        share = number / SIGHTS - 0.5
        for name, sign in (("y_min", -1.0), ("y_max", 1.0)):
            if number != SIGHTS // 2 or name not in pocketed:
                found.append((share * table.length, sign * (0.5 * table.width + behind)))
        if number % 2 == 0:
            found += [(sign * (0.5 * table.length + behind), share * table.width) for sign in (-1.0, 1.0)]
    return found
