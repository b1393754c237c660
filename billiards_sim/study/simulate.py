# SPDX-License-Identifier: Apache-2.0
"""The executable `simulate`: runs a scene without ROS and writes numbers, a picture or a movie of it."""

from __future__ import annotations

import argparse
import csv
import importlib
import json
import math
from collections import Counter
from dataclasses import asdict, replace
from itertools import compress
from pathlib import Path

from billiards_sim.command_line import (
    Failure,
    Parser,
    Refusal,
    interrupt_on_signals,
    needing,
    positive_seconds,
    run_to_end,
    say,
)
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.simulation import StallError, comes_to_rest
from billiards_sim.files import written, written_directory
from billiards_sim.scene_option import SCENE_HELP, scene_named
from billiards_sim.shot_options import add_shot_options, shot_asked_for
from billiards_sim.study.outputs import PICTURES, check_ending, check_installed, check_picture, check_places, writing
from billiards_sim.study.recording import ExactRecording, Recording, TooMany, record, ticks
from billiards_sim.study.time_stepping import SOLVERS, TIME_STEP, SchemeError

SAMPLE = 0.01
"""s between two times of a table."""

MOVIES = {".mp4": ("PIL", "tqdm", "imageio_ffmpeg"), ".gif": ("PIL", "tqdm")}
"""Endings of movies, with the modules that they need."""

COLUMNS = ("time", "ball", "x", "y", "vx", "vy", "wx", "wy", "wz")

DESCRIPTION = """Run a scene to rest, or to a time, and write what was asked for. A shot of the scene is played first,
or in its place the one of the options, which hits the ball cue.
Exit code 0: done; 1: the solver cannot go on; 2: bad arguments, or a file that cannot be read or written.
JSON and CSV have as many digits, up to 17, as it takes to read back the same numbers, in SI units."""


def main(arguments: list[str]) -> int:
    """Simulate once; returns the exit code."""
    interrupt_on_signals()
    return run_to_end("simulate", lambda: _simulate(_parser().parse_args(arguments)))


def _parser() -> Parser:
    parser = Parser(prog="simulate", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", metavar="SCENE", help=SCENE_HELP)
    parser.add_argument(
        "--solver",
        choices=SOLVERS,
        default="event",
        help="event: exact, the default; time_step: the paper's scheme corrected; paper: as printed, needs --until",
    )
    parser.add_argument(
        "--time-step",
        type=positive_seconds,
        metavar="DT",
        help=f"s, of time_step and paper ({TIME_STEP:g})",
    )
    parser.add_argument("--until", type=positive_seconds, metavar="T", help="end at this time, s; default: at rest")
    parser.add_argument("--json", type=Path, metavar="F", help="write the end and all events")
    parser.add_argument("--csv", type=Path, metavar="F", help="write the state of every ball over time")
    parser.add_argument(
        "--sample",
        type=positive_seconds,
        metavar="DT",
        help=f"s between the times of --csv ({SAMPLE:g}); time_step and paper write each of their steps",
    )
    parser.add_argument("--plot", type=Path, metavar="F.png", help=f"draw paths and contacts ({', '.join(PICTURES)})")
    parser.add_argument(
        "--movie", type=Path, metavar="F.mp4", help=f"film it, 30 frames a second ({', '.join(MOVIES)})"
    )
    parser.add_argument("--html", type=Path, metavar="F.html", help="write a page that plays it, in one file")
    parser.add_argument("--bag", type=Path, metavar="DIR", help="write what the ROS 2 node would publish, as a bag")
    parser.add_argument("--rate", type=float, metavar="HZ", help="ticks a second of --bag; default: the node's, 100")
    add_shot_options(parser)
    return parser


def _simulate(options: argparse.Namespace) -> int:
    _check_company(options)
    _check_outputs(options)
    scene = _scene(options)
    recording = _record(scene, options)
    _print_summary(recording, options)
    for option, (opened, write) in WRITERS.items():
        path = getattr(options, option)
        if path is not None:
            try:
                with writing(option, path), opened(path) as place:
                    write(recording, place, options)
            except TooMany as error:
                raise Refusal(f"--{option}: {error}") from None
            say(f"  wrote           {path}")
    return 0


def _check_company(options: argparse.Namespace) -> None:
    """Refuse options that would do nothing beside the others, and fill in what is left to its default."""
    for option, other in (("rate", "bag"), ("sample", "csv")):
        if getattr(options, option) is not None and getattr(options, other) is None:
            raise Refusal(f"--{option} needs --{other}")
    if options.time_step is not None and options.solver == "event":
        raise Refusal("--time-step needs --solver time_step or paper: event takes no steps")
    if options.sample is not None and options.solver != "event":
        raise Refusal(f"--sample needs --solver event: {options.solver} writes each of its steps")
    options.time_step = options.time_step or TIME_STEP
    options.sample = options.sample or SAMPLE


def _check_outputs(options: argparse.Namespace) -> None:
    """Refuse what could not be written, before any long computing."""
    check_places({name: getattr(options, name) for name in WRITERS if getattr(options, name)})
    if options.html is not None:
        check_ending("html", options.html, (".html",))
        if options.solver != "event":
            raise Refusal(f"--html shows runs of the solver event, not of {options.solver}")
    if options.plot is not None:
        check_picture("plot", options.plot)
    if options.movie is not None:
        ending = check_ending("movie", options.movie, list(MOVIES))
        check_installed("movie", MOVIES[ending])
        if ending == ".mp4":
            _check_ffmpeg()
    if options.bag is not None:
        _check_bag(options)
    if options.until is not None:
        _check_length(options)


def _check_bag(options: argparse.Namespace) -> None:
    if options.solver != "event":
        raise Refusal(f"--bag: the node does not play by --solver {options.solver}, only by event")
    with needing(
        "--bag needs the ROS 2 messages and mcap ({error}): pip install 'billiards_sim[ros]'; "
        "where ROS 2 is installed, source it, and pip install mcap"
    ):
        from billiards_sim.ros.bag import RATE
    default, declared = RATE
    if options.rate is None:
        options.rate = default
    if not declared.contains(options.rate):
        raise Refusal(f"--rate must be a number {declared.bounds()} ({declared.unit}), got {options.rate:g}")


def _check_length(options: argparse.Namespace) -> None:
    try:
        if options.csv is not None and options.solver == "event":
            ticks(0.0, options.until, options.sample)
        if options.bag is not None:
            ticks(0.0, options.until, 1.0 / options.rate)
        if options.movie is not None:
            from billiards_sim.study.movie import frame_times

            frame_times(0.0, options.until)
    except TooMany as error:
        raise Refusal(f"--until {options.until:g}: {error}") from None


def _check_ffmpeg() -> None:
    try:
        importlib.import_module("imageio_ffmpeg").get_ffmpeg_exe()
    except RuntimeError as error:
        raise Refusal(f"--movie: {error}") from None


def _scene(options: argparse.Namespace) -> Scene:
    scene = scene_named(options.scene)
    try:
        asked = shot_asked_for(options)
        shot = asked.shot(scene.physics) if isinstance(asked, Aim) else asked
        return scene if shot is None else replace(scene, shot=shot)
    except ValueError as error:
        raise Refusal(error) from None


def _record(scene: Scene, options: argparse.Namespace) -> Recording:
    if options.until is None:
        physics = scene.physics
        if options.solver == "paper":
            raise Refusal("--solver paper needs --until: its balls never rest")
        if not comes_to_rest(physics):
            raise Refusal(
                f"a scene with sliding_friction {physics.sliding_friction:g} and rolling_friction "
                f"{physics.rolling_friction:g} needs --until: its balls may never rest"
            )
    try:
        return record(scene, options.solver, options.time_step, options.until)
    except (SchemeError, StallError) as error:
        raise Failure(f"{options.solver} cannot go on: {error}") from None
    except ValueError as error:
        raise Refusal(f"{options.scene}: {error}") from None


def _write_json(recording: Recording, path: Path, options: argparse.Namespace) -> None:
    fell = {event.balls[0] for event in recording.events if event.pocket is not None}
    there = set(compress(recording.scene.names, recording.scene.in_play))
    document = {
        "scene": options.scene,
        "solver": options.solver,
        **({} if options.solver == "event" else {"time_step": options.time_step}),
        "time": recording.end.time,
        "names": recording.scene.names,
        "positions": [
            place if in_play else None  # JSON has no nan
            for place, in_play in zip(recording.end.positions.tolist(), recording.scene.in_play)
        ],
        "in_play": [name in there and name not in fell for name in recording.scene.names],
        "velocities": recording.end.velocities.tolist(),
        "angular_velocities": recording.end.angular_velocities.tolist(),
        "events": [asdict(event) for event in recording.events],
        "wall_seconds": recording.wall_seconds,
    }
    path.write_text(json.dumps(document) + "\n", encoding="utf-8")


def _write_csv(recording: Recording, path: Path, options: argparse.Namespace) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        fell = {event.balls[0]: event.time for event in recording.events if event.pocket is not None}
        for state in recording.samples(options.sample):
            balls = (recording.scene.names, state.positions, state.velocities, state.angular_velocities)
            for name, position, velocity, spin in compress(zip(*balls, strict=True), recording.scene.in_play):
                if state.time < fell.get(name, math.inf):
                    table.writerow((state.time, name, *position.tolist(), *velocity.tolist(), *spin.tolist()))


def _draw(recording: Recording, path: Path, options: argparse.Namespace) -> None:
    from billiards_sim.study.plots import draw_run

    title = recording.scene.name or Path(options.scene).stem
    draw_run(recording, path, f"{title}, {recording.end.time:.4g} s, solver {options.solver}")


def _film(recording: Recording, path: Path, options: argparse.Namespace) -> None:
    from billiards_sim.study.movie import write_movie

    write_movie(recording, path)


def _write_page(recording: Recording, path: Path, options: argparse.Namespace) -> None:
    from billiards_sim.play.offline import TooLong, write_page

    assert isinstance(recording, ExactRecording)
    try:
        write_page(recording.run, path, recording.scene.name or Path(options.scene).stem)
    except TooLong as error:
        raise TooMany(str(error)) from None


def _write_bag(recording: Recording, directory: Path, options: argparse.Namespace) -> None:
    from billiards_sim.ros.bag import last_tick, write_bag

    end = options.until or last_tick(recording.end.time, options.rate)
    try:
        times = ticks(recording.start.time, end, 1.0 / options.rate).tolist()
        dropped = write_bag(directory, recording.scene, times, options.rate)
    except ValueError as error:
        raise Refusal(f"--bag: {error}") from None
    if dropped:
        say(f"  bag: {dropped} events are left out: more than the node lets wait at {options.rate:g} Hz")


WRITERS = {
    "json": (written, _write_json),
    "csv": (written, _write_csv),
    "plot": (written, _draw),
    "movie": (written, _film),
    "html": (written, _write_page),
    "bag": (written_directory, _write_bag),
}
"""By option, in the order in which they are written: what is put in its place, and by what."""


def _print_summary(recording: Recording, options: argparse.Namespace) -> None:
    counts = Counter(event.kind for event in recording.events)
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items())
    step = "" if options.solver == "event" else f", time step {options.time_step:g} s"
    balls = len(recording.scene)
    say(f"simulate: {options.scene}, {balls} ball{'s' * (balls > 1)}")
    say(f"  solver          {options.solver}{step}")
    say(f"  simulated time  {recording.end.time:.6g} s, {'at rest' if recording.at_rest else 'balls still move'}")
    say(f"  events          {len(recording.events)}{': ' if kinds else ''}{kinds}")
    pockets = [f"{event.balls[0]} in {event.pocket}" for event in recording.events if event.pocket is not None]
    if pockets:
        say(f"  pocketed        {', '.join(pockets)}")
    say(f"  wall time       {recording.wall_seconds:.3g} s")
    if not recording.events and not recording.start.velocities.any() and not recording.start.angular_velocities.any():
        say("  nothing moved: the scene has no shot; --speed V and --angle A hit the ball cue")
