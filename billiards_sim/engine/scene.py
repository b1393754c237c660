# SPDX-License-Identifier: Apache-2.0
"""A scene: the balls at the start, the table, the physics and, if wanted, a first shot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from billiards_sim.engine.features import check_fits, trouble_at
from billiards_sim.engine.physics import SPEED_LIMIT, Physics
from billiards_sim.engine.quantity import float_array, is_text, listed, numbers, shown
from billiards_sim.engine.table import Table

OVERLAP_TOLERANCE = 1e-9
"""m. How far a start position may reach into another ball or a rail: decimal positions of touching balls are rounded
by 1e-16 m, positions that went through a text file by 1e-10 m; one that is further in is a mistake."""

LONGEST_NAME = 100
"""Characters of a ball's name: more fits no line and no picture."""

PAPER_TABLE = Table()
PAPER_PHYSICS = Physics()


@dataclass(frozen=True)
class Shot:
    """A cue shot: what `Simulation.strike` takes.

    Attributes:
        force: (x, y, z) N; z < 0: the butt is raised.
        offset: where the tip hits, (sideways, up) m from the centre of the ball, seen along the force and across it.
        ball: name of the ball.
    """

    force: tuple[float, float, float]
    offset: tuple[float, float] = (0.0, 0.0)
    ball: str = "cue"

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", numbers("shot.force", self.force, 3))
        object.__setattr__(self, "offset", numbers("shot.offset", self.offset, 2))


@dataclass(frozen=True, eq=False, init=False)
class Scene:
    """Where everything starts. Arrays are checked, copied and made read-only.

    Args:
        positions: (N, 2) m, ball centres in the frame `table`.
        velocities: (N, 2) m/s, default 0.
        angular_velocities: (N, 3) rad/s, default 0.
        in_play: (N,) truth values, default all. A ball that is not in play is off the table: nothing hits it and it
            overlaps with nothing. Whatever is given as its position becomes nan, as its velocities 0.
        names: N different names; default "cue", "1", "2", ...
        table, physics: default to the paper's.
        name: of the scene, for people.
        shot: a first shot, for whoever runs the scene; a `Simulation` does not play it by itself.
        track_orientation: whether a `Simulation` keeps `orientations`; it costs time only then.

    Raises:
        ValueError: wrong shape, not finite, faster than `SPEED_LIMIT`, names that are no text or not different, balls
            that overlap, reach into a rail or into a part of a pocket by more than `OVERLAP_TOLERANCE`, or lie in a
            pocket, pockets that balls of this radius do not fall into, a shot at a ball that is not there or not in
            play. The text names the ball and the figure.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    angular_velocities: NDArray[np.float64]
    names: tuple[str, ...]
    table: Table
    physics: Physics
    name: str
    shot: Shot | None
    track_orientation: bool
    in_play: NDArray[np.bool_]

    def __init__(
        self,
        positions: ArrayLike,
        velocities: ArrayLike | None = None,
        angular_velocities: ArrayLike | None = None,
        names: Sequence[str] | None = None,
        table: Table = PAPER_TABLE,
        physics: Physics = PAPER_PHYSICS,
        *,
        name: str = "",
        shot: Shot | None = None,
        track_orientation: bool = False,
        in_play: ArrayLike | None = None,
    ) -> None:
        try:
            count = len(positions)  # type: ignore[arg-type]
        except TypeError:
            count = 0
        if count == 0:
            raise ValueError("a scene needs at least one ball: positions must have shape (N, 2), N >= 1")
        _check_type("table", table, Table)
        _check_type("physics", physics, Physics)
        _check_type("track_orientation", track_orientation, bool)
        _check_type("name", name, str)
        if not is_text(name):
            raise ValueError(f"name must be free of control characters and surrogates, got {shown(name)}")
        ball_names = _names(names, count)
        on_table = _truth_values("in_play", in_play, count)
        values = {
            "positions": _rows("positions", positions, ball_names, 2, on_table, math.nan),
            "velocities": _rows("velocities", velocities, ball_names, 2, on_table),
            "angular_velocities": _rows("angular_velocities", angular_velocities, ball_names, 3, on_table),
            "names": ball_names,
            "table": table,
            "physics": physics,
            "name": name,
            "shot": shot,
            "track_orientation": track_orientation,
            "in_play": on_table,
        }
        for key, value in values.items():
            object.__setattr__(self, key, value)
        _check_speeds(self)
        _check_inside_rails(self)
        _check_no_overlap(self)
        if shot is not None:
            _check_type("shot", shot, Shot)
            if shot.ball not in ball_names:
                raise ValueError(f"shot.ball {shown(shot.ball)} is not in the scene; its balls: {listed(ball_names)}")
            if not on_table[ball_names.index(shot.ball)]:
                raise ValueError(f"shot.ball {shown(shot.ball)} is not in play")

    def __len__(self) -> int:
        return len(self.names)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Scene):
            return NotImplemented
        pairs = [(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)]
        return self is other or all(
            np.array_equal(a, b, equal_nan=a.dtype.kind == "f") if isinstance(a, np.ndarray) else a == b
            for a, b in pairs
        )

    def __hash__(self) -> int:
        return hash((self.names, self.table, self.physics, self.name, self.shot))

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for value in state.values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False  # which copies and unpickled arrays are not


def _check_type(name: str, value: Any, expected: type) -> None:
    if not isinstance(value, expected):
        raise ValueError(f"{name} must be a {expected.__name__}, got {shown(value)}")


def _names(given: Any, count: int) -> tuple[str, ...]:
    if given is None:
        return ("cue", *(str(index) for index in range(1, count)))
    names = (given,) if isinstance(given, str) else tuple(given)
    for name in names:
        _check_name(name)
    if len(names) != count:
        raise ValueError(f"{len(names)} names for {count} balls")
    if len(set(names)) < count:
        double = next(name for index, name in enumerate(names) if name in names[:index])
        raise ValueError(f"two balls are named {double!r}")
    return names


def _check_name(name: Any) -> None:
    if not isinstance(name, str) or not name:
        raise ValueError(f"ball names must be non-empty strings, got {shown(name)}")
    if len(name) > LONGEST_NAME:
        raise ValueError(f"ball names must have at most {LONGEST_NAME} characters, got {len(name)}: {shown(name)}")
    if not is_text(name):
        raise ValueError(f"ball names must be free of control characters and surrogates, got {name!r}")


def _truth_values(key: str, given: ArrayLike | None, count: int) -> NDArray[np.bool_]:
    values = np.ones(count, dtype=np.bool_) if given is None else np.array(given)
    if values.dtype.kind != "b" or values.shape != (count,):
        raise ValueError(f"{key} must be truth values of shape ({count},), got {shown(given)}")
    values.flags.writeable = False
    return values


def _rows(
    key: str,
    given: ArrayLike | None,
    names: tuple[str, ...],
    width: int,
    in_play: NDArray[np.bool_],
    otherwise: float = 0.0,
) -> NDArray[np.float64]:
    # `otherwise` is what those have that are not in play.
    count = len(names)
    try:
        rows = np.zeros((count, width)) if given is None else float_array(given)
    except ValueError:
        raise ValueError(f"{key} must be numbers of shape ({count}, {width}), got {shown(given)}") from None
    if rows.shape != (count, width):
        raise ValueError(f"{key} must have shape ({count}, {width}), got {rows.shape}")
    rows[~in_play] = 0.0
    for name, row in zip(names, rows, strict=True):
        if not np.isfinite(row).all():
            raise ValueError(f"{key} of ball {name!r} must be finite, got {row.tolist()}")
    rows[~in_play] = otherwise
    rows.flags.writeable = False
    return rows


def _check_speeds(scene: Scene) -> None:
    for name, velocity, spin in zip(scene.names, scene.velocities, scene.angular_velocities, strict=True):
        for what, speed in (("speed", np.hypot(*velocity)), ("spin times radius", _rim_speed(spin, scene.physics))):
            if not speed <= SPEED_LIMIT:
                raise ValueError(f"{what} of ball {name!r} must be <= {SPEED_LIMIT:g} m/s, got {speed:.9g}")


def _rim_speed(spin: NDArray[np.float64], physics: Physics) -> float:
    return math.hypot(*spin.tolist()) * physics.radius


def _check_inside_rails(scene: Scene) -> None:
    table, radius = scene.table, scene.physics.radius
    check_fits(table, radius)
    if table.mouths:
        _check_outside_pockets(scene)
        return
    for axis, low, high in ((0, table.x_min, table.x_max), (1, table.y_min, table.y_max)):
        low, high = low + radius, high - radius
        outside = np.maximum(low - scene.positions[:, axis], scene.positions[:, axis] - high)
        worst = int(np.argmax(np.where(scene.in_play, outside, -np.inf)))
        if outside[worst] > OVERLAP_TOLERANCE:
            raise ValueError(
                f"ball {scene.names[worst]!r} reaches {outside[worst]:.6g} m into a rail: its {'xy'[axis]} is "
                f"{scene.positions[worst, axis]:.9g}, allowed {low:.9g} to {high:.9g}"
            )


def _check_outside_pockets(scene: Scene) -> None:
    centred = scene.positions - scene.table.centre
    room = 0.5 * np.array([scene.table.length, scene.table.width]) - scene.physics.radius
    for index in np.flatnonzero((np.abs(centred) > room).any(axis=1)):  # nan, off the table, is nowhere
        x, y = centred[index].tolist()
        trouble = trouble_at(scene.table, scene.physics.radius, x, y, OVERLAP_TOLERANCE)
        if trouble:
            at_x, at_y = scene.positions[index].tolist()
            raise ValueError(f"ball {scene.names[index]!r} at ({at_x:.9g}, {at_y:.9g}) {trouble}")


def _check_no_overlap(scene: Scene) -> None:
    diameter = 2.0 * scene.physics.radius
    by_x = np.argsort(scene.positions[:, 0], kind="stable")  # nan, off the table, comes last and overlaps with nothing
    ordered = scene.positions[by_x]
    for rank, position in enumerate(ordered[:-1]):
        end = int(np.searchsorted(ordered[:, 0], position[0] + diameter, side="right"))
        distances = np.hypot(*(ordered[rank + 1 : end] - position).T)
        if distances.size and diameter - distances.min() > OVERLAP_TOLERANCE:
            first, second = sorted((int(by_x[rank]), int(by_x[rank + 1 + int(np.argmin(distances))])))
            raise ValueError(overlap_of(scene.names[first], scene.names[second], float(distances.min()), diameter))


def overlap_of(first: str, second: str, distance: float, diameter: float) -> str:
    """What is wrong with two balls whose centres are so far apart, m."""
    return (
        f"balls {first!r} and {second!r} overlap by {diameter - distance:.6g} m: their centres are {distance:.9g} m "
        f"apart, two radii are {diameter:.9g} m"
    )


def index_of(names: Sequence[str], ball: str) -> int:
    """Which of the balls of these names a ball is.

    Raises:
        ValueError: none.
    """
    if ball not in names:
        raise ValueError(f"no ball is named {shown(ball)}; the balls are {listed(names)}")
    return names.index(ball)
