# SPDX-License-Identifier: Apache-2.0
"""The pool table here and in pooltool: a nine-ball break with everything on, and what a single ball meets first.

The break starts from the same places with the same velocity of the cue ball, on a table of the same figures; each
engine has the physics that it comes with. Both are given the whole scene and play to rest.
"""

from __future__ import annotations

import gc
import json
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from billiards_sim.engine import machine, scenes
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import Simulation
from billiards_sim.engine.table import Table
from billiards_sim.study.measure import spread

FIRST_EVENTS = Path(__file__).with_name("pocket_first_event.json")
"""What a ball meets first on the 9 ft table, from a brute-force search with roots of 30 digits."""

KINDS = {"capture": "pocket", "jaw": "line", "nose": "line", "point": "point"}
"""What is met, as all engines tell it."""


class Played(NamedTuple):
    """What an engine made of a scene."""

    seconds: float
    """of the wall clock, from the scene with its velocities to rest; its set-up is not counted"""
    events: int
    pocketed: int
    first: tuple[str, float] | None
    """what is met first that is no ball, of `KINDS`, and when, s"""


class Player(Protocol):
    """Plays a scene with the physics of its own, or with those of the scene."""

    def __call__(self, scene: Scene, own_physics: bool) -> Played: ...


def billiards_sim(scene: Scene, own_physics: bool) -> Played:
    """This engine; its own physics are those of the scene."""
    machine.compile()
    simulation = Simulation(scene)
    began = time.perf_counter()
    events = simulation.run()
    seconds = time.perf_counter() - began
    first = None
    for event in events:
        if event.kind == "pocketed":
            first = "pocket", event.time
        elif event.rail is not None:
            first = "point" if "_point_" in event.rail else "line", event.time
        if first is not None:
            break
    return Played(seconds, len(events), sum(event.kind == "pocketed" for event in events), first)


def pooltool(scene: Scene, own_physics: bool) -> Played:
    """pooltool, with its default engine. Its table lies along y, so everything is turned by a quarter."""
    import pooltool as pt
    from pooltool import constants
    from pooltool.events import EventType

    table, physics = scene.table, scene.physics
    parameters = pt.BallParams.default()
    if not own_physics:
        parameters = pt.BallParams(
            m=physics.mass,
            R=physics.radius,
            u_s=physics.sliding_friction,
            u_r=physics.rolling_friction,
            e_c=physics.rail_restitution,
            g=physics.gravity,
        )
    balls = {}
    states = zip(scene.names, scene.positions.tolist(), scene.velocities.tolist(), scene.angular_velocities.tolist())
    for name, (x, y), (vx, vy), (wx, wy, wz) in states:
        ball = pt.Ball(name, params=parameters)
        place = (table.y_max - y, x - table.x_min, parameters.R)
        ball.state.rvw = np.array((place, (-vy, vx, 0.0), (-wy, wx, wz)))
        slip = math.hypot(vx - parameters.R * wy, vy + parameters.R * wx)
        moving = constants.rolling if slip < 1e-12 else constants.sliding
        ball.state.s = moving if vx or vy or wx or wy else constants.stationary
        balls[name] = ball
    system = pt.System(cue=pt.Cue.default(), table=pt.Table.from_table_specs(_pooltool_table(table)), balls=balls)
    began = time.perf_counter()
    pt.simulate(system, inplace=True)
    seconds = time.perf_counter() - began
    told = {
        EventType.BALL_POCKET: "pocket",
        EventType.BALL_LINEAR_CUSHION: "line",
        EventType.BALL_CIRCULAR_CUSHION: "point",
    }
    events = [event for event in system.events if event.event_type != EventType.NONE]
    met = [(told[event.event_type], float(event.time)) for event in events if event.event_type in told]
    return Played(seconds, len(events), sum(kind == "pocket" for kind, _ in met), met[0] if met else None)


def _pooltool_table(table: Table) -> Any:
    # Its angles count from where jaws would be square to the noses, or at half a right angle; its depths are those of
    # the middles of the circles behind the corner and behind the nose.
    from pooltool.objects import PocketTableSpecs

    corner, side = table.corner_pocket, table.side_pocket
    assert corner is not None
    assert side is not None
    return PocketTableSpecs(
        l=table.length,
        w=table.width,
        cushion_width=table.jaw_depth,
        cushion_height=table.nose_height * 2.0 * Physics().radius,
        corner_pocket_width=corner.mouth,
        corner_pocket_angle=math.degrees(corner.cut_angle) - 135.0,
        corner_pocket_depth=corner.slate_radius - (0.5 * corner.mouth - corner.shelf),
        corner_pocket_radius=corner.slate_radius,
        corner_jaw_radius=corner.point_radius,
        side_pocket_width=side.mouth,
        side_pocket_angle=math.degrees(side.cut_angle) - 90.0,
        side_pocket_depth=side.shelf + side.slate_radius,
        side_pocket_radius=side.slate_radius,
        side_jaw_radius=side.point_radius,
    )


PLAYERS: dict[str, Player] = {"billiards_sim": billiards_sim, "pooltool": pooltool}


def nine_ball_break() -> Scene:
    """The break of the scene `nine_ball`, just after the cue."""
    scene = scenes.nine_ball()
    assert scene.shot is not None
    simulation = Simulation(scene)
    simulation.strike(scene.shot.force, scene.shot.offset, scene.shot.ball)
    return simulation.scene()


def checkpoints() -> list[tuple[Scene, str, float]]:
    """Balls on the 9 ft table, with what each meets first, of `KINDS`, and when, s."""
    table = Table.pool_9ft()
    found = []
    for case in json.loads(FIRST_EVENTS.read_text(encoding="utf-8"))["cases"]:
        given, expected = case["input"], case["output"]
        x, y = given["position"]
        vx, vy = given["velocity"]
        rolls = 1.0 / given["radius"] if given["phase"] == "roll" else 0.0
        physics = replace(
            Physics(),
            radius=given["radius"],
            gravity=given["g"],
            sliding_friction=given["mu_s"],
            rolling_friction=given["mu_r"],
        )
        scene = Scene(
            [[x + table.x_min, y + table.y_min]],
            [[vx, vy]],
            [[-vy * rolls, vx * rolls, 0.0]],
            table=table,
            physics=physics,
        )
        found.append((scene, KINDS[expected["kind"]], float(expected["time"])))
    return found


def measure(peer: str, runs: int) -> dict[str, Any]:
    """The break and the checkpoints in this process.

    Returns:
        "wall": s, of a break to rest, as `spread`; "events" and "pocketed" of it; "first_events": how many "cases",
        how many of them "right" in kind, and the largest "error" of their times, s.
    """
    play, scene = PLAYERS[peer], nine_ball_break()
    play(scene, True)  # loads and compiles
    gc.collect()
    played = [play(scene, True) for _ in range(runs)]
    right, errors = 0, []
    cases = checkpoints()
    for case, kind, when in cases:
        first = play(case, False).first
        if first is not None and first[0] == kind:
            right += 1
            errors.append(abs(first[1] - when))
    return {
        "wall": spread([one.seconds for one in played]),
        "events": played[0].events,
        "pocketed": played[0].pocketed,
        "first_events": {"cases": len(cases), "right": right, "error": max(errors, default=None)},
    }
