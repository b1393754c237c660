# SPDX-License-Identifier: Apache-2.0
"""What RViz draws: balls as spheres with stripes and trails, flashes at contacts, the table as triangles, previews."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Point
from numpy.typing import NDArray
from std_msgs.msg import ColorRGBA, Header
from visualization_msgs.msg import Marker, MarkerArray

from billiards_sim.colours import (
    CLOTH,
    HOLE,
    MARKING,
    RUBBER,
    STRIPE,
    WHITE,
    WOOD,
    ball_colour,
    is_striped,
)
from billiards_sim.engine.events import Event
from billiards_sim.engine.markings import lines, spots
from billiards_sim.engine.table import Table
from billiards_sim.outline import Polygon, outline, triangles
from billiards_sim.quaternion import IDENTITY, product
from billiards_sim.ros.messages import NANOSECONDS, set_stamp
from billiards_sim.ros.preview import Preview

CLOTH_THICKNESS = 0.01
"""m, for the eye only."""

PATH_WIDTH = 0.006
"""m, of the lines of a preview."""

CONTACT_SIZE = 0.02
"""m, of the points of contact of a preview."""

CONTACT = (1.0, 0.3, 0.1)
"""Their colour, red green blue."""

DASH, GAP = 0.03, 0.02
"""m, of the lines of striped balls in a preview: of two balls of one colour, a line tells which."""

MOST_DASHES = 200
"""Of a line; one of more than 10 m has longer dashes: a thousand for each striped ball took 0.1 s of a tick."""

PREVIEW_OPACITY = 0.4
"""Of the balls where a preview ends."""

POCKET_DEPTH = 2.5
"""In ball radii under the cloth, for the eye only."""

SPOT_SIZE, SPOT_HEIGHT = 0.012, 0.001
"""m, across and up, of spots and sights."""

LINE_WIDTH = 0.004
"""m, of the lines on the cloth."""

RAIL_HEIGHT = 1.25
"""In ball radii above the cloth, for the eye only: where balls touch a rail is `Table.nose_height`."""

LINE_WHITE = 0.35
"""Share of white in the lines of a ball, to be seen on the cloth: some balls are green, too."""

STRIPE_TURN = np.array([[math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]])
"""A quarter turn about x: the axis of a cylinder is z, that of a stripe the ball's y."""

STRIPE_GIRTH = 1.03
"""Diameter of a stripe in those of the ball: enough to be seen around it."""

TRAIL_TIME = 0.67
"""s of the wall clock that a trail goes back."""

TRAIL_POINTS = 20
"""Most messages that a trail goes back: `TRAIL_TIME` at 30 Hz, less where messages come faster."""

MOST_CORNERS = 40
"""Of a trail, at contacts: a break at 8 m/s makes 4 in that time, a fast table more."""

CORNERS_APART = 1e-3
"""m. A contact nearer to the point before makes no corner that could be seen; in a cluster there are many."""

TRAIL_WIDTH = 0.5
"""Of a trail, in ball radii."""

TRAIL_OPACITY = 0.8
"""Of a trail at the ball, from where it falls evenly to nearly 0; below 1, for RViz blends no line that is opaque."""

TRAIL_LIFETIME = 1.0
"""s after which a trail goes if no message renews it, in the clock of who draws: a table that stops leaves none."""

FLASH = (0.2, 1.0, 1.0)
"""Colour of the flash at a contact: cyan, unlike any ball, cloth or wood."""

FLASH_SIZE = 1.4
"""Diameter of a flash in ball radii: between two balls that touch, a smaller one is hidden."""

FLASH_LIFETIME = 0.3
"""s that a flash stays, in the clock of who draws."""

FLASH_IDS = 1000
"""After which ids of flashes come again: more than messages in a flash's lifetime at the highest marker rate."""

MOST_FLASHES = 100
"""Contacts in one message, the last ones; a break begins with some 20 in a thirtieth of a second."""


class BallMarkers:
    """The balls of a scene: one message, updated in place.

    Namespaces: `balls` and `stripes`, each with id = place in the scene; `trails`, likewise, of the balls that move;
    `contacts`, a flash at each.

    Args:
        names: of the balls.
        radius: m.
        rate: messages a second.
        frame: of the table.
    """

    def __init__(self, names: Sequence[str], radius: float, rate: float, frame: str) -> None:
        self._radius = float(radius)
        self._header = Header(frame_id=frame)  # of all markers
        self._message = MarkerArray()
        self._balls = []
        self._stripes: list[tuple[int, Marker]] = []
        self._trails = []
        for index, name in enumerate(names):
            ball = self._marker("balls", index, Marker.SPHERE, WHITE if is_striped(name) else ball_colour(name))
            ball.pose.position.z = self._radius
            ball.scale.x = ball.scale.y = ball.scale.z = 2.0 * self._radius
            self._balls.append(ball)
            if is_striped(name):
                stripe = self._marker("stripes", index, Marker.CYLINDER, ball_colour(name))
                stripe.pose.position = ball.pose.position  # the same object
                stripe.scale.x = stripe.scale.y = 2.0 * STRIPE_GIRTH * self._radius
                stripe.scale.z = 2.0 * STRIPE * self._radius
                self._stripes.append((index, stripe))
            line = self._marker("trails", index, Marker.LINE_STRIP, _line_colour(name))
            line.scale.x = TRAIL_WIDTH * self._radius
            self._trails.append(_Trail(line, self._radius, max(1, min(round(TRAIL_TIME * rate), TRAIL_POINTS))))
        self._trail_of = dict(zip(names, self._trails))
        self._lasting = [*self._balls, *(stripe for _, stripe in self._stripes)]  # of the balls that are seen
        self._leaving: list[Marker] = []  # of those that no longer are, until the next message
        self._seen = [True] * len(self._balls)
        self._flash = self._marker("contacts", 0, Marker.SPHERE_LIST, FLASH)
        self._flash.scale.x = self._flash.scale.y = self._flash.scale.z = FLASH_SIZE * self._radius
        self._flash.lifetime = _duration(FLASH_LIFETIME)
        self._contacts: deque[Point] = deque(maxlen=MOST_FLASHES)
        self._turned = True
        self._turn(None)
        self._stamp: int | None = None

    def update(
        self,
        positions: Sequence[Sequence[float]],
        stamp: int,
        orientations: Sequence[Sequence[float]] | None = None,
        in_play: list[bool] | None = None,
    ) -> MarkerArray:
        """The message of a state, the same object every time. While the stamp stays the same, so do the trails.

        Args:
            positions: (N, 2) m, Python floats.
            stamp: ns.
            orientations: (N, 4) unit quaternions x y z w, Python floats; None for balls that are all upright.
            in_play: (N,) whether each ball is; None for all. Others lie in their pockets, or nowhere and are not seen.
        """
        plays = in_play or [True] * len(self._balls)
        self._show([not math.isnan(x) for x, _ in positions])
        set_stamp(self._header.stamp, stamp)
        for ball, (x, y), is_there, is_seen in zip(self._balls, positions, plays, self._seen):
            if is_seen:
                ball.pose.position.x = x
                ball.pose.position.y = y
                ball.pose.position.z = self._radius if is_there else -self._radius
        self._turn(orientations)
        if stamp != self._stamp:
            for trail, (x, y), is_there in zip(self._trails, positions, plays):
                trail.follow(x, y) if is_there else trail.end()
            self._stamp = stamp
        self._message.markers = [*self._lasting, *self._leaving, *(trail.marker for trail in self._trails if trail.due)]
        if self._contacts:
            self._flash.id = (self._flash.id + 1) % FLASH_IDS
            self._flash.points = list(self._contacts)
            self._contacts.clear()
            self._message.markers.append(self._flash)
        return self._message

    def note(self, events: Iterable[Event]) -> None:
        """What happens between two messages: contacts flash with the next one, and bend the trails."""
        for event in _contacts(events):
            (x, y), (across, along) = event.point, event.normal
            self._contacts.append(Point(x=x, y=y, z=self._radius))
            # The normal points from the second ball, or from the rail, to the first.
            for name, side in zip(event.balls, (self._radius, -self._radius)):
                self._trail_of[name].turn(x + side * across, y + side * along)

    def restart(self) -> None:
        """The balls are put elsewhere, or messages were left out: trails start anew, contacts are forgotten."""
        for trail in self._trails:
            trail.restart()
        self._contacts.clear()
        self._stamp = None

    def _show(self, seen: list[bool]) -> None:
        # What belongs to a ball that has left is taken away by one message.
        self._leaving = []
        if seen == self._seen:
            return
        self._lasting = []
        for index, marker in [*enumerate(self._balls), *self._stripes]:
            marker.action = Marker.ADD if seen[index] else Marker.DELETE
            if seen[index]:
                self._lasting.append(marker)
            elif self._seen[index]:
                self._leaving.append(marker)
        self._seen = seen

    def _turn(self, orientations: Sequence[Sequence[float]] | None) -> None:
        turned = orientations is not None
        if not (turned or self._turned):
            return
        turns = orientations or [IDENTITY] * len(self._balls)
        for ball, turn in zip(self._balls, turns):
            _set_orientation(ball, turn)
        if self._stripes:
            striped = np.array([turns[index] for index, _ in self._stripes])
            for (_, stripe), turn in zip(self._stripes, product(striped, STRIPE_TURN).tolist()):
                _set_orientation(stripe, turn)
        self._turned = turned

    def _marker(self, namespace: str, index: int, shape: int, colour: tuple[float, float, float]) -> Marker:
        marker = _marker(namespace, index, shape, colour)
        marker.header = self._header
        return marker


class _Trail:
    # Where a ball was in the last messages, `length` of them, and where it hit something between them; newest first.

    def __init__(self, marker: Marker, height: float, length: int) -> None:
        marker.lifetime = _duration(TRAIL_LIFETIME)
        red, green, blue = marker.color.r, marker.color.g, marker.color.b
        opacities = [TRAIL_OPACITY * (length - age) / length for age in range(length)]
        self._colours = [ColorRGBA(r=red, g=green, b=blue, a=opacity) for opacity in opacities]  # by age in messages
        self.marker = marker
        self.due = False  # to be sent
        self._drawn = False
        self._height = height
        self._message = 0
        self._corners: deque[tuple[float, float]] = deque(maxlen=MOST_CORNERS)
        self._points: deque[tuple[int, Point]] = deque(maxlen=MOST_CORNERS + length)  # the message that brought each

    def turn(self, x: float, y: float) -> None:
        """The ball was here (m) when it hit something, between the last message and the next."""
        self._corners.append((x, y))

    def follow(self, x: float, y: float) -> None:
        """The ball is here (m) one message later; a trail whose ball rests loses its end, and is taken away with it."""
        self._message += 1
        points = self._points
        if points:
            for corner in self._corners:
                if math.dist(corner, (points[0][1].x, points[0][1].y)) > CORNERS_APART:
                    self._add(*corner)
        self._corners.clear()
        if points and (points[0][1].x, points[0][1].y) == (x, y):
            points[0] = self._message, points[0][1]
        else:
            self._add(x, y)
        while self._message - points[-1][0] >= len(self._colours):
            points.pop()
        drawn = len(points) > 1
        self.due = drawn or self._drawn
        if self.due:
            self.marker.action = Marker.ADD if drawn else Marker.DELETE
            self.marker.points = [point for _, point in points]
            self.marker.colors = [self._colours[self._message - message] for message, _ in points]
        self._drawn = drawn

    def end(self) -> None:
        """The ball has left the table."""
        self.restart()
        self.due, self._drawn = self._drawn, False
        self.marker.action = Marker.DELETE

    def restart(self) -> None:
        """Forget where the ball was."""
        self._points.clear()
        self._corners.clear()

    def _add(self, x: float, y: float) -> None:
        self._points.appendleft((self._message, Point(x=x, y=y, z=self._height)))


def table_markers(table: Table, radius: float, stamp: int, frame: str) -> MarkerArray:
    """Cloth with its surface at z = 0, cushions, rails and pockets as triangles; spots and sights as flat balls; lines.

    Args:
        radius: of the balls, m.
        stamp: ns.
        frame: of the table.
    """
    parts = outline(table)
    top, bottom = RAIL_HEIGHT * radius, -POCKET_DEPTH * radius
    (left, right), (low, high) = parts.outer
    frame_of_wood = np.array([(left, low), (right, low), (right, high), (left, high)])
    meshes = [
        ("cloth", CLOTH, [*_face(parts.cloth, 0.0), *_sides(frame_of_wood, -CLOTH_THICKNESS, 0.0)]),
        ("cushions", RUBBER, [mesh for one in parts.cushions for mesh in (*_face(one, top), *_sides(one, 0.0, top))]),
        ("rails", WOOD, [mesh for one in parts.wood for mesh in (*_face(one, top), *_sides(one, 0.0, top))]),
        ("pockets", HOLE, [mesh for one in parts.holes for mesh in (*_face(one, bottom), *_sides(one, bottom, 0.0))]),
    ]
    message = MarkerArray()
    for namespace, colour, faces in meshes:
        if faces:
            marker = _marker(namespace, 0, Marker.TRIANGLE_LIST, colour)
            marker.scale.x = marker.scale.y = marker.scale.z = 1.0
            marker.points = [Point(x=x, y=y, z=z) for x, y, z in np.concatenate(faces).reshape(-1, 3).tolist()]
            message.markers.append(marker)
    for namespace, places, z in (
        ("spots", np.array(list(spots(table).values())), 0.0),
        ("sights", parts.sights, top),
    ):
        if len(places):
            marker = _marker(namespace, 0, Marker.SPHERE_LIST, MARKING)
            marker.scale.x = marker.scale.y = SPOT_SIZE
            marker.scale.z = SPOT_HEIGHT
            marker.points = [Point(x=x, y=y, z=z) for x, y in places.tolist()]
            message.markers.append(marker)
    drawn = [pair for line in lines(table) for ends in pairwise(line) for pair in ends]
    if drawn:
        marker = _marker("lines", 0, Marker.LINE_LIST, MARKING)
        marker.scale.x = LINE_WIDTH
        marker.points = [Point(x=x, y=y, z=0.5 * SPOT_HEIGHT) for x, y in drawn]
        message.markers.append(marker)
    for marker in message.markers:
        _set_header(marker, stamp, frame)
    return message


def _face(polygon: Polygon, z: float) -> list[NDArray[np.float64]]:
    # (T, 3, 3) triangles, seen from above.
    level = np.column_stack((polygon, np.full(len(polygon), z)))
    return [level[triangles(polygon)]]


def _sides(polygon: Polygon, low: float, high: float) -> list[NDArray[np.float64]]:
    # (T, 3, 3) triangles of upright walls.
    begin, end = polygon, np.roll(polygon, -1, axis=0)
    corners = [np.column_stack((ends, np.full(len(ends), z))) for z in (low, high) for ends in (begin, end)]
    return [np.stack([corners[index] for index in face], axis=1) for face in ((0, 1, 3), (0, 3, 2))]


def preview_markers(preview: Preview | None, stamp: int, frame: str) -> MarkerArray:
    """What a shot would do, in place of the preview before.

    For each ball that moves (id = its place in the scene) a line, dashed for a striped ball, and the ball, translucent,
    where it ends; the points of contact. Nothing where there is no preview.
    """
    message = erasing()
    if preview is None:
        return message
    radius, fallen = preview.scene.physics.radius, preview.pocketed
    for index, name in enumerate(preview.scene.names):
        path = preview.paths.get(name, ())
        if len(path) < 2:
            continue  # a translucent ball where the ball itself lies would only tint it
        points = [(x, y) for _, x, y in path]
        shape = Marker.LINE_LIST if is_striped(name) else Marker.LINE_STRIP
        line = _marker("preview_paths", index, shape, _line_colour(name))
        line.scale.x = PATH_WIDTH
        line.points = [Point(x=x, y=y, z=radius) for x, y in (_dashes(points) if is_striped(name) else points)]
        ball = _marker("preview_balls", index, Marker.SPHERE, ball_colour(name))
        _, ball.pose.position.x, ball.pose.position.y = path[-1]
        ball.pose.position.z = -radius if name in fallen else radius
        ball.scale.x = ball.scale.y = ball.scale.z = 2.0 * radius
        ball.color.a = PREVIEW_OPACITY
        message.markers += [line, ball]
    hits = [event.point for event in _contacts(preview.events)]
    if hits:
        contacts = _marker("preview_contacts", 0, Marker.SPHERE_LIST, CONTACT)
        contacts.scale.x = contacts.scale.y = contacts.scale.z = CONTACT_SIZE
        contacts.points = [Point(x=x, y=y, z=radius) for x, y in hits]
        message.markers.append(contacts)
    for marker in message.markers:
        _set_header(marker, stamp, frame)
    return message


def _contacts(events: Iterable[Event]) -> list[Event]:
    # Of balls with each other and with rails.
    return [event for event in events if event.kind in ("ball_ball", "ball_rail")]


def _dashes(path: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    # The ends of each dash of a line through these points, m; a dash that turns a corner is two.
    lengths = [math.dist(one, other) for one, other in pairwise(path)]
    period = max(DASH + GAP, sum(lengths) / MOST_DASHES)
    dash = period * DASH / (DASH + GAP)
    ends = []
    begin = 0.0  # of a piece, along the line
    for (one, other), length in zip(pairwise(path), lengths):
        for number in range(int(begin // period), int((begin + length) // period) + 1):
            low, high = max(number * period, begin), min(number * period + dash, begin + length)
            if low < high:
                ends += [_between(one, other, (at - begin) / length) for at in (low, high)]
        begin += length
    return ends


def _between(one: tuple[float, float], other: tuple[float, float], share: float) -> tuple[float, float]:
    return one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1])


def erasing() -> MarkerArray:
    """Takes everything off a marker topic: a new scene may have fewer balls."""
    message = MarkerArray()
    message.markers.append(_marker("", 0, Marker.SPHERE, CLOTH))
    message.markers[0].action = Marker.DELETEALL
    return message


def _marker(namespace: str, index: int, shape: int, colour: tuple[float, float, float]) -> Marker:
    marker = Marker()
    marker.ns = namespace
    marker.id = index
    marker.type = shape
    marker.action = Marker.ADD
    marker.pose.orientation.w = 1.0
    red, green, blue = colour
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    return marker


def _set_header(marker: Marker, stamp: int, frame: str) -> None:
    set_stamp(marker.header.stamp, stamp)
    marker.header.frame_id = frame


def _line_colour(name: str) -> tuple[float, float, float]:
    red, green, blue = (LINE_WHITE + (1.0 - LINE_WHITE) * part for part in ball_colour(name))
    return red, green, blue


def _set_orientation(marker: Marker, orientation: Sequence[float]) -> None:
    turn = marker.pose.orientation
    turn.x, turn.y, turn.z, turn.w = orientation


def _duration(seconds: float) -> Duration:
    sec, nanosec = divmod(round(seconds * NANOSECONDS), NANOSECONDS)
    return Duration(sec=sec, nanosec=nanosec)
