# SPDX-License-Identifier: Apache-2.0
"""Balls where a camera saw them: what a message says, checked, and freed of the camera's noise."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TypeAlias

import numpy as np
from geometry_msgs.msg import Point, PoseArray, Vector3
from numpy.typing import NDArray
from sensor_msgs.msg import MultiDOFJointState

from billiards_sim.engine.features import opening_at, trouble_at
from billiards_sim.engine.scene import Scene
from billiards_sim.ros.separation import TOUCHING, separated
from billiards_sim.ros.wrench import check_frame

Places: TypeAlias = dict[str, NDArray[np.float64]]
"""(x, y) m by the balls' names, in the order of the scene."""


def placed_balls(message: PoseArray, scene: Scene, tolerance: float, frame: str) -> Places:
    """Where the balls of a scene are after `place_balls`: as the message says, with small overlaps removed.

    Args:
        message: one pose a ball in the order of the scene; heights and orientations do not matter.
        scene: names of the balls, table, radius.
        tolerance: m, by which balls may overlap, or reach into a rail.
        frame: of the table.

    Returns:
        The place of every ball; they are apart or touch, inside the rails.

    Raises:
        ValueError: another frame, another number of poses, a position that is not finite, outside the rails or in
            another ball by more than the tolerance, or so little room that the balls cannot be separated.
    """
    check_frame(message.header.frame_id, frame)
    if len(message.poses) != len(scene):
        raise ValueError(
            f"place_balls takes one pose a ball, {len(scene)} in the order of balls/poses ({scene.names[0]!r} first); "
            f"got {len(message.poses)}"
        )
    return _without_noise((pose.position for pose in message.poses), scene.names, scene, tolerance)


def named_balls(message: MultiDOFJointState, scene: Scene, tolerance: float, frame: str) -> Places:
    """Where the balls are that lie on the table after `set_balls`; the others are off it.

    Args:
        message: a name and a transform a ball; heights, rotations, twists and wrenches do not matter.
        scene, tolerance, frame: as for `placed_balls`.

    Returns:
        The place of each ball that is named; they are apart or touch, inside the rails.

    Raises:
        ValueError: as `placed_balls`; another number of transforms than of names, an unknown name, one that comes
            twice.
    """
    check_frame(message.header.frame_id, frame)
    if len(message.joint_names) != len(message.transforms):
        raise ValueError(
            f"set_balls takes one transform a name, got {len(message.joint_names)} names and "
            f"{len(message.transforms)} transforms"
        )
    points = dict(zip(message.joint_names, (transform.translation for transform in message.transforms)))
    if len(points) != len(message.joint_names):
        twice = next(name for name in points if message.joint_names.count(name) > 1)
        raise ValueError(f"ball {twice!r} is named twice")
    for name in points:
        if name not in scene.names:
            raise ValueError(f"no ball is named {name!r}; the balls are {', '.join(scene.names)}")
    names = [name for name in scene.names if name in points]
    return _without_noise((points[name] for name in names), names, scene, tolerance)


def _without_noise(points: Iterable[Point | Vector3], names: Sequence[str], scene: Scene, tolerance: float) -> Places:
    seen = np.array([(point.x, point.y, point.z) for point in points]).reshape(-1, 3)
    for name, point in zip(names, seen):
        if not np.isfinite(point).all():
            raise ValueError(f"the position of ball {name!r} must be finite, got {tuple(point.tolist())} m")
    positions = seen[:, :2]
    radius = scene.physics.radius
    low = np.tile(np.array([scene.table.x_min, scene.table.y_min]) + radius, (len(positions), 1))
    high = np.tile(np.array([scene.table.x_max, scene.table.y_max]) - radius, (len(positions), 1))
    noise = max(tolerance, TOUCHING)  # what comes from the table's own poses may go back
    if scene.table.mouths:
        for index in np.flatnonzero(((positions < low) | (positions > high)).any(axis=1)).tolist():
            place = _in_mouth(positions[index], names[index], scene, noise)
            if place is not None:
                positions[index] = low[index] = high[index] = place
    _check_rails(positions, low, high, names, noise)
    _check_overlaps(positions, 2.0 * radius, names, noise)
    return dict(zip(names, separated(positions, low, high, 2.0 * radius, names)))


def _in_mouth(position: NDArray[np.float64], name: str, scene: Scene, tolerance: float) -> tuple[float, float] | None:
    # Where a ball beyond the noses lies that is in the mouth of a pocket, out of its parts; None if it is in none.
    table, radius = scene.table, scene.physics.radius
    x, y = position.tolist()
    centre_x, centre_y = table.centre
    centred = x - centre_x, y - centre_y
    opening = opening_at(table, radius, *centred)
    if opening is None:
        return None
    trouble = trouble_at(table, radius, *centred, tolerance)
    if trouble:
        raise ValueError(f"ball {name!r} at ({x:.9g}, {y:.9g}) m {trouble}; placement_tolerance is {tolerance:g} m")
    free = opening.freed(*centred, radius, TOUCHING)
    if free is None:
        raise ValueError(f"ball {name!r} at ({x:.9g}, {y:.9g}) m has no room in the mouth of pocket {opening.name}")
    return (x, y) if free == centred else (free[0] + centre_x, free[1] + centre_y)


def _check_rails(
    positions: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    names: Sequence[str],
    tolerance: float,
) -> None:
    outside = np.maximum(low - positions, positions - high)
    for name, position, depths, least, most in zip(names, positions, outside, low, high):
        axis = int(np.argmax(depths))
        if depths[axis] > tolerance:
            raise ValueError(
                f"ball {name!r} reaches {depths[axis]:.6g} m into a rail, placement_tolerance is {tolerance:g} m: its "
                f"{'xy'[axis]} is {position[axis]:.9g} m, the table allows {least[axis]:.9g} to {most[axis]:.9g} m"
            )


def _check_overlaps(positions: NDArray[np.float64], diameter: float, names: Sequence[str], tolerance: float) -> None:
    first, second = np.triu_indices(len(positions), 1)
    if not len(first):
        return
    distances = np.hypot(*(positions[first] - positions[second]).T)
    worst = int(np.argmin(distances))
    if diameter - distances[worst] > tolerance:
        raise ValueError(
            f"balls {names[first[worst]]!r} and {names[second[worst]]!r} overlap by "
            f"{diameter - distances[worst]:.6g} m, placement_tolerance is {tolerance:g} m: their centres are "
            f"{distances[worst]:.9g} m apart, two radii are {diameter:.9g} m"
        )
