# SPDX-License-Identifier: Apache-2.0
"""What RViz shows with `config/table.rviz`, without RViz: `python3 -m billiards_sim.ros.tools.picture docs/rviz.png`.

The markers are those that the node publishes; the file says which of them are seen, and from where.
"""

from __future__ import annotations

import copy
import math
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from visualization_msgs.msg import Marker, MarkerArray

from billiards_sim.command_line import Parser, Refusal, run_to_end
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.scenes import EIGHT_BALL_BREAK
from billiards_sim.engine.simulation import Simulation
from billiards_sim.files import written
from billiards_sim.ros import markers, messages
from billiards_sim.ros.parameters import DEFAULT_FRAME, DEFAULT_SCENE, find_scene
from billiards_sim.ros.preview import predict
from billiards_sim.ros.tools.rendering import View, draw

CONFIGURATION = Path("config/table.rviz")
"""From the top of the repository."""

BREAK = EIGHT_BALL_BREAK
"""The break of the picture: that of the scene."""

SHOWN_AFTER = 0.7
"""s from the shot to the upper picture."""

PREVIEWED = Aim(speed=1.5, azimuth=math.radians(12.0))
"""The shot that the lower picture asks for, once the break has come to rest."""

RATE = 30.0
"""Hz, of the messages: the default `marker_rate`."""

SIZE = (920, 470)
"""Pixels of RViz's view that are in a picture: about what the dock leaves of the window's width."""

ZOOM = 1280 / 920
"""Pixels of the picture in one of those."""

DPI = 100
"""Pixels an inch, which matplotlib reckons in."""

TITLE = 24
"""Pixels of the line above each view."""

Sent = tuple[float, str, MarkerArray]
"""A message: s, topic, and what it is."""


class Display:
    """What RViz has in store of one marker topic.

    Args:
        settings: of the display in the RViz file.
    """

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self._enabled = bool(settings["Enabled"])
        self._namespaces: Mapping[str, bool] = settings.get("Namespaces", {})
        self._kept: dict[tuple[str, int], tuple[Marker, float]] = {}

    def take(self, message: MarkerArray, now: float) -> None:
        """A message that arrives, at a time in s. Its markers are kept as they are, so they must not change later."""
        for marker in message.markers:
            key = (marker.ns, marker.id)
            if marker.action == Marker.DELETEALL:
                self._kept.clear()
            elif marker.action == Marker.DELETE:
                self._kept.pop(key, None)
            else:
                lifetime = marker.lifetime.sec + marker.lifetime.nanosec / messages.NANOSECONDS
                self._kept[key] = (marker, now + lifetime if lifetime > 0.0 else math.inf)

    def shown(self, now: float) -> list[Marker]:
        """The markers that are seen at a time in s."""
        if not self._enabled:
            return []
        return [one for one, end in self._kept.values() if now < end and self._namespaces.get(one.ns, True)]


def read_view(settings: Mapping[str, Any], size: tuple[int, int], zoom: float) -> View:
    """The view of an RViz file's `Visualization Manager`.

    Args:
        size: pixels of RViz's own view.
        zoom: pixels of the picture in one of those.

    Raises:
        ValueError: the view is not one straight down with x to the right.
    """
    current, options = settings["Views"]["Current"], settings["Global Options"]
    if current["Class"] != "rviz_default_plugins/TopDownOrtho" or current["Angle"] != 0:
        raise ValueError(f"the view must be TopDownOrtho at angle 0, got {current['Class']} at {current.get('Angle')}")
    red, green, blue = (int(part) / 255 for part in options["Background Color"].split(";"))
    return View(
        (float(current["X"]), float(current["Y"])),
        zoom * float(current["Scale"]),
        (round(zoom * size[0]), round(zoom * size[1])),
        (red, green, blue),
        options["Fixed Frame"],
    )


def read_displays(settings: Mapping[str, Any]) -> dict[str, Display]:
    """The marker displays of an RViz file's `Visualization Manager`, by topic."""
    found = [one for one in settings["Displays"] if one["Class"] == "rviz_default_plugins/MarkerArray"]
    return {one["Topic"]["Value"]: Display(one) for one in found}


def break_messages(scene: Scene, shot: Aim, duration: float) -> Iterator[Sent]:
    """What the node publishes from a shot on, for a time in s."""
    simulation = _struck(scene, shot)
    balls = markers.BallMarkers(scene.names, scene.physics.radius, RATE, DEFAULT_FRAME)
    yield 0.0, "table_markers", markers.table_markers(scene.table, scene.physics.radius, 0, DEFAULT_FRAME)
    for tick in range(round(duration * RATE) + 1):
        stamp = round(simulation.time * messages.NANOSECONDS)
        message = balls.update(simulation.positions.tolist(), stamp, None, simulation.in_play.tolist())
        yield tick / RATE, "markers", copy.deepcopy(message)
        balls.note(simulation.advance(1.0 / RATE))


def preview_messages(simulation: Simulation, shot: Aim) -> Iterator[Sent]:
    """What the node publishes for a preview on a table at rest."""
    scene = simulation.start_scene
    physics = scene.physics
    balls = markers.BallMarkers(scene.names, physics.radius, RATE, DEFAULT_FRAME)
    preview = predict(simulation, shot.shot(physics))
    yield 0.0, "table_markers", markers.table_markers(scene.table, physics.radius, 0, DEFAULT_FRAME)
    yield 0.0, "markers", balls.update(simulation.positions.tolist(), 0, None, simulation.in_play.tolist())
    yield 0.0, "preview", markers.preview_markers(preview, 0, DEFAULT_FRAME)


def _struck(scene: Scene, shot: Aim) -> Simulation:
    simulation = Simulation(scene)
    simulation.shoot(shot.speed, shot.azimuth, shot.side, shot.up)
    return simulation


def draw_messages(axes: Axes, settings: Mapping[str, Any], sent: Iterable[Sent], view: View) -> None:
    """Draw what RViz shows after messages.

    Args:
        axes: with as many pixels as the view.
        settings: an RViz file's `Visualization Manager`.

    Raises:
        ValueError: as `draw`.
    """
    displays = read_displays(settings)
    now = 0.0
    for now, topic, message in sent:
        if topic in displays:
            displays[topic].take(message, now)
    draw(axes, [marker for display in displays.values() for marker in display.shown(now)], view)


def write_picture(path: Path, settings: Mapping[str, Any], size: tuple[int, int] = SIZE, zoom: float = ZOOM) -> None:
    """A break under way, and below it the preview of a shot once it has come to rest; PNG.

    Args:
        settings: an RViz file's `Visualization Manager`.
        size: pixels of RViz's own view.
        zoom: pixels of the picture in one of those.
    """
    scene = find_scene(DEFAULT_SCENE)
    broken = _struck(scene, BREAK)
    broken.run()
    view = read_view(settings, size, zoom)
    width, height = view.size
    rows = {
        f"{SHOWN_AFTER:g} s after a break shot of {BREAK.speed:g} m/s": break_messages(scene, BREAK, SHOWN_AFTER),
        f"at rest, the preview of a shot of {PREVIEWED.speed:g} m/s": preview_messages(broken, PREVIEWED),
    }
    full = len(rows) * (height + TITLE)
    figure = Figure(figsize=(width / DPI, full / DPI), dpi=DPI, facecolor=view.background)
    for row, (title, sent) in enumerate(rows.items()):
        bottom = full - (row + 1) * (height + TITLE)
        axes = figure.add_axes((0.0, bottom / full, 1.0, height / full))
        draw_messages(axes, settings, sent, view)
        middle = bottom + height + 0.5 * TITLE
        figure.text(0.01, middle / full, title, va="center", fontsize=9, color="white")
    with written(path) as file:
        figure.savefig(file, format="png", pil_kwargs={"optimize": True})


def main(arguments: list[str]) -> int:
    """Draw the picture; returns the exit code."""
    parser = Parser(prog="picture", description="Draw what RViz shows of a table, without RViz.")
    parser.add_argument("path", type=Path, metavar="FILE.png", help="where to")
    parser.add_argument("--rviz", type=Path, default=CONFIGURATION, metavar="FILE", help=f"({CONFIGURATION})")

    def play() -> int:
        options = parser.parse_args(arguments)
        try:
            settings = yaml.safe_load(options.rviz.read_text(encoding="utf-8"))["Visualization Manager"]
            write_picture(options.path, settings)
        except OSError as error:
            raise Refusal(str(error)) from None
        return 0

    return run_to_end("picture", play)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
