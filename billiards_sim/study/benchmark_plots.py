# SPDX-License-Identifier: Apache-2.0
"""The benchmark's pictures: work against precision, racks after the hit, and the growth of differences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from billiards_sim.study.chaos import APART
from billiards_sim.study.plots import CLOTH, draw_ball
from billiards_sim.study.precision import CHART_TIME

DPI = 110
COLOURS = {"event": "#0b6e4f", "time_step": "#1f5fa8", "paper": "#b5341f"}
SMALLEST_ERROR = 1e-17  # m; an error of zero is drawn here


def draw_work_precision(study: dict[str, Any], path: Path) -> None:
    """A panel a scene: error at `CHART_TIME` over wall time, a line a solver.

    Args:
        study: "precision" of the results.
        path: of the picture.
    """
    columns = 4
    lines = -(-(len(study) + 1) // columns)
    figure, panels = plt.subplots(
        lines, columns, figsize=(11.0, 3.1 * lines), sharex=True, sharey=True, layout="constrained", squeeze=False
    )
    flat = list(panels.flat)
    for axes, (name, scene) in zip(flat, study.items()):
        _draw_scene(axes, name, scene)
    for axes in flat[len(study) :]:
        axes.set_axis_off()
    # The panels above an empty place are the last of their column.
    for index in range(len(study)):
        if index + columns >= len(study):
            flat[index].tick_params(labelbottom=True)
    handles, labels = flat[0].get_legend_handles_labels()
    by_label = dict(zip(labels, handles))
    labels = [
        label for solver in ("paper", "time_step", "event", "rounding") for label in labels if label.startswith(solver)
    ]
    handles = [by_label[label] for label in labels]
    flat[-1].legend(handles, labels, loc="center", fontsize=10, frameon=False)
    figure.supxlabel("wall time per simulated second (s)")
    figure.supylabel(f"largest position error at {CHART_TIME} s (m)")
    figure.savefig(path, dpi=DPI)
    plt.close(figure)


def _draw_scene(axes: Axes, name: str, scene: dict[str, Any]) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for solver, marker in (("paper", "s"), ("time_step", "o")):
        points = [point for point in scene[solver] if point["wall"] and point["position"][CHART_TIME] is not None]
        walls = [point["wall"]["median"] for point in points]
        errors = [point["position"][CHART_TIME] for point in points]
        ranges = [
            [point["wall"]["median"] - point["wall"]["low"] for point in points],
            [point["wall"]["high"] - point["wall"]["median"] for point in points],
        ]
        label = {"paper": "paper: its scheme as it stands", "time_step": "time_step: the same, corrected"}[solver]
        axes.errorbar(walls, errors, xerr=ranges, marker=marker, markersize=4, color=COLOURS[solver], label=label)
    for key, face, label in (
        ("event", COLOURS["event"], "event: this engine"),
        ("event_interpreted", "white", "event, without Numba"),
    ):
        if scene[key]:
            error = max(scene[key]["position"][CHART_TIME], SMALLEST_ERROR)
            axes.plot(
                *(scene[key]["wall"]["median"], error),
                linestyle="none",
                marker="*",
                markersize=12,
                markerfacecolor=face,
                markeredgecolor=COLOURS["event"],
                label=label,
            )
    floor = max(scene["rounding"][CHART_TIME], SMALLEST_ERROR)
    axes.axhline(floor, color="0.5", linewidth=1.0, linestyle=":", label="rounding of the start")
    title = name.replace("_", " ")
    if scene["order"]:
        title += f": order {scene['order'][0]:.2f}"
    axes.set_title(title, fontsize=10)
    axes.set_ylim(1e-17, 10.0)
    axes.set_yticks([1e-16, 1e-12, 1e-8, 1e-4, 1.0])
    axes.grid(True, color="0.9", linewidth=0.6)


AROUND_RACK = ((-0.32, 0.36), (-0.3, 0.3))
"""m, what is drawn, from the middle of the rack."""


def draw_racks(pictures: list[dict[str, Any]], path: Path) -> None:
    """A panel a rack, after the hit: rigid ones above, elastic ones below, a column a gap.

    Args:
        pictures: of "elastic" of the results.
        path: of the picture.
    """
    gaps = sorted({picture["gap"] for picture in pictures})
    figure, panels = plt.subplots(2, len(gaps), figsize=(11.0, 6.8), layout="constrained", squeeze=False)
    for picture in pictures:
        _draw_rack(panels[int(picture["elastic"]), gaps.index(picture["gap"])], picture)
    for axes, gap in zip(panels[0], gaps):
        axes.set_title(f"gaps of {gap * 1e3:g} mm" if gap else "touching", fontsize=11)
    for axes, what in zip(panels[:, 0], ("rigid impacts", "elastic contacts")):
        axes.set_ylabel(what, fontsize=11)
    figure.suptitle("Racks 50 ms after they were hit from the left at 8 m/s; pale: where they lay", fontsize=11)
    figure.savefig(path, dpi=DPI)
    plt.close(figure)


def _draw_rack(axes: Axes, picture: dict[str, Any]) -> None:
    before, after = np.array(picture["before"]), np.array(picture["after"])
    middle = before[1:].mean(axis=0)
    for start in before[1:] - middle:
        axes.add_patch(Circle(start, picture["radius"], facecolor=(1.0, 1.0, 1.0, 0.35), linewidth=0.0))
    for start, end in zip(before[1:] - middle, after[1:] - middle):
        axes.plot(*np.transpose((start, end)), color=(0.0, 0.0, 0.0, 0.35), linewidth=1.0)
    for name, place in zip(picture["names"], after - middle):
        draw_ball(axes, place, picture["radius"], name)
    axes.set_facecolor(CLOTH)
    axes.set_xlim(AROUND_RACK[0])
    axes.set_ylim(AROUND_RACK[1])
    axes.set_aspect("equal")
    axes.set_xticks([])
    axes.set_yticks([])


def draw_chaos(study: dict[str, Any], path: Path) -> None:
    """Growth of a difference over time and over collisions.

    Args:
        study: "chaos" of the results.
        path: of the picture.
    """
    figure, (left, right) = plt.subplots(1, 2, figsize=(11.0, 4.4), sharey=True, layout="constrained")
    for (name, part), colour in zip(study.items(), (COLOURS["event"], COLOURS["paper"])):
        for axes, x, key in ((left, part["time"], "by_time"), (right, part["collisions"], "by_collisions")):
            band = {level: [APART * factor for factor in part[key][level]] for level in ("low", "median", "high")}
            axes.plot(x, band["median"], color=colour, label=f"{name}: median of {part['seeds']} runs")
            axes.fill_between(x, band["low"], band["high"], color=colour, alpha=0.2, linewidth=0, label="middle 80 %")
    for axes in (left, right):
        axes.set_yscale("log")
        axes.axhline(1e-3, color="0.4", linewidth=1.0, linestyle=":")
        axes.text(0.01, 1.3e-3, "1 mm", color="0.3", fontsize=9, transform=axes.get_yaxis_transform())
        axes.grid(True, color="0.9", linewidth=0.6)
    left.set_xlabel("time (s)")
    right.set_xlabel("collisions between any two balls so far")
    left.set_ylabel(f"distance between two runs\nthat start {APART:g} m apart (m)")
    figure.legend(*left.get_legend_handles_labels(), loc="outside upper center", ncols=4, fontsize=9, frameon=False)
    figure.savefig(path, dpi=DPI)
    plt.close(figure)
