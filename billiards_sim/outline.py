# SPDX-License-Identifier: Apache-2.0
"""A table from above, as polygons for whoever draws it: cloth, cushions, wood and the holes of pockets.

Polygons are (K, 2) m in the frame `table`, counter-clockwise. Noses, points, jaws and the cut of the slate are those
that balls meet; how wide wood and cushions are is for the eye.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from billiards_sim.engine.pocket import Edge, Mouth, Place
from billiards_sim.engine.table import Table

Polygon = NDArray[np.float64]

CUSHION = 0.45
"""How deep the cushions of a table without pockets are, in shares of its rails."""

ROOM = 1.3
"""Least width of the rails of a table with pockets, in jaw depths."""

RIM = 0.07
"""Wood that is left behind a hole at least, in shares of the rails."""

ARC_STEP = math.radians(8.0)
"""Of the lines that round things are drawn with: on a screen nobody sees the corners."""


@dataclass(frozen=True)
class Outline:
    """The parts of a table.

    Attributes:
        outer: ((x_min, x_max), (y_min, y_max)) m, the edges of the wood.
        cloth: the bed, with the mouths as far as the slate reaches.
        cushions: the rubber between two pockets, or two corners.
        wood: what is behind each of them.
        holes: of the pockets, those parts included that jaws reach over, in the order of `Table.mouths`.
        sights: (K, 2) m, the marks in the wood: eighths of the length, quarters of the width.
    """

    outer: tuple[tuple[float, float], tuple[float, float]]
    cloth: Polygon
    cushions: tuple[Polygon, ...]
    wood: tuple[Polygon, ...]
    holes: tuple[Polygon, ...]
    sights: Polygon


@dataclass(frozen=True)
class _Joint:
    # Between two cushions: a corner or a pocket. Places from the centre of the table.
    outer: Place  # of the wood
    corner: Place  # of the noses
    mouth: Mouth | None
    inward: tuple[Place, Place]  # of the rail before it and of the rail after it, normals into the table


@cache
def outline(table: Table) -> Outline:
    """The outline of a table."""
    border = table.rail_thickness
    depth = CUSHION * border
    if table.mouths:
        border = max(border, ROOM * table.jaw_depth)  # rails that have no room for their jaws are drawn wider
        depth = table.jaw_depth
    centre = np.array(table.centre)
    room = (0.5 * table.length + border, 0.5 * table.width + border)
    joints = list(_joints(table, room))
    pairs = list(zip(joints, [*joints[1:], joints[0]], strict=True))
    inner = (room[0] - RIM * border, room[1] - RIM * border)
    cloth = [place for joint in joints for place in _bed(joint)]
    holes = [_clipped(_circle(mouth, 0.0, 2.0 * math.pi), inner) for mouth in table.mouths]
    cushions = [_cushion(one, other, depth) for one, other in pairs]
    wood = [_wood(one, other, depth, inner) for one, other in pairs]
    return Outline(
        ((centre[0] - room[0], centre[0] + room[0]), (centre[1] - room[1], centre[1] + room[1])),
        _polygon(cloth) + centre,
        tuple(_polygon(places) + centre for places in cushions) if border else (),
        tuple(_polygon(places) + centre for places in wood) if border else (),
        tuple(_polygon(places) + centre for places in holes),
        np.array(list(_sights(table, 0.5 * (depth + border)))).reshape(-1, 2) + centre,
    )


def triangles(polygon: Polygon) -> NDArray[np.intp]:
    """(T, 3) indices of the corners of triangles that make up a polygon without holes, counter-clockwise.

    By cutting off ears: a corner that points outwards, and whose triangle no other corner lies in.
    """
    left = list(range(len(polygon)))
    found: list[tuple[int, ...]] = []
    while len(left) > 3:
        for place in range(len(left)):
            ear = (left[place - 1], left[place], left[(place + 1) % len(left)])
            if _is_ear(polygon, ear, left):
                found.append(ear)
                del left[place]
                break
        else:
            return np.array(found, dtype=np.intp)  # what is left is on one line
    return np.array([*found, left], dtype=np.intp)


def area(polygon: Polygon) -> float:
    """m^2, positive for a counter-clockwise polygon."""
    x, y = polygon.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def _is_ear(polygon: Polygon, ear: tuple[int, int, int], left: list[int]) -> bool:
    corners = polygon[list(ear)]
    if area(corners) <= 0.0:
        return False
    others = polygon[[index for index in left if index not in ear]]
    inside = np.ones(len(others), dtype=bool)
    for start, end in ((0, 1), (1, 2), (2, 0)):
        along = corners[end] - corners[start]
        away = others - corners[start]
        inside &= along[0] * away[:, 1] - along[1] * away[:, 0] >= 0.0
    repeated = (others[:, np.newaxis] == corners).all(axis=2).any(axis=1)
    return not (inside & ~repeated).any()


def _polygon(places: Sequence[Place]) -> Polygon:
    # Without repeated corners, and those on the line between their neighbours.
    corners: Polygon = np.array(places)
    corners = corners[(corners != np.roll(corners, 1, axis=0)).any(axis=1)]
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    bends: NDArray[np.bool_] = before[:, 0] * after[:, 1] != before[:, 1] * after[:, 0]
    return np.asarray(corners[bends])


def _joints(table: Table, room: tuple[float, float]) -> Iterator[_Joint]:
    # Counter-clockwise from the corner at low x and low y.
    mouths = {mouth.name: mouth for mouth in table.mouths}
    x, y = 0.5 * table.length, 0.5 * table.width
    right, left, up, down = (1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)

    def corner(name: str, sign_x: float, sign_y: float, inward: tuple[Place, Place]) -> _Joint:
        return _Joint((sign_x * room[0], sign_y * room[1]), (sign_x * x, sign_y * y), mouths.get(name), inward)

    yield corner("x_min_y_min", -1.0, -1.0, (right, up))
    if "y_min" in mouths:
        yield _Joint((0.0, -room[1]), (0.0, -y), mouths["y_min"], (up, up))
    yield corner("x_max_y_min", 1.0, -1.0, (up, left))
    yield corner("x_max_y_max", 1.0, 1.0, (left, down))
    if "y_max" in mouths:
        yield _Joint((0.0, room[1]), (0.0, y), mouths["y_max"], (down, down))
    yield corner("x_min_y_max", -1.0, 1.0, (down, right))


def _sights(table: Table, behind: float) -> Iterator[Place]:
    # Behind the noses by so many m; none where a pocket is.
    if not behind:
        return
    x, y = 0.5 * table.length, 0.5 * table.width
    for eighth in range(-3, 4):
        if eighth or table.side_pocket is None:
            yield from ((0.25 * eighth * x, sign * (y + behind)) for sign in (-1.0, 1.0))
    for quarter in (-0.5, 0.0, 0.5):
        yield from ((sign * (x + behind), quarter * y) for sign in (-1.0, 1.0))


def _edges(joint: _Joint) -> tuple[Edge, Edge]:
    # Of the cushion before the pocket and of the one after it, counter-clockwise.
    assert joint.mouth is not None
    one, other = joint.mouth.edges
    x, y = joint.mouth.centre
    turn = (one.point[0] - x) * (other.point[1] - y) - (one.point[1] - y) * (other.point[0] - x)
    return (other, one) if turn > 0.0 else (one, other)


def _round(centre: Place, radius: float, begin: float, turn: float) -> list[Place]:
    # Points of an arc from an angle on.
    count = max(math.ceil(abs(turn) / ARC_STEP), 1)
    angles = [begin + turn * step / count for step in range(count + 1)]
    return [(centre[0] + radius * math.cos(angle), centre[1] + radius * math.sin(angle)) for angle in angles]


def _circle(mouth: Mouth, begin: float, turn: float) -> list[Place]:
    return _round(mouth.centre, mouth.pocket.slate_radius, begin, turn)


def _angle(mouth: Mouth, place: Place) -> float:
    # At which a place is seen from the middle of the circle.
    return math.atan2(place[1] - mouth.centre[1], place[0] - mouth.centre[0])


def _turn(begin: float, end: float) -> float:
    # The short way.
    return math.remainder(end - begin, 2.0 * math.pi)


def _profile(edge: Edge, inward: Place, rounding: float) -> list[Place]:
    # From the nose around the point to where the jaw begins.
    begin, end = (math.atan2(y, x) for x, y in (inward, edge.normal))
    return _round(edge.point, rounding, begin, _turn(begin, end))


def _bed(joint: _Joint) -> list[Place]:
    # Of the cloth, from the nose before a joint to the one after it.
    mouth = joint.mouth
    if mouth is None:
        return [joint.corner]
    before, after = _edges(joint)
    rounding = mouth.pocket.point_radius
    cut_before, cut_after = (_cut(mouth, edge) for edge in (before, after))
    begin, end = (_angle(mouth, cut[-1]) for cut in (cut_before, cut_after))
    return [
        *_profile(before, joint.inward[0], rounding),
        *cut_before[:-1],
        *_circle(mouth, begin, _turn(begin, end)),
        *reversed(cut_after[:-1]),
        *reversed(_profile(after, joint.inward[1], rounding)),
    ]


def _cut(mouth: Mouth, edge: Edge) -> list[Place]:
    # Where the slate ends at a jaw: on it, or beyond its end.
    radius = mouth.pocket.slate_radius
    if math.dist(edge.end, mouth.centre) >= radius:
        return [edge.end, _towards(mouth.centre, edge.end, radius)]
    return [_crossing(edge.end, edge.start, mouth.centre, radius)]


def _towards(centre: Place, place: Place, radius: float) -> Place:
    share = radius / math.dist(centre, place)
    return centre[0] + share * (place[0] - centre[0]), centre[1] + share * (place[1] - centre[1])


def _crossing(inside: Place, outside: Place, centre: Place, radius: float) -> Place:
    # Where a line from inside a circle leaves it: |a + s d| = r with s > 0; the inner end, if there is no way.
    x, y = outside[0] - inside[0], outside[1] - inside[1]
    from_x, from_y = inside[0] - centre[0], inside[1] - centre[1]
    square, half = x * x + y * y, x * from_x + y * from_y
    root = half * half - square * (from_x * from_x + from_y * from_y - radius * radius)
    share = (math.sqrt(max(root, 0.0)) - half) / square
    return inside[0] + share * x, inside[1] + share * y


def _cushion(one: _Joint, other: _Joint, depth: float) -> list[Place]:
    # From its back at the first joint along the nose to its back at the other one.
    inward = one.inward[1]
    places: list[Place] = []
    for joint, edge_of, back in ((one, 1, False), (other, 0, True)):
        if joint.mouth is None:
            behind = (
                joint.corner[0] - depth * (joint.inward[0][0] + joint.inward[1][0]),
                joint.corner[1] - depth * (joint.inward[0][1] + joint.inward[1][1]),
            )
            side = [behind, joint.corner]
        else:
            edge = _edges(joint)[edge_of]
            side = [edge.end, *reversed(_profile(edge, inward, joint.mouth.pocket.point_radius))]
        places += reversed(side) if back else side
    return places[::-1]  # the table lies to the left of the way, the cushion to the right


def _wood(one: _Joint, other: _Joint, depth: float, inner: tuple[float, float]) -> list[Place]:
    places = [one.outer, other.outer]
    places += _hole_side(other, 0, depth, inner)
    places += reversed(_hole_side(one, 1, depth, inner))
    return places


def _hole_side(joint: _Joint, edge_of: int, depth: float, inner: tuple[float, float]) -> list[Place]:
    # From the back of a pocket, or the corner of the cushions' backs, to the back of a cushion.
    mouth, (x, y) = joint.mouth, joint.corner
    if mouth is None:
        back_x, back_y = (joint.inward[0][axis] + joint.inward[1][axis] for axis in (0, 1))
        return [(x - depth * back_x, y - depth * back_y)]
    edge = _edges(joint)[edge_of]
    inward = joint.inward[edge_of]
    end, radius = edge.end, mouth.pocket.slate_radius
    meeting, extra = end, [end]
    if math.dist(end, mouth.centre) < radius:
        away = end[0] - mouth.centre[0], end[1] - mouth.centre[1]
        along = (-inward[1], inward[0])
        sign = math.copysign(1.0, along[0] * away[0] + along[1] * away[1])
        meeting, extra = _crossing(end, (end[0] + sign * along[0], end[1] + sign * along[1]), mouth.centre, radius), []
    begin, stop = _angle(mouth, joint.outer), _angle(mouth, meeting)
    return [*_clipped(_circle(mouth, begin, _turn(begin, stop)), inner), *extra]


def _clipped(places: list[Place], inner: tuple[float, float]) -> list[Place]:
    return [(max(-inner[0], min(inner[0], x)), max(-inner[1], min(inner[1], y))) for x, y in places]
