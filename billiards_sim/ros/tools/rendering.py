# SPDX-License-Identifier: Apache-2.0
"""Markers seen from straight above, drawn with matplotlib."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from geometry_msgs.msg import Point
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.patches import Circle, Patch, Rectangle
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

from billiards_sim.quaternion import rotation_matrices

EDGE = 0.6
"""Brightness of the outline of a solid: from above it stands for the shade of its sides."""

LEVEL = 1e-6
"""Inclination, rad, that rounding gives to what is level or upright."""

POINTS_PER_INCH = 72
"""Of matplotlib's line widths."""


@dataclass(frozen=True)
class View:
    """A view straight down.

    Attributes:
        centre: (x, y) m, in the middle.
        scale: pixels a metre.
        size: pixels (width, height).
        background: red green blue.
        frame: of the coordinates.
    """

    centre: tuple[float, float]
    scale: float
    size: tuple[int, int]
    background: tuple[float, float, float]
    frame: str


def draw(axes: Axes, shown: Iterable[Marker], view: View) -> None:
    """Draw markers, the higher ones over the lower ones.

    Args:
        axes: with as many pixels as the view.

    Raises:
        ValueError: a marker in another frame than the view, of a type that is not drawn here, or inclined.
    """
    axes.set_axis_off()
    (x, y), half_length, half_width = view.centre, *(0.5 * pixels / view.scale for pixels in view.size)
    axes.set_xlim(x - half_length, x + half_length)
    axes.set_ylim(y - half_width, y + half_width)
    dots_per_metre = view.scale / axes.figure.dpi * POINTS_PER_INCH
    for marker in shown:
        name = f"marker {marker.ns}/{marker.id}"
        if marker.header.frame_id != view.frame:
            raise ValueError(f"{name} is in frame {marker.header.frame_id!r}, not {view.frame!r}")
        if marker.type in (Marker.LINE_STRIP, Marker.LINE_LIST):
            _draw_line(axes, marker, dots_per_metre)
        elif marker.type == Marker.TRIANGLE_LIST:
            _draw_triangles(axes, marker)
        elif marker.type in SHAPES:
            for point in marker.points if marker.type == Marker.SPHERE_LIST else [Point()]:
                try:
                    _draw_solid(axes, marker, point)
                except ValueError as error:
                    raise ValueError(f"{name} {error}") from None
        else:
            raise ValueError(f"{name} is of type {marker.type}, which is not drawn here")


def _draw_solid(axes: Axes, marker: Marker, point: Point) -> None:
    at = marker.pose.position
    patch, height = SHAPES[marker.type](marker, at.x + point.x, at.y + point.y)
    red, green, blue, opacity = _rgba(marker.color)
    patch.set_facecolor((red, green, blue, opacity))
    patch.set_edgecolor((EDGE * red, EDGE * green, EDGE * blue, opacity))
    patch.set_zorder(at.z + point.z + 0.5 * height)
    axes.add_patch(patch)


def _draw_line(axes: Axes, marker: Marker, dots_per_metre: float) -> None:
    points = np.array([(point.x, point.y) for point in marker.points]).reshape(-1, 2)
    colours = marker.colors or [marker.color] * len(points)
    ends = np.array([_rgba(colour) for colour in colours]).reshape(-1, 4)
    first = slice(0, -1) if marker.type == Marker.LINE_STRIP else slice(0, None, 2)
    second = slice(1, None) if marker.type == Marker.LINE_STRIP else slice(1, None, 2)
    lines = LineCollection(
        list(np.stack((points[first], points[second]), axis=1)),
        colors=0.5 * (ends[first] + ends[second]),
        linewidths=marker.scale.x * dots_per_metre,
        zorder=max((point.z for point in marker.points), default=0.0),
    )
    axes.add_collection(lines)


def _draw_triangles(axes: Axes, marker: Marker) -> None:
    # Those that are level, by their heights; upright ones are not seen from above.
    corners = np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3, 3)
    colour = _rgba(marker.color)
    level = np.ptp(corners[:, :, 2], axis=1) == 0.0
    for height in np.unique(corners[level, 0, 2]):
        faces = corners[level & (corners[:, 0, 2] == height), :, :2]
        # Smooth edges would leave seams between them.
        axes.add_collection(PolyCollection(list(faces), facecolors=[colour], antialiaseds=False, zorder=height))


def _sphere(marker: Marker, x: float, y: float) -> tuple[Patch, float]:
    return Circle((x, y), 0.5 * marker.scale.x), marker.scale.z


def _box(marker: Marker, x: float, y: float) -> tuple[Patch, float]:
    along, up = _axis(marker, 0), _axis(marker, 2)
    if abs(up[2]) < 1.0 - LEVEL:
        raise ValueError("is inclined, which is not drawn here")
    return _rectangle(x, y, marker.scale.x, marker.scale.y, along), marker.scale.z


def _cylinder(marker: Marker, x: float, y: float) -> tuple[Patch, float]:
    axis = _axis(marker, 2)
    if abs(axis[2]) > LEVEL:
        raise ValueError("is inclined, which is not drawn here")
    return _rectangle(x, y, marker.scale.z, marker.scale.y, axis), marker.scale.x


def _rectangle(x: float, y: float, length: float, width: float, along: NDArray[np.float64]) -> Patch:
    angle = math.degrees(math.atan2(along[1], along[0]))
    return Rectangle((x - 0.5 * length, y - 0.5 * width), length, width, angle=angle, rotation_point="center")


def _axis(marker: Marker, number: int) -> NDArray[np.float64]:
    turn = marker.pose.orientation
    axis: NDArray[np.float64] = rotation_matrices(np.array([(turn.x, turn.y, turn.z, turn.w)]))[0][:, number]
    return axis


def _rgba(colour: ColorRGBA) -> tuple[float, float, float, float]:
    return colour.r, colour.g, colour.b, colour.a


SHAPES: Mapping[int, Callable[[Marker, float, float], tuple[Patch, float]]] = {
    Marker.CUBE: _box,
    Marker.SPHERE: _sphere,
    Marker.SPHERE_LIST: _sphere,
    Marker.CYLINDER: _cylinder,
}
"""Outline from above, and height (m), of a solid about a point."""
