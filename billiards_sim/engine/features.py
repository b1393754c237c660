# SPDX-License-Identifier: Apache-2.0
"""What stands on a table, as records for the kernels, and what it is called."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache

from billiards_sim.engine.kernels.state import ARC, INF, LINE, MOUTH, NOBODY, PARTS, Feature
from billiards_sim.engine.pocket import Edge, Mouth
from billiards_sim.engine.table import Table

RAILS = ("x_min", "x_max", "y_min", "y_max")
"""Names of the rails, in the order of the features."""


def features_of(table: Table, radius: float) -> list[Feature]:
    """The rails for balls of a radius, m, in the order of `RAILS`, and the parts of the pockets; places are centred."""
    along, across = 0.5 * table.length - radius, 0.5 * table.width - radius
    normals = ((1.0, 0.0, along), (-1.0, 0.0, along), (0.0, 1.0, across), (0.0, -1.0, across))
    rails = [_rail(table, name, *normal) for name, normal in zip(RAILS, normals, strict=True)]
    return rails + [part for mouth in table.mouths for part in _parts(mouth, radius)]


@cache
def names_of(table: Table) -> tuple[str, ...]:
    """Names of the features of a table: of rails, of the jaws and points of a pocket, and of the pocket."""
    names = list(RAILS)
    for mouth in table.mouths:
        for kind in ("jaw", "point"):
            names += [f"{mouth.name}_{kind}_{edge.side}" for edge in mouth.edges]
        names.append(mouth.name)
    return tuple(names)


@cache
def check_fits(table: Table, radius: float) -> None:
    """Whether balls of a radius, m, can be played with on a table.

    Raises:
        ValueError: they cannot; with the reason and the figures.
    """
    for low, high in ((table.x_min, table.x_max), (table.y_min, table.y_max)):
        if low + radius > high - radius:
            raise ValueError(f"balls of radius {radius:g} m do not fit on a table {high - low:g} m wide")
    corner = (0.5 * table.length - radius, 0.5 * table.width - radius)  # no ball comes further, but for the mouths
    for mouth in table.mouths:
        mouth.check_takes(radius)
        x, y = map(abs, mouth.centre)
        away = math.hypot(max(x - corner[0], 0.0), max(y - corner[1], 0.0))
        if not away > mouth.pocket.slate_radius:
            raise ValueError(
                f"pocket {mouth.name}: its circle of radius {mouth.pocket.slate_radius:.6g} m reaches into the playing "
                f"area, where the centre of a ball of radius {radius:.6g} m is {away:.6g} m away from its middle"
            )


def trouble_at(table: Table, radius: float, x: float, y: float, tolerance: float) -> str:
    """Why a ball cannot lie at (x, y), m from the centre of the table; empty where it can but for a tolerance, m."""
    mouth = None
    for name, overlap, mouth in _beyond(table, radius, x, y, tolerance):
        if mouth is None:
            return f"reaches {overlap:.6g} m into the rail {name}"
    return "" if mouth is None else mouth.trouble_at(x, y, radius, tolerance)


def opening_at(table: Table, radius: float, x: float, y: float) -> Mouth | None:
    """The pocket in whose opening a ball reaches behind the noses at (x, y), m from the centre of the table."""
    openings = [mouth for _, _, mouth in _beyond(table, radius, x, y, 0.0)]
    return openings[0] if openings and None not in openings else None


def _beyond(
    table: Table, radius: float, x: float, y: float, tolerance: float
) -> Iterator[tuple[str, float, Mouth | None]]:
    # The rails behind whose line a ball reaches: by how much, m, and the opening in which, none for the rubber.
    for name, rail in zip(RAILS, features_of(table, radius)[: len(RAILS)], strict=True):
        overlap = -rail.offset - x * rail.normal_x - y * rail.normal_y
        along = rail.normal_x * y - rail.normal_y * x
        if overlap > tolerance:
            parts = rail.between if abs(along) < rail.near else rail.high if along > 0.0 else rail.low
            rubber = rail.near <= abs(along) <= rail.far
            yield name, overlap, None if rubber else table.mouths[(parts - len(RAILS)) // PARTS]


def _rail(table: Table, name: str, normal_x: float, normal_y: float, offset: float) -> Feature:
    firsts = {mouth.name: len(RAILS) + PARTS * index for index, mouth in enumerate(table.mouths)}
    corner, side = table.corner_pocket, table.side_pocket
    far, near = INF, 0.0
    if corner is not None:
        half = 0.5 * (table.width if normal_x else table.length)
        far = half - (math.sqrt(0.5) * corner.mouth + corner.setback)
    if side is not None and name in firsts:
        near = 0.5 * side.mouth + side.setback
    # The tangent (-normal_y, normal_x) of the rails at x_min and y_max points to higher coordinates.
    low, high = (f"{name}_y_min", f"{name}_y_max") if normal_x else (f"x_min_{name}", f"x_max_{name}")
    if name in ("x_max", "y_min"):
        low, high = high, low
    return Feature(
        LINE,
        normal_x,
        normal_y,
        offset,
        near=near,
        far=far,
        low=firsts.get(low, NOBODY),
        between=firsts.get(name, NOBODY),
        high=firsts.get(high, NOBODY),
    )


def _parts(mouth: Mouth, radius: float) -> list[Feature]:
    jaws = [_jaw(edge, radius) for edge in mouth.edges]
    points = [_point(edge, mouth.pocket.cut_angle, mouth.pocket.point_radius + radius) for edge in mouth.edges]
    (x, y), (normal_x, normal_y) = mouth.centre, mouth.inward
    return [*jaws, *points, Feature(MOUTH, normal_x, normal_y, x=x, y=y, reach=mouth.pocket.slate_radius)]


def _jaw(edge: Edge, radius: float) -> Feature:
    normal_x, normal_y = edge.normal
    start, end = (normal_x * y - normal_y * x for x, y in (edge.start, edge.end))
    offset = -(normal_x * edge.start[0] + normal_y * edge.start[1]) - radius
    return Feature(LINE, normal_x, normal_y, offset, along=0.5 * (start + end), far=0.5 * abs(start - end))


def _point(edge: Edge, cut_angle: float, reach: float) -> Feature:
    (x, y), (normal_x, normal_y) = edge.point, edge.middle
    far = reach * math.sin(0.5 * (math.pi - cut_angle))
    return Feature(ARC, normal_x, normal_y, along=normal_x * y - normal_y * x, far=far, x=x, y=y, reach=reach)
