# SPDX-License-Identifier: Apache-2.0
"""Where to aim to pot a ball, by geometry alone.

The struck ball must come to where it touches the object ball on the far side of the line into the pocket: the ghost
ball, two radii behind the object ball. A ball that goes by way of a rail goes straight to a mirror image, of the pocket
(a bank) or of the ghost ball (a kick); one that has to drive another goes to the ghost ball of that one (a
combination). Throw, friction and the rails' losses are left out: they move the aim within `window`.

With d the way to a ghost ball, an error e of the direction there passes the object ball's line by d e, and turns the
way of the object ball by d e / (2 R cos(cut)).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from billiards_sim.engine.features import RAILS, features_of
from billiards_sim.engine.pocket import Mouth, Place
from billiards_sim.engine.quantity import listed, shown
from billiards_sim.engine.scene import Scene, index_of

THROW = 0.13
"""rad, 7.4 degrees. More than friction between balls turns the way of an object ball: atan(0.118) is 6.7 degrees."""

REBOUND = 0.35
"""rad, 20 degrees. About what a rail's losses and its friction turn a rebound away from the mirror image by."""

THINNEST = math.radians(80.0)
"""Cut beyond which a hit is no shot: less than 1 % of the ball's energy goes over at 85 degrees, and it is missed."""

GRAZE = 0.1
"""Radii by which a way may cut through a ball or a rail: what moves the aim may yet lead past it."""

NARROWEST = 0.003
"""m. Half of the opening that a pocket is taken to have at any angle: jaws and rails still lead balls in."""


class Direction(NamedTuple):
    """A direction to search around."""

    azimuth: float
    """rad, of the struck ball's way"""
    window: float
    """rad, to each side, within which the aim is to be found"""
    tolerance: float
    """rad, by which the azimuth may be off, to each side, and the ball still falls; nan: nothing is known"""
    kind: str = "any"
    """direct, bank, kick or combination; any: not from geometry"""
    ball: str = ""
    """the ball that is to fall"""
    pocket: str = ""
    """where"""
    cut: float = math.nan
    """rad, between the way of the ball that hits and the way of the ball that is hit, at the first hit"""

    def probability(self, azimuth: float) -> float:
        """That a ball falls, by geometry, with normal errors of the azimuth alone, of this standard deviation, rad."""
        return math.erf(self.tolerance / (math.sqrt(2.0) * azimuth)) if azimuth > 0.0 else 1.0


class _Way(NamedTuple):
    """How a ball can be sent off so that in the end something falls."""

    ball: int
    x: float
    """direction, of length 1"""
    y: float
    window: float
    """rad, to each side of this direction"""
    tolerance: float
    """rad, likewise"""
    kind: str
    target: int
    """the ball that is to fall"""
    pocket: str


def pots(scene: Scene, ball: str | None = None, pocket: str | None = None, struck: str = "cue") -> list[Direction]:
    """Ways to pot a ball, the most forgiving first; none where balls bar them all.

    Direct, by one rail of the struck ball or of the object ball, and by one ball in between.

    Args:
        ball: to be potted; None: any but the struck one.
        pocket: name; None: any.

    Raises:
        ValueError: no such ball or pocket, or balls that are not in play.
    """
    table = _Layout(scene, struck)
    targets = table.others if ball is None else [table.index(ball)]
    if table.struck in targets:
        raise ValueError(f"ball {shown(struck)} is the one that is struck")
    mouths = scene.table.mouths
    if pocket is not None:
        mouths = tuple(mouth for mouth in mouths if mouth.name == pocket)
        if not mouths:
            known = listed([mouth.name for mouth in scene.table.mouths]) or "none"
            raise ValueError(f"no pocket is named {shown(pocket)}; the pockets are {known}")
    found: list[Direction] = []
    for target in targets:
        for mouth in mouths:
            for way in table.into(target, mouth):
                found += table.starts(way)
                found += table.kicks(way)
                for longer in table.combinations(way):
                    found += table.starts(longer)
    return sorted(found, key=lambda start: -start.tolerance)


class _Layout:
    """Where balls lie, and what bars their ways. Places are in m from the centre of the table."""

    def __init__(self, scene: Scene, struck: str) -> None:
        self.names = scene.names
        self.in_play = scene.in_play
        self.struck = self.index(struck)
        self.places = scene.positions - np.array(scene.table.centre)
        self.radius = scene.physics.radius
        self.half = (0.5 * scene.table.length - self.radius, 0.5 * scene.table.width - self.radius)
        self.rails = dict(zip(RAILS, features_of(scene.table, self.radius)))
        self.others = [index for index in np.flatnonzero(scene.in_play).tolist() if index != self.struck]

    def index(self, name: str) -> int:
        index = index_of(self.names, name)
        if not self.in_play[index]:
            raise ValueError(f"ball {shown(name)} is not in play")
        return index

    def into(self, ball: int, mouth: Mouth) -> Iterator[_Way]:
        """Ways of a ball into a pocket: straight, and by each rail."""
        start, middle = self._place(ball), _middle(mouth)
        for rail in (None, *RAILS):
            image = middle if rail is None else self._mirrored(middle, rail)
            length = math.dist(start, image)
            if length == 0.0:
                continue
            bounce = None if rail is None else self._bounce(start, image, rail)
            if rail is not None and bounce is None:
                continue
            last = start if bounce is None else bounce
            half_width = _opening(mouth, last) - self.radius
            legs = [(start, middle)] if bounce is None else [(start, bounce), (bounce, middle)]
            if half_width <= -GRAZE * self.radius or not all(self._is_clear(*leg, {ball}) for leg in legs):
                continue
            yield _Way(
                ball,
                (image[0] - start[0]) / length,
                (image[1] - start[1]) / length,
                THROW if rail is None else THROW + REBOUND,
                max(half_width, NARROWEST) / length,
                "direct" if rail is None else "bank",
                ball,
                mouth.name,
            )

    def combinations(self, way: _Way) -> Iterator[_Way]:
        """Ways of other balls that drive the ball on its way."""
        if way.kind != "direct":
            return
        ghost = self._ghost(way)
        for ball in self.others:
            if ball == way.ball or not self._is_inside(ghost):
                continue
            start = self._place(ball)
            hit = self._hit(start, ghost, way)
            if hit is not None and self._is_clear(start, ghost, {ball, way.ball}):
                (x, y), _, turn = hit
                yield way._replace(
                    ball=ball,
                    x=x,
                    y=y,
                    window=way.window * turn + THROW,
                    tolerance=way.tolerance * turn,
                    kind="combination",
                )

    def starts(self, way: _Way) -> Iterator[Direction]:
        """The struck ball straight at the ball of a way."""
        ghost, start = self._ghost(way), self._place(self.struck)
        hit = self._hit(start, ghost, way)
        if hit is None or not self._is_inside(ghost) or not self._is_clear(start, ghost, {self.struck, way.ball}):
            return
        yield self._start(way, way.kind, hit, 0.0)

    def kicks(self, way: _Way) -> Iterator[Direction]:
        """The struck ball by one rail at the ball of a way that goes straight."""
        if way.kind != "direct":
            return
        ghost, start = self._ghost(way), self._place(self.struck)
        if not self._is_inside(ghost):
            return
        for rail in RAILS:
            image = self._mirrored(ghost, rail)
            bounce = self._bounce(start, image, rail)
            if bounce is None or not self._is_clear(start, bounce, {self.struck}):
                continue
            last = self._hit(bounce, ghost, way)
            if last is None or not self._is_clear(bounce, ghost, {self.struck, way.ball}):
                continue
            length = math.dist(start, image)
            direction = ((image[0] - start[0]) / length, (image[1] - start[1]) / length)
            turn = last[2] * math.dist(bounce, ghost) / length
            yield self._start(way, "kick", (direction, last[1], turn), REBOUND * math.dist(bounce, ghost) / length)

    def _start(self, way: _Way, kind: str, hit: tuple[Place, float, float], window: float) -> Direction:
        (x, y), cut, turn = hit
        return Direction(
            math.atan2(y, x),
            way.window * turn + window,
            way.tolerance * turn,
            kind,
            self.names[way.target],
            way.pocket,
            cut,
        )

    def _place(self, ball: int) -> Place:
        x, y = self.places[ball].tolist()
        return x, y

    def _ghost(self, way: _Way) -> Place:
        x, y = self._place(way.ball)
        return x - 2.0 * self.radius * way.x, y - 2.0 * self.radius * way.y

    def _hit(self, start: Place, ghost: Place, way: _Way) -> tuple[Place, float, float] | None:
        # Direction to the ghost ball, the cut there, and by how much less than the way of the object ball that
        # direction may be off. From a ball that touches the object ball already any direction will do.
        length = math.dist(start, ghost)
        if length < GRAZE * self.radius:
            return (way.x, way.y), 0.0, 1.0
        x, y = (ghost[0] - start[0]) / length, (ghost[1] - start[1]) / length
        cosine = x * way.x + y * way.y
        if cosine < math.cos(THINNEST):
            return None
        return (x, y), math.acos(min(cosine, 1.0)), min(2.0 * self.radius * cosine / length, 1.0)

    def _mirrored(self, place: Place, rail: str) -> Place:
        axis, sign = _axis(rail)
        image = [place[0], place[1]]
        image[axis] = sign * 2.0 * self.half[axis] - image[axis]
        return image[0], image[1]

    def _bounce(self, start: Place, image: Place, rail: str) -> Place | None:
        # Where the way to a mirror image meets the rail; None where it does not, or where there is no rubber.
        axis, sign = _axis(rail)
        limit = sign * self.half[axis]
        ahead = image[axis] - start[axis]
        if sign * ahead <= 0.0 or sign * (image[axis] - limit) <= 0.0:
            return None
        share = (limit - start[axis]) / ahead
        if not 0.0 < share < 1.0:
            return None
        place = [start[0] + share * (image[0] - start[0]), start[1] + share * (image[1] - start[1])]
        nose = self.rails[rail]
        on_rubber = nose.near <= abs(place[1 - axis]) <= min(nose.far, self.half[1 - axis])
        return (place[0], place[1]) if on_rubber else None

    def _is_inside(self, place: Place) -> bool:
        return all(abs(place[axis]) <= self.half[axis] + GRAZE * self.radius for axis in (0, 1))

    def _is_clear(self, start: Place, end: Place, but: set[int]) -> bool:
        # Whether a ball comes past all others but these and the struck one, which will have left.
        barring = [index for index in self.others if index not in but]
        if not barring:
            return True
        along = np.array(end) - start
        from_start = self.places[barring] - start
        share = np.clip(from_start @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
        away = np.hypot(*(from_start - share[:, np.newaxis] * along).T)
        return bool((away > (2.0 - GRAZE) * self.radius).all())


def _axis(rail: str) -> tuple[int, float]:
    return "xy".index(rail[0]), -1.0 if rail.endswith("min") else 1.0


def _tips(mouth: Mouth) -> tuple[Place, Place]:
    # Where the lines of nose and jaw meet.
    found = []
    for edge in mouth.edges:
        back = mouth.pocket.setback / math.dist(edge.start, edge.end)
        found.append(
            (
                edge.start[0] - back * (edge.end[0] - edge.start[0]),
                edge.start[1] - back * (edge.end[1] - edge.start[1]),
            )
        )
    return found[0], found[1]


def _middle(mouth: Mouth) -> Place:
    one, other = _tips(mouth)
    return 0.5 * (one[0] + other[0]), 0.5 * (one[1] + other[1])


def _opening(mouth: Mouth, start: Place) -> float:
    # Half the width of a mouth as seen from a place, m.
    (one, other), middle = _tips(mouth), _middle(mouth)
    across, way = (other[0] - one[0], other[1] - one[1]), (middle[0] - start[0], middle[1] - start[1])
    return 0.5 * abs(way[0] * across[1] - way[1] * across[0]) / max(math.hypot(*way), 1e-300)
