# SPDX-License-Identifier: Apache-2.0
"""The executable `plan`: the best shots for a scene, or for a running table, as a table, a message and a picture."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from billiards_sim.command_line import (
    NO_ROS,
    Failure,
    Parser,
    Refusal,
    interrupt_on_signals,
    needing,
    positive_seconds,
    run_to_end,
    say,
)
from billiards_sim.engine import cue, goals
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.noise import ShooterNoise
from billiards_sim.engine.record import record
from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.engine.search import LEAST_BUDGET, Found, as_it_succeeds, search
from billiards_sim.engine.shot_kind import ShotKind, cut_of
from billiards_sim.engine.simulation import Simulation
from billiards_sim.files import written
from billiards_sim.scene_option import SCENE_HELP, scene_named
from billiards_sim.study.outputs import PICTURES, check_picture, check_places, writing

NUMBERS = {
    "samples": (400, 1, 100_000, "of each of the best shots, for its probability of success"),
    "best": (5, 1, 100, "shots wanted"),
    "seed": (0, 0, 10**15 - 1, "of all that is drawn; the same one finds the same shots"),
    "budget": (300_000, LEAST_BUDGET, 10**9, "shots that the search may play"),
}
"""Options that are whole numbers: default, least, most, help."""

DESCRIPTION = """Search for the shots that most likely pocket a ball and keep the cue ball on the table, by somebody who
does not hit quite as meant, and print the best ones. The balls must rest. --ros plans for those on a running table.
Exit code 0: done; 1: no shot was found, there is no table, or it refused the shot; 2: bad arguments, or a file that
cannot be read or written."""

TIMEOUT = 10.0
"""s that a running table has to be found, and for each answer."""

HEADS = ("", "ball", "pocket", "kind", "speed", "azimuth", "side", "up", "cut", "success", "cue ball ends")
UNITS = ("", "", "", "", "m/s", "deg", "radii", "radii", "deg", "%", "m, x y, spread")


class Row(NamedTuple):
    """A shot of a plan."""

    aim: Aim
    kind: ShotKind
    """without noise; or, where it fails so, of a try with noise that succeeds"""
    cut: float
    """rad, likewise"""
    success: float
    """probability"""
    error: float
    """its standard error"""
    end: tuple[float, float] | None
    """where the cue ball comes to rest then, m; None: in a pocket"""
    spread: float
    """root mean square of the distance from there with noise, m, where it stays on the table; 0 without"""


def main(arguments: list[str]) -> int:
    """Plan once; returns the exit code."""
    interrupt_on_signals()
    return run_to_end("plan", lambda: _on_a_running_table(arguments) if "--ros" in arguments else _plan(arguments))


def _on_a_running_table(arguments: list[str]) -> int:
    with needing(NO_ROS):
        from billiards_sim.ros.tools.plan import plan_and_shoot
    return plan_and_shoot(arguments)


def parser() -> Parser:
    """The options, with those of a running table."""
    options = Parser(
        prog="plan",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,  # `main` looks for --ros
    )
    options.add_argument("scene", metavar="SCENE", nargs="?", help=SCENE_HELP)
    options.add_argument("--ball", metavar="NAME", help="to be pocketed; default: any but the cue ball")
    options.add_argument("--pocket", metavar="NAME", help="into which, as x_max_y_min or y_max; default: any")
    options.add_argument("--first", metavar="NAME", help="ball that the cue ball must meet first; default: any")
    options.add_argument(
        "--noise",
        type=noise,
        default=ShooterNoise.tournament(),
        metavar="N",
        help="of the shooter: how many times that of the computer pool tournaments (1), 0 for none; or "
        "SPEED,AZIMUTH,SIDE,UP, standard deviations: relative, rad, radii, radii",
    )
    for name, (default, least, most, text) in NUMBERS.items():
        options.add_argument(
            f"--{name}", type=_whole(least, most), default=default, metavar="N", help=f"{text} ({default})"
        )
    options.add_argument(
        "--yaml", type=Path, metavar="F", help="write the best shot as a WrenchStamped, for ros2 topic pub"
    )
    options.add_argument(
        "--plot", type=Path, metavar="F.png", help=f"draw the best shot and where noise leads ({', '.join(PICTURES)})"
    )
    table = options.add_argument_group("a running table")
    table.add_argument("--ros", action="store_true", help="plan for the balls on the table that publishes balls/states")
    table.add_argument("--shoot", action="store_true", help="with --ros: shoot the best shot")
    table.add_argument(
        "--timeout", type=positive_seconds, metavar="S", help=f"with --ros: longest wait, s ({TIMEOUT:g})"
    )
    return options


def noise(text: str) -> ShooterNoise | None:
    """An argument type: a share of the tournaments' noise, or four deviations; None for 0."""
    try:
        numbers = [float(part) for part in text.split(",")]
        if len(numbers) not in (1, 4):
            raise ValueError("give one number, or four with commas between")
        if not any(numbers):
            return None
        return ShooterNoise.tournament(numbers[0]) if len(numbers) == 1 else ShooterNoise(*numbers)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text} is no noise: {error}") from None


def _whole(least: int, most: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not (text.isascii() and text.isdigit() and len(text) < 16 and least <= int(text) <= most):
            raise argparse.ArgumentTypeError(f"must be a whole number from {least} to {most}, got {text}")
        return int(text)

    return read


def _plan(arguments: list[str]) -> int:
    options = parser().parse_args(arguments)
    if options.shoot:
        raise Refusal("--shoot needs --ros: there is no table to shoot on")
    if options.timeout is not None:
        raise Refusal("--timeout needs --ros: there is no table to wait for")
    if options.scene is None:
        raise Refusal("give a SCENE, or --ros (see plan --help)")
    check_outputs(options)
    write(plan(scene_named(options.scene), options), options)
    return 0


class Plan(NamedTuple):
    """What was found for a scene, the best shot first; at least one."""

    scene: Scene
    found: Found
    rows: list[Row]

    @property
    def best(self) -> Shot:
        return self.rows[0].aim.shot(self.scene.physics)


def plan(scene: Scene, options: argparse.Namespace) -> Plan:
    """Search, and print the best shots.

    Raises:
        Refusal: the scene and the options do not go together.
        Failure: no shot was found.
    """
    moving = scene.velocities.any(axis=1) | scene.angular_velocities.any(axis=1)
    if moving.any():
        raise Refusal(f"ball {scene.names[int(moving.argmax())]!r} moves at the start; all balls must rest")
    try:
        goal = goals.pocket(scene, options.ball, options.pocket, first=options.first)
        found = search(
            scene,
            goal,
            noise=options.noise,
            samples=options.samples,
            best=options.best,
            seed=options.seed,
            budget=options.budget,
        )
    except ValueError as error:
        raise Refusal(error) from None
    count = int(np.count_nonzero(found.values))
    if count == 0:
        raise Failure(f"none of {found.played} shots did what is wanted; a larger --budget searches for longer")
    made = Plan(scene, found, [_row(scene, found, index, goal, options) for index in range(count)])
    _print(made, options)
    return made


def write(made: Plan, options: argparse.Namespace) -> None:
    """Write the files that the options ask for.

    Raises:
        Refusal: one cannot be written.
    """
    for option, path in outputs(options).items():
        with writing(option, path), written(path) as file:
            if option == "yaml":
                file.write_text(wrench_yaml(made.best), encoding="utf-8")
            else:
                from billiards_sim.study.plan_plot import draw_plan

                draw_plan(made, options.noise, options.seed, file)
        say(f"  wrote {path}")


def outputs(options: argparse.Namespace) -> dict[str, Path]:
    """What is to be written, by option."""
    given = {"yaml": options.yaml, "plot": options.plot}
    return {option: path for option, path in given.items() if path is not None}


def check_outputs(options: argparse.Namespace) -> None:
    """Refuse what could not be written, before any long computing."""
    check_places(outputs(options))
    if options.plot is not None:
        check_picture("plot", options.plot)


def wrench_yaml(shot: Shot) -> str:
    """A shot as a `geometry_msgs/WrenchStamped`; the empty frame is that of any table."""
    lines = ["header: {frame_id: ''}", "wrench:"]
    for name, vector in (("force", shot.force), ("torque", cue.torque(shot.force, shot.offset))):
        x, y, z = (repr(float(part) + 0.0) for part in vector)  # -0.0 + 0.0 is 0.0
        lines.append(f"  {name}: {{x: {x}, y: {y}, z: {z}}}")
    return "\n".join(lines) + "\n"


def _row(scene: Scene, found: Found, index: int, goal: goals.Potting, options: argparse.Namespace) -> Row:
    simulation = Simulation(scene)
    example = as_it_succeeds(scene, found.shots[index : index + 1], goal, options.noise, options.seed)
    speed, azimuth, side, up, _ = example.columns()[0].tolist()
    simulation.shoot(speed, azimuth, side, up)
    at = scene.names.index("cue")
    run = record(simulation)
    end, spread = None, 0.0
    if simulation.in_play[at]:
        x, y = simulation.positions[at].tolist()
        end = (x, y)
        if found.result.error.ndim > 1:
            stays = found.result.in_play[index, :, at] & (found.result.error[index] == 0)
            away = found.result.positions[index, stays, at] - end
            spread = math.sqrt(np.mean(np.sum(away**2, axis=1))) if len(away) else 0.0
    aim = Aim(*found.shots.columns()[index].tolist())
    success, error = float(found.values[index]), float(found.errors[index])
    return Row(aim, goal.way(run.events), cut_of(run), success, error, end, spread)


def _print(made: Plan, options: argparse.Namespace) -> None:
    times = f"each {options.samples} times" if options.noise is not None else "once each"
    say(f"plan: {described(options.noise)}; the shots below played {times}")
    lines = [HEADS, UNITS, *(_cells(number, row) for number, row in enumerate(made.rows, 1))]
    widths = [max(len(line[column]) for line in lines) for column in range(len(HEADS))]
    for line in lines:
        left = (cell.ljust(width) for cell, width in zip(line[:4], widths[:4]))
        right = (cell.rjust(width) for cell, width in zip(line[4:], widths[4:]))
        say("  " + "  ".join((*left, *right)).rstrip())
    say(f"  {made.found.played} shots played")


def described(used: ShooterNoise | None) -> str:
    """The noise in words."""
    if used is None:
        return "no noise"
    return (
        f"noise (standard deviations) {100.0 * used.speed:.3g} % of speed, {math.degrees(used.azimuth):.3g} deg of "
        f"azimuth, {used.side:.3g} and {used.up:.3g} radii of side and up"
    )


def _cells(number: int, row: Row) -> tuple[str, ...]:
    aim, kind = row.aim, row.kind
    end = "in a pocket" if row.end is None else f"{row.end[0]:.2f} {row.end[1]:.2f} +- {row.spread:.2f}"
    return (
        str(number),
        kind.ball or "-",
        kind.pocket or "-",
        kind.kind,
        f"{aim.speed:.2f}",
        f"{math.degrees(math.remainder(aim.azimuth, math.tau)):.2f}",
        *(f"{value + 0.0:.2f}" for value in (round(aim.side, 2), round(aim.up, 2))),
        "-" if math.isnan(row.cut) else f"{math.degrees(row.cut):.0f}",
        f"{100.0 * row.success:.1f} +- {100.0 * row.error:.1f}",
        end,
    )
