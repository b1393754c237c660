# SPDX-License-Identifier: Apache-2.0
"""Balls where a camera saw them: what a `PoseArray` says, checked, and freed of the camera's noise."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import PoseArray
from numpy.typing import NDArray

from billiards_sim.engine.scene import Scene
from billiards_sim.ros.separation import TOUCHING, separated
from billiards_sim.ros.wrench import check_frame


def placed_positions(message: PoseArray, scene: Scene, tolerance: float, frame: str) -> NDArray[np.float64]:
    """Where the balls of a scene are after a placement: as the message says, with small overlaps removed.

    Args:
        message: one pose a ball in the order of the scene; heights and orientations do not matter.
        scene: names of the balls, table, radius.
        tolerance: m, by which balls may overlap, or reach into a rail.
        frame: of the table.

    Returns:
        (N, 2) m, balls apart or touching, inside the rails.

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
    points = np.array([(pose.position.x, pose.position.y, pose.position.z) for pose in message.poses])
    for name, point in zip(scene.names, points):
        if not np.isfinite(point).all():
            raise ValueError(f"the position of ball {name!r} must be finite, got {tuple(point.tolist())} m")
    positions = points[:, :2]
    radius = scene.physics.radius
    low = np.array([scene.table.x_min, scene.table.y_min]) + radius
    high = np.array([scene.table.x_max, scene.table.y_max]) - radius
    tolerance = max(tolerance, TOUCHING)  # what comes from the table's own poses may go back
    _check_rails(positions, low, high, scene, tolerance)
    _check_overlaps(positions, scene, tolerance)
    return separated(positions, low, high, 2.0 * radius, scene.names)


def _check_rails(
    positions: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], scene: Scene, tolerance: float
) -> None:
    outside = np.maximum(low - positions, positions - high)
    ball, axis = np.unravel_index(np.argmax(outside), outside.shape)
    if outside[ball, axis] > tolerance:
        raise ValueError(
            f"ball {scene.names[ball]!r} reaches {outside[ball, axis]:.6g} m into a rail, placement_tolerance is "
            f"{tolerance:g} m: its {'xy'[axis]} is {positions[ball, axis]:.9g} m, the table allows "
            f"{low[axis]:.9g} to {high[axis]:.9g} m"
        )


def _check_overlaps(positions: NDArray[np.float64], scene: Scene, tolerance: float) -> None:
    diameter = 2.0 * scene.physics.radius
    first, second = np.triu_indices(len(positions), 1)
    if not len(first):
        return
    distances = np.hypot(*(positions[first] - positions[second]).T)
    worst = int(np.argmin(distances))
    if diameter - distances[worst] > tolerance:
        raise ValueError(
            f"balls {scene.names[first[worst]]!r} and {scene.names[second[worst]]!r} overlap by "
            f"{diameter - distances[worst]:.6g} m, placement_tolerance is {tolerance:g} m: their centres are "
            f"{distances[worst]:.9g} m apart, two radii are {diameter:.9g} m"
        )
