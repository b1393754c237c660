# SPDX-License-Identifier: Apache-2.0
"""Movies: frames, files, and balls whose paint turns with them."""

from __future__ import annotations

import fcntl
import math
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("PIL")
pytest.importorskip("tqdm")
pytest.importorskip("imageio_ffmpeg")
import imageio_ffmpeg
from PIL import Image

import billiards_sim as bs
from billiards_sim.colours import DISC
from billiards_sim.command_line import STOPPING
from billiards_sim.study import simulate
from billiards_sim.study.movie import GLYPH, SIZES, Painter, number_picture, write_movie
from billiards_sim.study.recording import Pose, record

RADIUS = bs.Physics().radius
UPRIGHT = (0.0, 0.0, 0.0, 1.0)
BALL = 100
"""Pixels of a ball's radius in the pictures of one ball."""


def about(axis: str, angle: float) -> tuple[float, float, float, float]:
    """Quaternion x y z w of a turn about an axis, rad."""
    half = 0.5 * angle
    x, y, z = (math.sin(half) * (name == axis) for name in "xyz")
    return x, y, z, math.cos(half)


def ball(name: str, orientation: Sequence[float]) -> NDArray[np.float64]:
    """(2 BALL, 2 BALL, 3) of one ball from above, rows from high y to low y."""
    table = bs.Table(length=4.0 * RADIUS, width=4.0 * RADIUS, rail_thickness=0.0)
    scene = bs.Scene([table.centre], names=[name], table=table)
    painter = Painter(scene, 4 * BALL)
    frame = painter.frame(Pose(0.0, scene.positions.copy(), np.array([orientation])))
    assert frame.shape == (4 * BALL, 4 * BALL, 3)
    return frame[BALL : 3 * BALL, BALL : 3 * BALL].astype(float)


def saturation(picture: NDArray[np.float64]) -> NDArray[np.float64]:
    """0 for white, grey and black, 1 for pure colours; light and shade leave it alone."""
    return 1.0 - picture.min(axis=-1) / np.maximum(picture.max(axis=-1), 1.0)


def at(picture: NDArray[np.float64], x: float, y: float) -> NDArray[np.float64]:
    """Pixel at a place in radii from the ball's centre."""
    return picture[int(BALL * (1.0 - y)), int(BALL * (1.0 + x))]


def number(picture: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Where the ink of the number is, in the square in the middle that its disc holds."""
    reach = int(0.28 * BALL)
    return picture[BALL - reach : BALL + reach, BALL - reach : BALL + reach].max(axis=2) < 100.0


def overlap(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float((one & other).sum() / (one | other).sum())


def whereabouts(mask: NDArray[np.bool_]) -> tuple[float, float]:
    """Centre of a mask, in radii from the ball's centre."""
    rows, columns = np.nonzero(mask)
    return float(columns.mean() + 0.5) / BALL - 1.0, 1.0 - float(rows.mean() + 0.5) / BALL


def test_stripe_runs_along_x_at_the_start_and_turns_with_the_ball() -> None:
    start, turned = ball("10", UPRIGHT), ball("10", about("z", 0.5 * math.pi))
    for x, y in ((0.85, 0.0), (-0.85, 0.0), (0.6, -0.4)):
        assert saturation(at(start, x, y)) > 0.5
        assert saturation(at(turned, -y, x)) > 0.5
    for x, y in ((0.0, 0.85), (0.0, -0.85), (0.5, 0.6)):
        assert saturation(at(start, x, y)) < 0.2
        assert saturation(at(turned, -y, x)) < 0.2


def test_a_solid_ball_is_its_colour_all_round() -> None:
    for orientation in (about("x", 0.5 * math.pi), about("y", 0.5 * math.pi)):
        picture = ball("2", orientation)
        middle = [at(picture, x, y) for x in (-0.5, 0.0, 0.5) for y in (-0.6, 0.0, 0.4)]
        assert all(pixel[2] > 1.3 * pixel[0] for pixel in middle)


def test_a_ball_that_rolled_by_pi_shows_its_back_whose_number_is_upside_down() -> None:
    start = number(ball("7", UPRIGHT))
    assert 0.05 < start.mean() < 0.5
    back = number(ball("7", about("y", math.pi)))
    assert overlap(back, start[::-1, ::-1]) > 0.9
    assert overlap(back, start) < 0.5
    assert overlap(back, start[:, ::-1]) < 0.5  # nor is it mirrored
    assert overlap(number(ball("7", about("x", math.pi))), start) > 0.9


def test_a_number_reads_from_left_to_right() -> None:
    # A 1 is slimmer than a 0.
    ink = number(ball("10", UPRIGHT))
    columns = np.flatnonzero(ink.any(axis=0))
    middle = columns[0] + np.argmin(ink.any(axis=0)[columns[0] : columns[-1]])
    assert columns[0] < middle < columns[-1]
    assert ink[:, middle:].sum() > 1.2 * ink[:, :middle].sum()
    assert middle - columns[0] < columns[-1] - middle


@pytest.mark.parametrize("name", ["8", "15", "100", "red ball"])
def test_a_name_fits_its_disc(name: str) -> None:
    ink = number_picture(name)
    rows, columns = (np.mgrid[:GLYPH, :GLYPH] + 0.5) / (0.5 * GLYPH) - 1.0
    assert ink.max() == 1.0
    assert ink[np.hypot(rows, columns) > 0.95].max() == 0.0


@pytest.mark.parametrize(
    "axis, angle, x, y", [("y", 0.6, 1.0, 0.0), ("y", -0.6, -1.0, 0.0), ("x", 0.6, 0.0, -1.0), ("x", -0.6, 0.0, 1.0)]
)
def test_a_number_goes_the_way_that_the_ball_rolls(axis: str, angle: float, x: float, y: float) -> None:
    picture, plain = ball("3", about(axis, angle)), ball("3", about("y", 0.5 * math.pi))
    rows, columns = np.mgrid[: 2 * BALL, : 2 * BALL] + 0.5 - BALL
    inside = np.hypot(rows, columns) < 0.9 * BALL  # the discs of the plain one are at the rim
    disc = inside & (np.abs(picture - plain).max(axis=2) > 20.0)
    assert disc.sum() == pytest.approx(math.pi * (DISC * BALL) ** 2 * math.cos(angle), rel=0.1)
    # The disc is flat: its middle lies below the surface.
    out = math.sin(abs(angle)) * math.sqrt(1.0 - DISC**2)
    assert whereabouts(disc) == pytest.approx((x * out, y * out), abs=0.02)


def test_a_cue_ball_has_six_spots_that_show_its_spin() -> None:
    red = [
        saturation(at(ball("cue", orientation), 0.0, 0.0)) > 0.5
        for orientation in (UPRIGHT, about("x", 0.5 * math.pi), about("y", -0.5 * math.pi), about("x", math.pi))
    ]
    assert all(red)
    assert saturation(at(ball("cue", about("x", 0.25 * math.pi)), 0.0, 0.0)) < 0.2


def test_frames_show_balls_where_they_are(tmp_path: Path) -> None:
    scene = bs.scenes.glancing()
    recording = record(scene, until=0.5)
    painter = Painter(scene, 1000)
    scale = 1000.0 / (scene.table.x_max + scene.table.rail_thickness)
    (pose,) = recording.poses([0.25])
    simulation = bs.Simulation(scene)
    simulation.run(until=0.25)
    frame = painter.frame(pose).astype(int)
    yellow = (frame[..., 0] > 140) & (frame[..., 1] > 100) & (frame[..., 2] < 70)
    rows, columns = np.nonzero(yellow)
    seen = (columns.mean() + 0.5) / scale, (painter.height - rows.mean() - 0.5) / scale
    assert seen == pytest.approx(simulation.positions[1], abs=0.3 * RADIUS)


def test_balls_beyond_the_picture_are_left_out() -> None:
    scene = bs.scenes.head_on()
    painter = Painter(scene, 400)
    far = painter.frame(Pose(0.0, np.array([[-9.0, 0.5], [1e6, 9.0]]), np.array([UPRIGHT] * 2)))
    partly = painter.frame(Pose(0.0, np.array([[0.0, 0.5], [1.0, 0.0]]), np.array([UPRIGHT] * 2)))
    assert far.shape == partly.shape == (painter.height, painter.width, 3)
    assert (far != partly).any()


@pytest.mark.parametrize("name", ["time_step", "paper"])
def test_a_stepped_solvers_balls_turn_as_they_roll(name: str) -> None:
    speed = 0.8
    scene = bs.Scene([[0.5, 0.6]], [[0.0, speed]], [[-speed / RADIUS, 0.0, 0.0]])
    recording = record(scene, name, 0.01, until=0.25)
    start, later = recording.poses([recording.start.time, 0.2345])
    assert start.orientations == pytest.approx(np.array([UPRIGHT]))
    way = later.positions[0, 1] - 0.6
    assert way > 5.0 * RADIUS
    x, y, z, w = later.orientations[0]
    assert (y, z) == pytest.approx((0.0, 0.0))
    # The paper's rolling friction pushes the slip about, which is 1 % of the speed.
    tolerance = 1e-3 if name == "time_step" else 0.02 * way / RADIUS
    assert math.remainder(2.0 * math.atan2(x, w) + way / RADIUS, 2.0 * math.pi) == pytest.approx(0.0, abs=tolerance)


def test_a_stepped_solvers_balls_turn_as_the_engines_do() -> None:
    scene = bs.Scene([[0.5, 0.6]], [[2.0, 0.4]], [[60.0, -90.0, 120.0]])
    (exact,) = record(scene, until=0.3).poses([0.3])
    errors = []
    for time_step in (2e-3, 1e-3):
        (stepped,) = record(scene, "time_step", time_step, until=0.3).poses([0.3])
        cosine = abs(float((exact.orientations * stepped.orientations).sum()))
        errors.append(2.0 * math.acos(min(1.0, cosine)))
    assert errors[1] < 0.5 * errors[0] < 0.05


FILMED = ("glancing", "--until", "0.51")
FRAMES = 17
"""At 0, 1/30, ... 15/30 s and at the end."""


def assert_looks_like(frame: NDArray[np.float64], painted: NDArray[np.uint8], within: float) -> None:
    assert frame.shape == painted.shape
    assert np.abs(frame.astype(float) - painted).mean() < within


def painted(longest: int, time: float) -> NDArray[np.uint8]:
    recording = record(bs.scenes.glancing(), until=0.51)
    (pose,) = recording.poses([time])
    return Painter(recording.scene, longest).frame(pose)


def test_gif_has_a_frame_every_thirtieth_of_a_second(tmp_path: Path) -> None:
    path = tmp_path / "out.gif"
    assert simulate.main([*FILMED, "--movie", str(path)]) == 0
    with Image.open(path) as movie:
        assert movie.format == "GIF"
        assert movie.size[0] == SIZES[".gif"]
        assert movie.n_frames == FRAMES
        shown = []
        for index in range(FRAMES):
            movie.seek(index)
            shown.append(movie.info["duration"])
            if index in (0, 15, 16):
                frame = np.asarray(movie.convert("RGB"))
                assert_looks_like(frame, painted(SIZES[".gif"], min(index / 30.0, 0.51)), 2.0)
    assert set(shown) == {30, 40}
    assert sum(shown) == pytest.approx(1000.0 * FRAMES / 30.0, abs=5.0)


def test_mp4_has_a_frame_every_thirtieth_of_a_second(tmp_path: Path) -> None:
    path = tmp_path / "out.mp4"
    assert simulate.main([*FILMED, "--movie", str(path)]) == 0
    reader = imageio_ffmpeg.read_frames(str(path))
    about_it = next(reader)
    width, height = about_it["size"]
    assert width == SIZES[".mp4"]
    assert about_it["fps"] == 30.0
    frames = [np.frombuffer(frame, dtype=np.uint8).reshape(height, width, 3) for frame in reader]
    assert len(frames) == FRAMES
    for index in (0, 8, 16):
        assert_looks_like(frames[index], painted(width, min(index / 30.0, 0.51)), 4.0)


@pytest.mark.parametrize("ending", SIZES)
@pytest.mark.parametrize("name", ["event", "time_step", "paper"])
def test_every_solver_can_be_filmed(tmp_path: Path, ending: str, name: str) -> None:
    recording = record(bs.scenes.head_on(), name, 0.01, until=0.1)
    path = tmp_path / f"out{ending}"
    seconds = recording.end.time - recording.start.time
    assert write_movie(recording, path, 160) == math.ceil(30.0 * seconds - 1e-6) + 1
    assert path.stat().st_size > 500


def test_a_run_that_does_not_move_is_a_movie_of_one_frame(tmp_path: Path) -> None:
    path = tmp_path / "out.gif"
    assert write_movie(record(bs.scenes.rack()), path, 160) == 1
    with Image.open(path) as movie:
        assert movie.n_frames == 1


@pytest.mark.parametrize("terminal", [False, True])
def test_progress_is_shown_on_a_terminal_only(tmp_path: Path, terminal: bool) -> None:
    code = (
        "from pathlib import Path\n"
        "import billiards_sim as bs\n"
        "from billiards_sim.study.movie import write_movie\n"
        "from billiards_sim.study.recording import record\n"
        f"write_movie(record(bs.scenes.head_on(), 'time_step', until=0.1), Path({str(tmp_path / 'out.gif')!r}), 160)\n"
    )
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    os.set_blocking(ours, False)
    run = subprocess.run(
        [sys.executable, "-c", code], stderr=theirs if terminal else subprocess.PIPE, timeout=120, check=True
    )
    shown = os.read(ours, 100_000) if terminal else run.stderr
    os.close(theirs)
    os.close(ours)
    assert (b"out.gif" in shown and b"frame" in shown) if terminal else shown == b""


@pytest.mark.parametrize("ending", [".gif", ".mp4"])
@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("frames", [1, 5])
def test_an_interrupted_movie_leaves_what_was_there(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    ending: str,
    there: bool,
    frames: int,
) -> None:
    path = tmp_path / f"shot{ending}"
    if there:
        path.write_bytes(b"before")
    frame, painted = Painter.frame, []

    def interrupted(self: Painter, pose: Pose) -> NDArray[np.uint8]:
        painted.append(pose.time)
        if len(painted) == frames:
            os.kill(os.getpid(), signal.SIGTERM)
        return frame(self, pose)

    monkeypatch.setattr(Painter, "frame", interrupted)
    before = {number: signal.getsignal(number) for number in STOPPING}
    try:
        assert simulate.main(["head_on", "--until", "1", "--movie", str(path)]) == 1
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert capfd.readouterr().err == "simulate: stopped\n"
    assert len(painted) == frames
    assert os.listdir(tmp_path) == ([path.name] if there else [])
    if there:
        assert path.read_bytes() == b"before"
