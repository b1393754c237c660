# SPDX-License-Identifier: Apache-2.0
"""Pictures of a run: the table from above, to scale, with the balls' paths and contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import compress
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, PathPatch, Polygon, Rectangle
from matplotlib.textpath import TextPath
from matplotlib.transforms import Affine2D

from billiards_sim.colours import DISC, HOLE, MARKING, STRIPE, WHITE, WOOD, ball_colour, is_plain, is_striped
from billiards_sim.engine.events import Event
from billiards_sim.engine.markings import lines, spots
from billiards_sim.engine.table import Table
from billiards_sim.outline import outline
from billiards_sim.study.falls import Fall, falls
from billiards_sim.study.recording import Recording
from billiards_sim.study.time_stepping import Array

CLOTH = (0.55, 0.76, 0.66)
"""Paler than cloth is, so that green, black and white paths can all be told from it."""

RUBBER = (0.43, 0.66, 0.56)
"""Of cushions, likewise."""

BLACK = (0.0, 0.0, 0.0)
"""The edge of a ball on the cloth; that of one in a hole is white."""

WIDTH = 11.0
"""in. Width of a picture; its height follows the table's, between `HEIGHTS`."""

HEIGHTS = (4.0, 11.0)
"""in. Shortest and tallest picture."""

MARGINS = (0.8, 1.4)
"""in. About what axis labels, title and legend take of the width and of the height."""

RESOLUTION = 150
"""Pixels an inch: numbers on the balls can be read where the picture is shown at full width."""

SPOT_RADIUS = 0.006
"""m, of the spots on the cloth."""

LONGEST_NUMBER = 3
"""Characters of a name that fit on a ball; a longer one stands above it."""

CONTACTS = {"ball_ball": ("o", "contact of two balls"), "ball_rail": ("D", "contact with a rail")}
"""Marker and legend of contacts, by kind of event."""


def draw_run(recording: Recording, path: Path, title: str = "") -> None:
    """Draw a run from above: start positions pale, end positions full, paths between, contacts marked.

    Args:
        path: of the picture; its ending gives the format.

    Raises:
        OSError: the file cannot be written.
    """
    scene = recording.scene
    figure = Figure(figsize=picture_size(scene.table), layout="constrained")
    axes = figure.subplots()
    draw_table(axes, scene.table)
    fallen = falls(scene, recording.events)
    draw_paths(axes, recording, fallen)
    _draw_contacts(axes, recording.events)
    for index in np.flatnonzero(scene.in_play).tolist():
        fell = index in fallen
        position = fallen[index].place if fell else recording.end.positions[index]
        draw_ball(axes, position, scene.physics.radius, scene.names[index], WHITE if fell else BLACK)
    axes.set_title(title)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    figure.legend(handles=_legend(), loc="outside lower center", ncols=6, frameon=False)
    figure.savefig(path, dpi=RESOLUTION)


def draw_table(axes: Axes, table: Table) -> None:
    """Cloth, cushions, rails and pockets from above, in the frame `table`, and the limits of the picture."""
    parts = outline(table)
    (left, right), (low, high) = parts.outer
    axes.add_patch(Rectangle((left, low), right - left, high - low, facecolor=WOOD, zorder=0))
    for polygons, colour, zorder in (
        ([parts.cloth], CLOTH, 1.0),
        (parts.holes, HOLE, 1.1),
        (parts.cushions, RUBBER, 1.2),
    ):
        for polygon in polygons:
            axes.add_patch(Polygon(polygon, facecolor=colour, zorder=zorder))
    for line in lines(table):
        axes.add_patch(Polygon(line, closed=False, fill=False, edgecolor=MARKING, linewidth=0.8, zorder=1.05))
    for spot in spots(table).values():
        axes.add_patch(Circle(spot, SPOT_RADIUS, facecolor=MARKING, zorder=1.05))
    margin = 0.01 * (right - left)
    axes.set_xlim(left - margin, right + margin)
    axes.set_ylim(low - margin, high + margin)
    axes.set_aspect("equal")


def draw_ball(axes: Axes, centre: Array, radius: float, name: str, edge: tuple[float, float, float] = BLACK) -> None:
    """A pool ball with its number up, and an edge of a colour."""
    x, y = centre.tolist()
    striped = is_striped(name)
    face = (1.0, 1.0, 1.0) if striped else ball_colour(name)
    ball = Circle((x, y), radius, facecolor=face, edgecolor=edge, linewidth=0.6, zorder=5)
    axes.add_patch(ball)
    if striped:
        corner = (x - radius, y - STRIPE * radius)
        band = Rectangle(corner, 2.0 * radius, 2.0 * STRIPE * radius, facecolor=ball_colour(name), zorder=6)
        axes.add_patch(band)
        band.set_clip_path(ball)
    if len(name) > LONGEST_NUMBER and not is_plain(name):
        paper = {"facecolor": "white", "alpha": 0.7, "linewidth": 0.0, "pad": 1.0}
        axes.text(x, y + 1.3 * radius, name, ha="center", va="bottom", fontsize=8.0, bbox=paper, zorder=9)
    elif not is_plain(name):
        axes.add_patch(Circle((x, y), DISC * radius, facecolor="white", zorder=7))
        _draw_name(axes, x, y, DISC * radius, name)


def _draw_name(axes: Axes, x: float, y: float, radius: float, name: str) -> None:
    # As a shape of the table's size, not as text of the page's: it fits the disc on every table.
    text = TextPath((0.0, 0.0), name, size=1.0, prop=FontProperties(weight="bold"))
    box = text.get_extents()
    scale = min(1.25 * radius / box.height, 1.75 * radius / float((box.width**2 + box.height**2) ** 0.5))
    middle = (0.5 * (box.x0 + box.x1), 0.5 * (box.y0 + box.y1))
    place = Affine2D().translate(-middle[0], -middle[1]).scale(scale).translate(x, y)
    axes.add_patch(PathPatch(text.transformed(place), facecolor="black", linewidth=0.0, zorder=8))


def draw_paths(axes: Axes, recording: Recording, fallen: Mapping[int, Fall]) -> None:
    """The paths of all balls, those that fall as far as their pocket, and pale balls where they began."""
    radius = recording.scene.physics.radius
    for index, name in compress(enumerate(recording.scene.names), recording.scene.in_play):
        style = (0, (4.0, 1.0)) if is_striped(name) else "solid"
        path = recording.path(name)
        if index in fallen:
            path = path[:-1]  # as far as the slate
        axes.plot(*path[:, 1:].T, color=ball_colour(name), linewidth=1.5, linestyle=style, zorder=2)
        start = recording.start.positions[index].tolist()
        face, edge = (*ball_colour(name), 0.3), (0.0, 0.0, 0.0, 0.3)
        axes.add_patch(Circle(start, radius, facecolor=face, edgecolor=edge, linewidth=0.6, zorder=3))


def _draw_contacts(axes: Axes, events: Sequence[Event]) -> None:
    for kind in CONTACTS:
        points = [event.point for event in events if event.kind == kind]
        axes.add_line(_contact_marks(kind, points))


def _contact_marks(kind: str, points: Sequence[tuple[float, float]]) -> Line2D:
    x, y = [point[0] for point in points], [point[1] for point in points]
    marker, label = CONTACTS[kind]
    marks = Line2D(x, y, linestyle="none", marker=marker, markersize=3.0, label=label, zorder=6.5)
    marks.set(markerfacecolor="white", markeredgecolor="black", markeredgewidth=0.7)
    return marks


def _legend() -> list[Line2D]:
    start = Line2D([], [], linestyle="none", marker="o", markersize=10.0, color="0.8", label="start")
    end = Line2D([], [], linestyle="none", marker="o", markersize=10.0, color="0.5", label="end")
    end.set(markeredgecolor="black", markeredgewidth=0.6)
    return [start, end, *(_contact_marks(kind, ()) for kind in CONTACTS)]


def picture_size(table: Table) -> tuple[float, float]:
    """Of a picture of a table, in."""
    outer = (table.length + 2.0 * table.rail_thickness, table.width + 2.0 * table.rail_thickness)
    height = (WIDTH - MARGINS[0]) * outer[1] / outer[0] + MARGINS[1]
    return WIDTH, min(max(height, HEIGHTS[0]), HEIGHTS[1])
