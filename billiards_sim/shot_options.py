# SPDX-License-Identifier: Apache-2.0
"""The options with which executables take a shot: in people's words, or as the force of the cue."""

from __future__ import annotations

import argparse
import math

from billiards_sim.engine.aim import Aim
from billiards_sim.engine.scene import Shot

ANGLE_UNITS = {"deg": math.pi / 180.0, "rad": 1.0}
"""In rad."""

WORDS = ("speed", "angle", "side", "up", "elevation")


def add_shot_options(parser: argparse.ArgumentParser) -> None:
    """Add `--speed`, `--angle`, `--side`, `--up`, `--elevation`, and `--force`, `--offset`: None where not given."""
    people = parser.add_argument_group("a shot in people's words")
    people.add_argument("--speed", type=float, metavar="V", help="speed of the cue ball, m/s")
    people.add_argument(
        "--angle", type=angle, metavar="A", help="with its unit, 12deg or 0.2rad, counter-clockwise from the x axis"
    )
    people.add_argument(
        "--side", type=float, metavar="S", help="where the tip hits: to the left of the centre, in radii (0)"
    )
    people.add_argument("--up", type=float, metavar="U", help="above the centre, in radii (0); negative is draw")
    people.add_argument(
        "--elevation", type=angle, metavar="E", help="of the butt of the cue, with its unit, 5deg or 0.1rad (0deg)"
    )
    robots = parser.add_argument_group("a shot in the table's units")
    robots.add_argument(
        "--force",
        nargs=2,
        type=float,
        metavar=("FX", "FY"),
        help="force of the cue, N, in the frame of the table; 850 0 gives 5 m/s along x with the physics of pool",
    )
    robots.add_argument(
        "--offset",
        nargs=2,
        type=float,
        metavar=("SIDE", "UP"),
        help="where the tip hits, m from the centre of the ball seen along the force: to the left and up (0 0)",
    )


def shot_asked_for(options: argparse.Namespace) -> Aim | Shot | None:
    """What the options say: words, a force, or nothing.

    Raises:
        ValueError: words and a force at once, half a shot, or numbers that are none of a shot.
    """
    given = [name for name in WORDS if getattr(options, name) is not None]
    if given and (options.force or options.offset):
        raise ValueError(f"--{given[0]} does not go with --force and --offset: give the one or the other")
    if given:
        if options.speed is None or options.angle is None:
            raise ValueError("--speed and --angle belong together: give both")
        return Aim(options.speed, options.angle, options.side or 0.0, options.up or 0.0, options.elevation or 0.0)
    if options.force is None:
        if options.offset is not None:
            raise ValueError("--offset needs --force")
        return None
    return Shot((*options.force, 0.0), options.offset or (0.0, 0.0))


def angle(text: str) -> float:
    """An argument type: a finite angle with its unit, `12deg` or `0.2rad`; rad."""
    number, unit = text[:-3], text[-3:]
    try:
        value = float(number) * ANGLE_UNITS[unit]
    except (KeyError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"must be an angle with its unit, as 12deg or 0.2rad, got {text}")
    return value
