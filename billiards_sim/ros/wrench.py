# SPDX-License-Identifier: Apache-2.0
"""A cue shot as a wrench about the ball's centre, and back: see `engine.cue.torque`."""

from __future__ import annotations

import math
from collections.abc import Sequence

from geometry_msgs.msg import WrenchStamped

from billiards_sim.engine.cue import torque
from billiards_sim.engine.scene import Shot

TORQUE_TOLERANCE = 1e-5
"""m. Torque along the force, divided by the force, up to which it counts as rounding: a torque typed with four decimals
leaves 1e-6 m at 80 N and 1e-5 m at 8 N."""

CUE_BALL = "cue"
"""The one ball that `cue_shot` shoots."""

OFFSET_DECIMALS = 16
"""Decimals of an offset in m that are kept: finer ones are below the last bit of a position on the table. Rounding to
them gives an offset that was written in decimals back to the bit after its trip through a torque."""


def check_frame(frame: str, own: str) -> None:
    """Raises:
    ValueError: a frame other than the table's own or none.
    """
    if frame not in ("", own):
        raise ValueError(f"frame_id must be {own!r} or empty, got {frame!r}")


def shot_from_wrench(message: WrenchStamped, frame: str) -> Shot:
    """The shot that a wrench stands for. Whether the ball can take it is for `Simulation.strike` to say.

    Args:
        frame: of the table.

    Raises:
        ValueError: not finite, another frame, a force that is zero along the table or points up, torque along the
            force.
    """
    check_frame(message.header.frame_id, frame)
    force, torque = message.wrench.force, message.wrench.torque
    for name, vector, unit in (("force", force, "N"), ("torque", torque, "N m")):
        if not all(map(math.isfinite, (vector.x, vector.y, vector.z))):
            raise ValueError(f"{name} must be finite, got ({vector.x}, {vector.y}, {vector.z}) {unit}")
    if force.z > 0.0:
        raise ValueError(f"force z must be <= 0: a cue does not lift the ball; got {force.z:.9g} N")
    level = math.hypot(force.x, force.y)
    if level == 0.0:
        raise ValueError("force must not be zero along the table")
    size = math.hypot(level, force.z)
    cosine, sine = level / size, -force.z / size
    ahead_x, ahead_y = force.x / level, force.y / level
    ahead = torque.x * ahead_x + torque.y * ahead_y
    along = (cosine * ahead - sine * torque.z) / size
    side = -(sine * ahead + cosine * torque.z) / size
    up = (torque.y * ahead_x - torque.x * ahead_y) / size
    if not math.isfinite(along + side + up):
        raise ValueError(f"torque over force must be finite, got a force of {size:.9g} N")
    if abs(along) > TORQUE_TOLERANCE:
        raise ValueError(
            f"no point on the ball gives a torque along the force: it is {along * size:.6g} N m, "
            f"allowed up to {TORQUE_TOLERANCE * size:.6g} N m"
        )
    offset = (round(side, OFFSET_DECIMALS) + 0.0, round(up, OFFSET_DECIMALS) + 0.0)  # + 0.0 turns -0.0 into 0.0
    return Shot((force.x, force.y, force.z), offset, CUE_BALL)


def wrench_from_shot(force: Sequence[float], offset: Sequence[float]) -> WrenchStamped:
    """The wrench of a shot, without a frame: for any table.

    Args:
        force: (x, y, z) N.
        offset: (side, up) m from the ball's centre, seen along the force and across it.
    """
    message = WrenchStamped()
    wrench = message.wrench
    wrench.force.x, wrench.force.y, wrench.force.z = map(float, force)
    wrench.torque.x, wrench.torque.y, wrench.torque.z = torque(*(tuple(map(float, part)) for part in (force, offset)))
    return message
