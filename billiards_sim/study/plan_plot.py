# SPDX-License-Identifier: Apache-2.0
"""The picture of a plan: the best shot, and where a shooter's noise leads it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from billiards_sim.colours import ball_colour
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.noise import ShooterNoise
from billiards_sim.study.falls import falls
from billiards_sim.study.plan import Plan
from billiards_sim.study.plots import RESOLUTION, draw_ball, draw_paths, draw_table, picture_size
from billiards_sim.study.recording import Recording, record
from billiards_sim.study.time_stepping import TIME_STEP

PATHS = 40
"""Noisy runs whose paths are drawn."""

MOVED = 1e-3
"""m. A ball that noise leaves closer to its start than this has no spread to draw."""


def draw_plan(plan: Plan, noise: ShooterNoise | None, seed: int, path: Path) -> None:
    """Draw the best shot: its paths without noise, thin ones with, and a dot where each sample ends.

    Raises:
        OSError: the file cannot be written.
    """
    scene, best = plan.scene, plan.rows[0]
    figure = Figure(figsize=picture_size(scene.table), layout="constrained")
    axes = figure.subplots()
    draw_table(axes, scene.table)
    recording = _played(plan, best.aim)
    fallen = falls(scene, recording.events)
    if noise is not None:
        _draw_spread(axes, plan, noise, seed)
    draw_paths(axes, recording, fallen)
    for index in np.flatnonzero(scene.in_play).tolist():
        position = fallen[index].place if index in fallen else recording.end.positions[index]
        draw_ball(axes, position, scene.physics.radius, scene.names[index])
    axes.set_title(_title(plan))
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    figure.legend(handles=_legend(noise), loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(path, dpi=RESOLUTION)


def _played(plan: Plan, aim: Aim) -> Recording:
    return record(replace(plan.scene, shot=aim.shot(plan.scene.physics)), "event", TIME_STEP, None)


def _draw_spread(axes: Axes, plan: Plan, noise: ShooterNoise, seed: int) -> None:
    scene, result = plan.scene, plan.found.result
    shot = plan.found.shots.columns()[:1]
    for noisy in noise.samples(shot, 0, PATHS, seed)[0].tolist():
        aim = Aim(*noisy)
        if math.hypot(aim.side, aim.up) > scene.physics.miscue_limit:
            continue
        recording = _played(plan, aim)
        fallen = falls(scene, recording.events)
        for index in np.flatnonzero(scene.in_play).tolist():
            line = recording.path(scene.names[index])[:, 1:]
            line = line[:-1] if index in fallen else line
            axes.plot(*line.T, color=ball_colour(scene.names[index]), linewidth=0.5, alpha=0.35, zorder=1.5)
    for index in np.flatnonzero(scene.in_play).tolist():
        stays = result.in_play[0, :, index] & (result.error[0] == 0)
        ends = result.positions[0, stays, index]
        ends = ends[np.hypot(*(ends - scene.positions[index]).T) > MOVED]
        axes.plot(*ends.T, **_dots(ball_colour(scene.names[index])))


def _dots(colour: tuple[float, float, float]) -> dict[str, Any]:
    return {
        "linestyle": "none",
        "marker": "o",
        "markersize": 3.0,
        "markerfacecolor": colour,
        "markeredgecolor": "black",
        "markeredgewidth": 0.3,
        "alpha": 0.8,
        "zorder": 4.0,
    }


def _title(plan: Plan) -> str:
    best = plan.rows[0]
    what = f"ball {best.kind.ball} into {best.kind.pocket}, {best.kind.kind}" if best.kind.ball else best.kind.kind
    return (
        f"{what}: {best.aim.speed:.2f} m/s at {math.degrees(math.remainder(best.aim.azimuth, math.tau)):.2f} deg, "
        f"side {best.aim.side:.2f}, up {best.aim.up:.2f}; {100.0 * best.success:.1f} % succeed"
    )


def _legend(noise: ShooterNoise | None) -> list[Line2D]:
    marks = [
        Line2D([], [], linestyle="none", marker="o", markersize=10.0, color="0.8", label="start"),
        Line2D([], [], linestyle="none", marker="o", markersize=10.0, color="0.5", markeredgecolor="k", label="end"),
    ]
    if noise is not None:
        marks.append(Line2D([], [], color="0.5", linewidth=0.5, label=f"{PATHS} runs with noise"))
        marks.append(Line2D([], [], **_dots((0.6, 0.6, 0.6)), label="end with noise"))
    return marks
