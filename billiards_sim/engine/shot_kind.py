# SPDX-License-Identifier: Apache-2.0
"""What kind of shot a shot is, read from what happened."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from billiards_sim.engine.events import Event
from billiards_sim.engine.record import Run

BEFORE = 1e-4
"""s before a contact at which the ways of balls are looked at."""


class ShotKind(NamedTuple):
    """A shot in a player's words."""

    kind: str
    """what fell, and how: direct; kick, the struck ball by rails; bank, the ball that fell by rails; carom, the struck
    ball by another; combination, driven by another; miss, nothing fell; scratch, the struck ball alone fell. Of several
    the last that holds."""
    ball: str
    """that fell first; empty: none"""
    pocket: str


def kind_of(
    events: Sequence[Event], struck: str = "cue", wanted: str | None = None, pocket: str | None = None
) -> ShotKind:
    """Of events that begin with a shot. The ball that is `wanted` is looked at, and the `pocket`; None: any."""
    fell = [event for event in events if event.kind == "pocketed"]
    objects = [
        event
        for event in fell
        if event.balls[0] != struck and wanted in (None, event.balls[0]) and pocket in (None, event.pocket)
    ]
    if not objects:
        scratch = next((event for event in fell if event.balls[0] == struck), None)
        return ShotKind("miss", "", "") if scratch is None else ShotKind("scratch", struck, str(scratch.pocket))
    last, ball, into = objects[0].time, objects[0].balls[0], str(objects[0].pocket)
    past = [event for event in events if event.time <= last]
    hits = [event for event in past if event.kind == "ball_ball"]
    driver = next((set(event.balls) - {ball} for event in reversed(hits) if ball in event.balls), {struck})
    first = next((event for event in hits if struck in event.balls), None)
    met = math.inf if first is None else first.time
    driven = max((event.time for event in hits if ball in event.balls), default=math.inf)
    rails = [event for event in past if event.kind == "ball_rail"]
    kind = "direct"
    if any(event.balls[0] == struck and event.time < met for event in rails):
        kind = "kick"
    if any(event.balls[0] == ball and event.time > driven and not _leads_into(event, into) for event in rails):
        kind = "bank"
    if first is not None and ball not in first.balls:
        kind = "carom"
    if struck not in driver:
        kind = "combination"
    return ShotKind(kind, ball, into)


def cut_of(run: Run, struck: str = "cue") -> float:
    """rad, between the way of the struck ball and the line of centres where it first meets a ball; nan: it does not."""
    hit = next((event for event in run.events if event.kind == "ball_ball" and struck in event.balls), None)
    if hit is None:
        return math.nan
    before = max(hit.time - BEFORE, run.start)
    velocity = run.velocities([before])[0, run.scene.names.index(struck)]
    towards = np.array(hit.normal) * (-1.0 if hit.balls[0] == struck else 1.0)
    speed = float(np.hypot(*velocity))
    return math.acos(min(max(float(velocity @ towards) / speed, -1.0), 1.0)) if speed > 0.0 else math.nan


def _leads_into(touch: Event, pocket: str) -> bool:
    # A jaw, a point, or a nose that ends there: a ball goes away from a nose, so it comes in by one only from a touch
    # of the rubber beside the pocket.
    rail = str(touch.rail)
    return rail in pocket or rail.startswith(f"{pocket}_")
