"""Pictures of a run: the table from above, to scale, with the balls' paths.

`python3 -m billiards_sim.study.plots F.png` draws an eight-ball break.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Rectangle

from billiards_sim.colours import WOOD, ball_colour
from billiards_sim.engine import scenes
from billiards_sim.engine.simulation import Simulation
from billiards_sim.engine.table import Table

PATH_STEP = 0.001
"""s between two points of a path: at 8 m/s corners are cut by less than 8 mm, half a line's width on paper."""

CLOTH = (0.55, 0.76, 0.66)
"""Paler than cloth is, so that green, black and white paths can all be told from it."""

BREAK_FORCE = (128.0, 1.5, 0.0)
"""N. 8 m/s with the default physics, a little off the centre of the rack: an ordinary break."""


def draw_run(simulation: Simulation, path: Path, title: str = "") -> None:
    """Run a simulation to rest and draw it: start positions pale, end positions full, paths between.

    Args:
        simulation: at its start, a shot played if the scene rests.
        path: of the picture; the ending gives the format.
    """
    scene = simulation.scene
    radius = scene.physics.radius
    frames = [simulation.positions]
    while not simulation.at_rest:
        simulation.advance(PATH_STEP)
        frames.append(simulation.positions)
    track = np.array(frames)
    figure, axes = plt.subplots(figsize=(11.0, 6.0), layout="constrained")
    draw_table(axes, scene.table)
    for index, name in enumerate(scene.names):
        colour = ball_colour(name)
        axes.plot(*track[:, index].T, color=colour, linewidth=1.3, zorder=2)
        axes.add_patch(Circle(track[0, index], radius, facecolor=colour, alpha=0.3, zorder=3))
    for index, name in enumerate(scene.names):
        _draw_ball(axes, track[-1, index], radius, name)
    axes.set_title(title)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def draw_table(axes: Axes, table: Table) -> None:
    """Cloth and rails from above, in the frame `table`, and the limits of the picture."""
    outer = (table.x_max + table.rail_thickness, table.y_max + table.rail_thickness)
    axes.add_patch(Rectangle((0.0, 0.0), *outer, facecolor=WOOD, zorder=0))
    nose = (table.x_min, table.y_min)
    axes.add_patch(Rectangle(nose, table.length, table.width, facecolor=CLOTH, zorder=1))
    axes.set_xlim(-0.02, outer[0] + 0.02)
    axes.set_ylim(-0.02, outer[1] + 0.02)
    axes.set_aspect("equal")


def _draw_ball(axes: Axes, centre: np.ndarray, radius: float, name: str) -> None:
    colour = ball_colour(name)
    stripe = name.isdigit() and int(name) > 8
    edge = (0.0, 0.0, 0.0)
    face = (1.0, 1.0, 1.0) if stripe else colour
    disc = Circle((centre[0], centre[1]), radius, facecolor=face, edgecolor=edge, linewidth=0.6, zorder=4)
    axes.add_patch(disc)
    if stripe:
        corner = (centre[0] - radius, centre[1] - 0.55 * radius)
        band = Rectangle(corner, 2.0 * radius, 1.1 * radius, facecolor=colour, zorder=5)
        axes.add_patch(band)
        band.set_clip_path(disc)
    if name != "cue":
        axes.add_patch(Circle((centre[0], centre[1]), 0.45 * radius, facecolor="white", zorder=6))
        axes.text(centre[0], centre[1], name, ha="center", va="center_baseline", fontsize=5.5, zorder=7)


def main() -> int:
    parser = argparse.ArgumentParser(description="Draw an eight-ball break at 8 m/s from the engine.")
    parser.add_argument("picture", type=Path, help="where to write it, for instance break.png")
    simulation = Simulation(scenes.eight_ball())
    simulation.strike(BREAK_FORCE)
    title = "Eight-ball break at 8 m/s: paths, start (pale) and end positions"
    draw_run(simulation, parser.parse_args().picture, title)
    return 0


if __name__ == "__main__":
    sys.exit(main())
