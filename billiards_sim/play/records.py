# SPDX-License-Identifier: Apache-2.0
"""What the page is told, as values that JSON has: a table, a run, a position as a link."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from billiards_sim.colours import CLOTH, HOLE, MARKING, RUBBER, WOOD, ball_colour, is_striped
from billiards_sim.engine.events import Event
from billiards_sim.engine.markings import lines, spots
from billiards_sim.engine.physics import PRESETS as PHYSICS_PRESETS
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.record import Run
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.table import PRESETS as TABLE_PRESETS
from billiards_sim.engine.table import Table
from billiards_sim.outline import Polygon, outline
from billiards_sim.play.effects import EFFECTS

PAPER = "paper"
"""What the page calls the defaults of `Table` and of `Physics`."""

TABLES: dict[str, Callable[..., Table]] = {**TABLE_PRESETS, PAPER: Table}
PHYSICS: dict[str, Callable[..., Physics]] = {**PHYSICS_PRESETS, PAPER: Physics}

COLOURS = {"cloth": CLOTH, "rubber": RUBBER, "wood": WOOD, "hole": HOLE, "marking": MARKING}

MOTION = 7
"""Columns of an arc that tell where a ball is; those after them tell its spin."""

SHORT = 1e-4
"""s. A preview leaves out arcs that begin so soon after the one before: balls in touch have hundreds of them, and move
by a millimetre meanwhile. The last of each is kept, so that ends are exact."""

EVENT = tuple(field.name for field in fields(Event))

DIGITS = 4
"""After the decimal point, of figures that are drawn and not counted on: m, 0.1 mm."""


def table_record(scene: Scene) -> dict[str, Any]:
    """All that is drawn of a table, and what lies on it."""
    table, physics = scene.table, scene.physics
    drawn = outline(table)
    return {
        "scene": scene.name,
        "table": preset_of(table, TABLES),
        "physics": preset_of(physics, PHYSICS),
        "centre": list(table.centre),
        "size": [table.length, table.width],
        "rail": table.rail_thickness,
        "outer": [[round(edge, DIGITS) for edge in edges] for edges in drawn.outer],
        "cloth": _rounded(drawn.cloth),
        "cushions": [_rounded(cushion) for cushion in drawn.cushions],
        "holes": [_rounded(hole) for hole in drawn.holes],
        "sights": _rounded(drawn.sights),
        "head_spot": list(table.head_spot),
        "foot_spot": list(table.foot_spot),
        "spots": _rounded(np.array(list(spots(table).values()))),
        "lines": [_rounded(np.array(line)) for line in lines(table)],
        "colours": {name: css(colour) for name, colour in COLOURS.items()},
        "radius": physics.radius,
        "miscue_limit": physics.miscue_limit,
        "balls": [
            {
                "name": name,
                "at": at if in_play else None,
                "colour": css(ball_colour(name)),
                "striped": is_striped(name),
            }
            for name, at, in_play in zip(scene.names, scene.positions.tolist(), scene.in_play.tolist())
        ],
        "effects": [
            {
                "key": effect.key,
                "label": effect.label,
                "help": effect.help,
                "unit": effect.unit,
                "scale": effect.scale,
                "on": effect.is_on(scene),
                "value": effect.value(scene) if effect.is_on(scene) else effect.usual,
            }
            for effect in EFFECTS.values()
        ],
        "link": link_document(scene),
    }


def run_record(run: Run, spins: bool = True) -> dict[str, Any]:
    """How every ball moves, in closed form, and what happens.

    Args:
        spins: with the spins, and every arc; else what a preview draws, see `SHORT`.
    """
    return {
        "end": run.end,
        "names": list(run.scene.names),
        "arcs": [
            (run.arcs(name) if spins else _thinned(run.arcs(name))[:, :MOTION]).tolist() for name in run.scene.names
        ],
        "events": [event_record(event) for event in run.events],
    }


def event_record(event: Event) -> dict[str, Any]:
    """An event, without what it has not."""
    return {key: value for key in EVENT if (value := getattr(event, key)) is not None}


def link_document(scene: Scene) -> dict[str, Any]:
    """A scene as short as it can be said; a scene file takes it, JSON being YAML, and gives the same bits."""
    balls = []
    for name, at, spin, in_play in zip(
        scene.names, scene.positions.tolist(), scene.angular_velocities.tolist(), scene.in_play.tolist()
    ):
        ball: dict[str, Any] = {"name": name, "position": at} if in_play else {"name": name, "in_play": False}
        if any(spin):
            ball["angular_velocity"] = spin
        balls.append(ball)
    document = {
        "name": scene.name,
        "table": _shortest(scene.table, TABLES),
        "physics": _shortest(scene.physics, PHYSICS),
        "balls": balls,
    }
    return {key: value for key, value in document.items() if value not in ({}, "")}


def preset_of(owner: Any, presets: Mapping[str, Callable[..., Any]]) -> str | None:
    """Name of the preset that it is, if it is one."""
    return next((name for name, make in presets.items() if make() == owner), None)


def css(colour: tuple[float, float, float]) -> str:
    """A colour for a page, `#rrggbb`."""
    return "#" + "".join(f"{round(255.0 * part):02x}" for part in colour)


def _shortest(owner: Any, presets: Mapping[str, Callable[..., Any]]) -> Any:
    # A preset's name, or that of the nearest with what differs; without a name for the paper's.
    def changed(make: Callable[..., Any]) -> dict[str, Any]:
        values, usual = asdict(owner), asdict(make())
        return {field.name: values[field.name] for field in fields(owner) if values[field.name] != usual[field.name]}

    name, differs = min(((name, changed(make)) for name, make in presets.items()), key=lambda pair: len(pair[1]))
    if name == PAPER:
        return differs
    return {"preset": name, **differs} if differs else name


def _thinned(arcs: NDArray[np.float64]) -> NDArray[np.float64]:
    kept, began = [], -math.inf
    times = arcs[:, 0].tolist()
    for index, (time, after) in enumerate(zip(times, [*times[1:], math.inf])):
        if after - time >= SHORT or time - began >= SHORT:
            kept.append(index)
            began = time
    return arcs[kept]


def _rounded(places: Polygon) -> list[list[float]]:
    rounded: list[list[float]] = np.round(places, DIGITS).tolist()
    return rounded
