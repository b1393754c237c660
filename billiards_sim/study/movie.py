# SPDX-License-Identifier: Apache-2.0
"""Movies of a run from above, with balls whose stripes and numbers roll.

A pixel of a ball is the point of its surface above it. Turned into the ball's own frame, that point tells what is
painted there: the ball's z axis goes through both numbers, one of them upside down; y is the axis of the stripe.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from tqdm import tqdm

from billiards_sim.colours import (
    CLOTH,
    DISC,
    HOLE,
    MARKING,
    RUBBER,
    STRIPE,
    WHITE,
    WOOD,
    ball_colour,
    is_plain,
    is_striped,
)
from billiards_sim.engine.markings import lines, spots
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.table import Table
from billiards_sim.outline import Polygon, outline
from billiards_sim.quaternion import rotation_matrices
from billiards_sim.study.falls import DURATION, Fall, falls
from billiards_sim.study.recording import Pose, Recording, ticks

FRAME_RATE = 30
"""Frames in a second of simulated time."""

MOST_FRAMES = 100_000
"""Frames of a movie: an hour of it, and an hour or two of work."""

SIZES = {".mp4": 1280, ".gif": 800}
"""Pixels of the longer side, by the ending of the file name."""

SPOT = 0.2
"""Radius of the six spots of the cue ball, in radii."""

PIT_SHADE = 0.55
"""How much darker a ball is at the bottom of a pocket."""

SPOT_COLOUR = (0.75, 0.10, 0.10)
BLACK = (0.06, 0.06, 0.06)

LIGHT = np.array([-0.40, 0.45, 0.80])
"""Where the light comes from, about a unit vector."""

SUPERSAMPLING = 3
"""Points along a pixel's side at which a ball is looked at."""

SPOT_RADIUS = 0.006
"""m, of the spots on the cloth."""

LINE_WIDTH = 0.004
"""m, of the lines on it: some 3 mm, and seen in a small movie."""

GLYPH = 128
"""Pixels of a side of the picture of a number."""

Pixels = NDArray[np.float32]
Shape: TypeAlias = tuple[Sequence[Polygon], Sequence[float]]
"""Polygons, m, and their colour."""


class Painter:
    """Draws the frames of a scene.

    Args:
        longest: pixels of the longer side of a frame; the table just fits in. Both sides are even, as video needs.
        falls: of its balls, by their places in it.
    """

    def __init__(self, scene: Scene, longest: int, falls: Mapping[int, Fall] | None = None) -> None:
        table = scene.table
        parts = outline(table)
        sides = [high - low for low, high in parts.outer]
        self._scale = longest / max(sides)  # px/m
        self.width, self.height = (max(2, 2 * math.ceil(0.5 * side * self._scale - 1e-6)) for side in sides)
        self._corner = np.array([low for low, _ in parts.outer])  # at the left bottom of the picture
        self._falls = falls or {}
        self._radius = scene.physics.radius * self._scale  # px
        self._in_play = scene.in_play
        self._looks = [Look(name) for name in scene.names]
        self._table = _picture(_table_shapes(table), self._scale, self._corner, (self.width, self.height))
        # Balls in pockets show where there is neither wood nor rubber above them.
        shapes = [(parts.holes, (1.0,) * 3), ([parts.cloth], (1.0,) * 3), (parts.cushions, (0.0,) * 3)]
        self._open = _picture(shapes, self._scale, self._corner, (self.width, self.height))[..., :1] if falls else None
        rail = table.rail_thickness * self._scale
        self._clock_size = min(int(0.7 * rail), 24)  # px
        beside = 1.5 if table.mouths else 1.0  # in rails: not in a pocket
        self._clock_place = (int(beside * rail), self.height - int(0.5 * rail))

    def frame(self, pose: Pose) -> NDArray[np.uint8]:
        """(height, width, 3) red, green, blue."""
        canvas = self._table.copy()
        rotations = rotation_matrices(pose.orientations)
        fallen = {index: fall for index, fall in self._falls.items() if fall.time <= pose.time}
        for index, fall in fallen.items():
            place, depth = fall.at(pose.time)
            self._draw_fallen(canvas, self._pixel(place), self._looks[index], rotations[index], depth)
        seen = [index for index in np.flatnonzero(self._in_play).tolist() if index not in fallen]
        for index in seen:
            self._draw_shadow(canvas, self._pixel(pose.positions[index]))
        for index in seen:
            self._draw_ball(canvas, self._pixel(pose.positions[index]), self._looks[index], rotations[index])
        picture = (255.0 * canvas + 0.5).astype(np.uint8)
        return self._with_clock(picture, pose.time)

    def _pixel(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        across, up = (place - self._corner) * self._scale
        return np.array((across, self.height - up))

    def _draw_fallen(
        self,
        canvas: Pixels,
        centre: NDArray[np.float64],
        look: Look,
        rotation: NDArray[np.float64],
        depth: float,
    ) -> None:
        # Darker the deeper it lies, and under cushions and wood.
        assert self._open is not None
        above = canvas.copy()
        self._draw_ball(canvas, centre, look, rotation)
        reach = math.ceil(1.5 * self._radius)
        column, row = (max(int(part), 0) for part in centre)
        part = (slice(max(row - reach, 0), row + reach), slice(max(column - reach, 0), column + reach))
        shade = np.float32(1.0 - PIT_SHADE * depth)
        changed = (canvas[part] != above[part]).any(axis=2, keepdims=True)
        shaded = np.where(changed, canvas[part] * shade, canvas[part])
        canvas[part] = self._open[part] * shaded + (1.0 - self._open[part]) * above[part]

    def _draw_shadow(self, canvas: Pixels, centre: NDArray[np.float64]) -> None:
        shift = 0.22 * self._radius
        left, top, x, y = _patch(centre + shift, self._radius, 1)
        distance = np.sqrt(x * x + y * y)
        shade: Pixels = np.float32(0.45) * np.clip((np.float32(1.1) - distance) / np.float32(0.3), 0.0, 1.0)
        _blend(canvas, left, top, shade[..., np.newaxis], np.zeros(3, dtype=np.float32))

    def _draw_ball(
        self, canvas: Pixels, centre: NDArray[np.float64], look: Look, rotation: NDArray[np.float64]
    ) -> None:
        left, top, x, y = _patch(centre, self._radius, SUPERSAMPLING)
        inside = x * x + y * y <= 1.0
        x, y = x[inside], y[inside]
        normal = np.column_stack((x, y, np.sqrt(np.maximum(1.0 - x * x - y * y, 0.0))))
        colour = look.paint(normal @ rotation.astype(np.float32))
        facing = np.clip(normal @ LIGHT.astype(np.float32), 0.0, 1.0)[:, np.newaxis]
        colour = np.minimum(colour * (0.45 + 0.6 * facing) + 0.5 * facing**60, 1.0)
        painted = np.zeros((*inside.shape, 4), dtype=np.float32)
        painted[inside, :3] = colour
        painted[inside, 3] = 1.0
        side = inside.shape[0] // SUPERSAMPLING
        small = painted.reshape(side, SUPERSAMPLING, side, SUPERSAMPLING, 4).mean(axis=(1, 3))
        cover = small[..., 3:]
        _blend(canvas, left, top, cover, small[..., :3] / np.maximum(cover, 1e-6))

    def _with_clock(self, picture: NDArray[np.uint8], time: float) -> NDArray[np.uint8]:
        if self._clock_size < 8:
            return picture
        image = Image.fromarray(picture)
        font = ImageFont.load_default(self._clock_size)
        colour = tuple(int(255 * part) for part in MARKING)
        ImageDraw.Draw(image).text(self._clock_place, f"{time:.2f} s", fill=colour, font=font, anchor="lm")
        return np.asarray(image)


class Look:
    """How the ball of a name is painted."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._colour = np.array(ball_colour(name), dtype=np.float32)
        self._striped = is_striped(name)
        self._ink = None if is_plain(name) else number_picture(name)

    def paint(self, points: Pixels) -> Pixels:
        """(P, 3) colours at points of the surface, (P, 3), unit vectors in the ball's own frame."""
        colours = np.broadcast_to(self._colour, points.shape).astype(np.float32)
        x, y, z = points.T
        if self._name == "cue":
            colours[np.abs(points).max(axis=1) > math.sqrt(1.0 - SPOT**2)] = SPOT_COLOUR
            return colours
        if self._ink is None:
            return colours
        if self._striped:
            colours[np.abs(y) > STRIPE] = WHITE
        disc = x * x + y * y < DISC**2
        across, up = x[disc], np.where(z[disc] > 0.0, y[disc], -y[disc])
        column = ((0.5 + 0.5 * across / DISC) * GLYPH).astype(int).clip(0, GLYPH - 1)
        row = ((0.5 - 0.5 * up / DISC) * GLYPH).astype(int).clip(0, GLYPH - 1)
        ink = self._ink[row, column, np.newaxis]
        colours[disc] = (1.0 - ink) * np.array(WHITE, dtype=np.float32) + ink * np.array(BLACK, dtype=np.float32)
        return colours


def write_movie(recording: Recording, path: Path, longest: int | None = None) -> int:
    """Film a run, 30 frames a second of simulated time, from the start to the end, both included, or until
    every ball that falls lies in its pocket.

    Shows its progress on stderr where that is a terminal.

    Args:
        path: of the movie, its ending one of `SIZES`.
        longest: pixels of the longer side, by default what `SIZES` says.

    Returns:
        The number of frames.

    Raises:
        TooMany: more than `MOST_FRAMES` frames.
        OSError: the file cannot be written.
        ImportError: MP4 without imageio-ffmpeg.
    """
    ending = path.suffix.lower()
    fallen = falls(recording.scene, recording.events)
    painter = Painter(recording.scene, longest or SIZES[ending], fallen)
    end = recording.end.time
    times = frame_times(recording.start.time, max([end, *(fall.time + DURATION for fall in fallen.values())]))
    poses = recording.poses(np.minimum(times, end))
    shown = tqdm(zip(times.tolist(), poses), total=len(times), desc=path.name, unit="frame", leave=False, disable=None)
    frames = (painter.frame(pose._replace(time=time)) for time, pose in shown)
    if ending == ".gif":
        _write_gif(path, frames, len(times))
    else:
        _write_mp4(path, frames, painter.width, painter.height)
    return len(times)


def frame_times(start: float, end: float) -> NDArray[np.float64]:
    """(T,) times of the frames of a run, s.

    Raises:
        TooMany: more than `MOST_FRAMES`.
    """
    return ticks(start, end, 1.0 / FRAME_RATE, MOST_FRAMES)


def number_picture(name: str) -> Pixels:
    """(GLYPH, GLYPH) ink from 0 to 1 of a name that fits a disc; 6 and 9 are underlined, as they are on balls."""
    image = Image.new("L", (GLYPH, GLYPH), 0)
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(0.66 * GLYPH)
    left, top, right, bottom = draw.textbbox((0, 0), name, font=font, anchor="mm", stroke_width=2)
    widest = 0.9 * GLYPH
    if math.hypot(right - left, bottom - top) > widest:
        font = ImageFont.load_default(0.66 * GLYPH * widest / math.hypot(right - left, bottom - top))
    middle = (0.5 * GLYPH, 0.5 * GLYPH)
    left, top, right, bottom = draw.textbbox(middle, name, font=font, anchor="mm", stroke_width=2)
    draw.text((middle[0], GLYPH - 0.5 * (top + bottom)), name, fill=255, font=font, anchor="mm", stroke_width=2)
    if name in ("6", "9"):
        low = 0.5 * (GLYPH + bottom - top) + 0.04 * GLYPH
        draw.rectangle((left, low, right, low + 0.06 * GLYPH), fill=255)
    ink: Pixels = np.asarray(image, dtype=np.float32) / np.float32(255.0)
    return ink


def _table_shapes(table: Table) -> list[Shape]:
    # What is painted one over the other, with its colour.
    parts = outline(table)
    (left, right), (low, high) = parts.outer
    light = tuple(1.6 * part for part in CLOTH)
    return [
        ([np.array([(left, low), (right, low), (right, high), (left, high)])], WOOD),
        ([parts.cloth], CLOTH),
        (parts.holes, HOLE),
        (parts.cushions, RUBBER),
        ([_strip(np.array(line), LINE_WIDTH) for line in lines(table)], light),
        ([_dot(spot, SPOT_RADIUS) for spot in spots(table).values()], light),
        ([_dot(sight, 0.05 * table.rail_thickness) for sight in parts.sights.tolist()], MARKING),
    ]


def _dot(place: Sequence[float], radius: float) -> Polygon:
    angles = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
    return np.array(place) + radius * np.column_stack((np.cos(angles), np.sin(angles)))


def _strip(line: NDArray[np.float64], width: float) -> Polygon:
    # A line as wide as this.
    along = np.gradient(line, axis=0)
    aside = 0.5 * width * np.column_stack((-along[:, 1], along[:, 0])) / np.hypot(*along.T)[:, np.newaxis]
    return np.concatenate((line - aside, (line + aside)[::-1]))


def _picture(shapes: Iterable[Shape], scale: float, corner: NDArray[np.float64], size: tuple[int, int]) -> Pixels:
    # (height, width, 3) from 0 to 1; black where no shape is.
    fine = 4
    width, height = size
    image = Image.new("RGB", (fine * width, fine * height))
    draw = ImageDraw.Draw(image)
    for polygons, colour in shapes:
        for polygon in polygons:
            places = fine * scale * (polygon - corner)
            places[:, 1] = fine * height - places[:, 1]
            draw.polygon([*places.ravel().tolist()], fill=_bytes(colour))
    small = image.resize((width, height), Image.Resampling.BOX)
    return np.asarray(small, dtype=np.float32) / np.float32(255.0)


def _patch(centre: NDArray[np.float64], radius: float, fine: int) -> tuple[int, int, Pixels, Pixels]:
    """Left and top pixel of a square about a ball, and the x and y, in radii, of its points from the ball's centre."""
    reach = math.ceil(1.1 * radius) + 1
    left, top = (int(math.floor(part)) - reach for part in centre.tolist())
    points = (np.arange((2 * reach + 1) * fine) + 0.5) / fine
    x = ((left - centre[0] + points) / radius).astype(np.float32)
    y = ((centre[1] - top - points) / radius).astype(np.float32)
    return left, top, np.broadcast_to(x, (x.size, x.size)), np.broadcast_to(y[:, np.newaxis], (x.size, x.size))


def _blend(canvas: Pixels, left: int, top: int, cover: Pixels, colour: Pixels) -> None:
    # What lies outside of the picture is left out.
    height, width = cover.shape[:2]
    rows = slice(max(0, -top), max(0, min(height, canvas.shape[0] - top)))
    columns = slice(max(0, -left), max(0, min(width, canvas.shape[1] - left)))
    paint = np.broadcast_to(colour, (height, width, 3))[rows, columns]
    target = canvas[max(0, top) : max(0, top + height), max(0, left) : max(0, left + width)]
    target += cover[rows, columns] * (paint - target)


def _bytes(colour: Sequence[float]) -> tuple[int, ...]:
    return tuple(round(255.0 * part) for part in colour)


def _write_gif(path: Path, frames: Iterator[NDArray[np.uint8]], count: int) -> None:
    # One palette for all frames, from the first, on which every colour is; so what rests does not flicker.
    first = Image.fromarray(next(frames))
    palette = first.quantize(255, method=Image.Quantize.MEDIANCUT)

    def reduced(frame: Image.Image) -> Image.Image:
        return frame.quantize(palette=palette, dither=Image.Dither.NONE)

    # GIF counts in hundredths of a second: two frames of 3, one of 4.
    shown = [round(100 * index / FRAME_RATE) for index in range(count + 1)]
    durations = [10 * (end - begin) for begin, end in zip(shown, shown[1:])]
    rest = (reduced(Image.fromarray(frame)) for frame in frames)
    reduced(first).save(path, save_all=True, append_images=rest, duration=durations, loop=0)


def _write_mp4(path: Path, frames: Iterator[NDArray[np.uint8]], width: int, height: int) -> None:
    import imageio_ffmpeg

    writer: Any = imageio_ffmpeg.write_frames(str(path), (width, height), fps=FRAME_RATE, quality=8, macro_block_size=2)
    writer.send(None)
    try:
        for frame in frames:
            writer.send(np.ascontiguousarray(frame))
    except BaseException:
        with suppress(KeyboardInterrupt):
            writer.throw(KeyboardInterrupt)  # ends ffmpeg before it can complain of a movie that is too short
        raise
    writer.close()
