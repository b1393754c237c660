"""Markers seen from straight above, as RViz shows them.

A pixel shows the highest solid below it, lit from the camera; what is translucent is blended over that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from geometry_msgs.msg import Pose
from numpy.typing import NDArray
from visualization_msgs.msg import Marker

from billiards_sim.study.movie import rotations

SAMPLES = 3
"""Points along a pixel's side at which the markers are looked at."""

BAND = 64
"""Rows of pixels that are drawn at a time, for the memory's sake."""

AMBIENT = 0.4
"""Share of its colour that a surface seen edge on shows."""

OPAQUE = 0.9998
"""Opacity from which on RViz does not blend."""

Array = NDArray[np.float64]
Colour = tuple[float, float, float]
Part = tuple[slice, slice]


@dataclass(frozen=True)
class View:
    """A view straight down.

    Attributes:
        centre: (x, y) m, in the middle.
        scale: pixels a metre.
        angle: rad, by which the camera is turned counter-clockwise.
        size: pixels (width, height).
        background: red green blue.
        frame: of the coordinates.
    """

    centre: tuple[float, float]
    scale: float
    angle: float
    size: tuple[int, int]
    background: Colour
    frame: str


def draw(shown: Iterable[Marker], view: View) -> Array:
    """Markers seen from above: (height, width, 3) red green blue, from 0 to 1.

    Raises:
        ValueError: a marker of a type that is not drawn here, or in another frame than the view.
    """
    seen = list(shown)
    for marker in seen:
        if marker.header.frame_id != view.frame:
            raise ValueError(f"{_name(marker)} is in frame {marker.header.frame_id!r}, not {view.frame!r}")
        if marker.type not in PAINTERS:
            raise ValueError(f"{_name(marker)} is of type {marker.type}, which is not drawn here")
    height = view.size[1]
    return np.concatenate([_draw_band(seen, view, top, min(top + BAND, height)) for top in range(0, height, BAND)])


def _draw_band(seen: Iterable[Marker], view: View, top: int, bottom: int) -> Array:
    canvas = _Canvas(view, top, bottom)
    for marker in seen:
        PAINTERS[marker.type](canvas, marker)
    return canvas.picture()


def _name(marker: Marker) -> str:
    return f"marker {marker.ns}/{marker.id}"


class _Canvas:
    # Colours and heights at the sample points of a band, the rows of pixels from `top` to `bottom`; translucent layers
    # wait for the end.

    def __init__(self, view: View, top: int, bottom: int) -> None:
        self._view = view
        self._top, self._bottom = SAMPLES * top, SAMPLES * bottom
        shape = (self._bottom - self._top, SAMPLES * view.size[0])
        self._colours = np.tile(np.array(view.background), (*shape, 1))
        self._heights = np.full(shape, -np.inf)
        self._layers: list[tuple[float, Part, Array, Array, Array]] = []

    def near(self, x: float, y: float, reach: float) -> tuple[Part, Array, Array]:
        """A part of the band that holds all within a distance (m) of a point, and the x and y (m) of its samples."""
        width, height = (SAMPLES * side for side in self._view.size)
        scale = SAMPLES * self._view.scale
        cosine, sine = math.cos(self._view.angle), math.sin(self._view.angle)
        to_x, to_y = x - self._view.centre[0], y - self._view.centre[1]
        across, down = (cosine * to_x + sine * to_y) * scale, (sine * to_x - cosine * to_y) * scale
        columns = _samples(0.5 * width + across, reach * scale, 0, width)
        rows = _samples(0.5 * height + down, reach * scale, self._top, self._bottom)
        right = (np.array(columns) + 0.5 - 0.5 * width) / scale
        up = (0.5 * height - np.array(rows)[:, np.newaxis] - 0.5) / scale
        part = (slice(rows.start - self._top, rows.stop - self._top), slice(columns.start, columns.stop))
        xs = self._view.centre[0] + cosine * right - sine * up
        ys = self._view.centre[1] + sine * right + cosine * up
        return part, xs, ys

    def put(self, part: Part, heights: Array, colours: Array, opacity: Array) -> None:
        """A surface: heights (m, NaN where there is none), colours (..., 3) and opacity in a part of the picture."""
        seen = heights >= self._heights[part]
        if opacity[seen].min(initial=1.0) < OPAQUE:
            self._layers.append((float(heights[seen].max()), part, heights, colours, opacity))
            return
        self._heights[part][seen] = heights[seen]
        self._colours[part][seen] = colours[seen]

    def picture(self) -> Array:
        for _, part, heights, colours, opacity in sorted(self._layers, key=lambda layer: layer[0]):
            seen = heights >= self._heights[part]
            below = self._colours[part][seen]
            self._colours[part][seen] = below + opacity[seen, np.newaxis] * (colours[seen] - below)
        height, width = (side // SAMPLES for side in self._heights.shape)
        small: Array = self._colours.reshape(height, SAMPLES, width, SAMPLES, 3).mean(axis=(1, 3))
        return small


def _samples(middle: float, reach: float, begin: int, end: int) -> range:
    first, last = (min(max(math.floor(middle + side), begin), end) for side in (-reach, reach + 1.0))
    return range(first, last)


class Crossing(NamedTuple):
    """Where rays q = a + t b meet a condition, one of those that together make a solid of size 1 about the origin.

    A ray leaves the solid, upwards, where the first of its conditions ends to hold, and that one gives the normal.

    Attributes:
        begin, end: t between which it holds, NaN where it never does.
        normal: outward at points q of its boundary, of any length.
    """

    begin: Array
    end: Array
    normal: Callable[[Array], Array]


Solid = Callable[[Array, Array], list[Crossing]]


def _slab(axis: int, a: Array, b: Array) -> Crossing:
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack(((-0.5 - a[..., axis]) / b[axis], (0.5 - a[..., axis]) / b[axis]))
    return Crossing(ends.min(axis=0), ends.max(axis=0), lambda q: np.sign(q[..., axis : axis + 1]) * np.eye(3)[axis])


def _round(axes: tuple[int, ...], a: Array, b: Array) -> Crossing:
    kept = np.isin(range(3), axes)
    across, along = a * kept, b * kept
    square, middle = float(along @ along), across @ along
    rest = np.sum(across * across, axis=-1) - 0.25
    if square == 0.0:  # along the axis of a cylinder
        begin, end = (np.where(rest <= 0.0, side, np.nan) for side in (-np.inf, np.inf))
    else:
        with np.errstate(invalid="ignore"):
            root = np.sqrt(middle * middle - square * rest)
        begin, end = (-middle - root) / square, (-middle + root) / square
    return Crossing(begin, end, lambda q: q * kept)


def _cube(a: Array, b: Array) -> list[Crossing]:
    return [_slab(axis, a, b) for axis in range(3)]


def _sphere(a: Array, b: Array) -> list[Crossing]:
    return [_round((0, 1, 2), a, b)]


def _cylinder(a: Array, b: Array) -> list[Crossing]:
    return [_round((0, 1), a, b), _slab(2, a, b)]


def _rotation(pose: Pose) -> Array:
    # (3, 3), from the marker's axes to those of its frame
    turn = pose.orientation
    matrix: Array = rotations(np.array([(turn.x, turn.y, turn.z, turn.w)]))[0]
    return matrix


def _points(marker: Marker) -> Array:
    # (P, 3) m, in the frame of the header
    at = marker.pose.position
    points = np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3)
    placed: Array = points @ _rotation(marker.pose).T + (at.x, at.y, at.z)
    return placed


def _put_solid(canvas: _Canvas, marker: Marker, centre: Array, rotation: Array, solid: Solid) -> None:
    scale = np.array((marker.scale.x, marker.scale.y, marker.scale.z))
    reach = 0.5 * float(np.linalg.norm(scale))
    part, x, y = canvas.near(float(centre[0]), float(centre[1]), reach)
    start = np.stack((x - centre[0], y - centre[1], np.full_like(x, -centre[2])), axis=-1)
    a, b = start @ rotation / scale, rotation[2] / scale
    found = solid(a, b)
    begins, ends = np.stack([one.begin for one in found]), np.stack([one.end for one in found])
    with np.errstate(invalid="ignore"):
        heights = np.where(begins.max(axis=0) <= ends.min(axis=0), ends.min(axis=0), np.nan)
    surface = a + heights[..., np.newaxis] * b
    first = ends.argmin(axis=0)[..., np.newaxis]
    normals = np.select([first == index for index in range(len(found))], [one.normal(surface) for one in found])
    normals = normals / scale @ rotation.T
    with np.errstate(invalid="ignore", divide="ignore"):
        facing = np.abs(normals[..., 2:]) / np.linalg.norm(normals, axis=-1, keepdims=True)
    colours = (AMBIENT + (1.0 - AMBIENT) * facing) * (marker.color.r, marker.color.g, marker.color.b)
    canvas.put(part, heights, colours, np.full_like(heights, marker.color.a))


def _put_shape(solid: Solid) -> Callable[[_Canvas, Marker], None]:
    def put(canvas: _Canvas, marker: Marker) -> None:
        at = marker.pose.position
        _put_solid(canvas, marker, np.array((at.x, at.y, at.z)), _rotation(marker.pose), solid)

    return put


def _put_spheres(canvas: _Canvas, marker: Marker) -> None:
    for point in _points(marker):
        _put_solid(canvas, marker, point, _rotation(marker.pose), _sphere)


def _put_line(canvas: _Canvas, marker: Marker) -> None:
    points = _points(marker)
    if len(points) < 2:
        return
    own = marker.colors if len(marker.colors) == len(points) else [marker.color] * len(points)
    colours = np.array([(colour.r, colour.g, colour.b, colour.a) for colour in own])
    half = 0.5 * marker.scale.x
    low, high = points.min(axis=0), points.max(axis=0)
    middle, reach = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low)) + half
    part, x, y = canvas.near(float(middle[0]), float(middle[1]), reach)
    nearest = np.full(x.shape, np.inf)
    heights = np.full(x.shape, np.nan)
    painted = np.zeros((*x.shape, 4))
    for index, (start, end) in enumerate(zip(points, points[1:])):
        way = (end - start)[:2]
        square = float(way @ way) or 1.0
        along = np.clip(((x - start[0]) * way[0] + (y - start[1]) * way[1]) / square, 0.0, 1.0)
        distance = np.hypot(x - start[0] - along * way[0], y - start[1] - along * way[1])
        closer = (distance <= half) & (distance < nearest)
        share = along[closer]
        nearest[closer] = distance[closer]
        heights[closer] = start[2] + share * (end[2] - start[2])
        painted[closer] = colours[index] + share[:, np.newaxis] * (colours[index + 1] - colours[index])
    canvas.put(part, heights, painted[..., :3], painted[..., 3])


PAINTERS: Mapping[int, Callable[[_Canvas, Marker], None]] = {
    Marker.CUBE: _put_shape(_cube),
    Marker.SPHERE: _put_shape(_sphere),
    Marker.CYLINDER: _put_shape(_cylinder),
    Marker.SPHERE_LIST: _put_spheres,
    Marker.LINE_STRIP: _put_line,
}
