"""From state to messages. Messages are made once and updated in place: building new ones costs most of a tick."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray, VelocityStamped, WrenchStamped

from billiards_sim.engine.events import Event
from billiards_sim.ros.wrench import FRAME

NANOSECONDS = 1_000_000_000

COLLISION_VERSION = 1
"""Of the JSON on `collisions`; it changes when a key changes its meaning or goes."""


class Stamps:
    """ROS stamps of simulated times, ns.

    Stamps follow simulated time from the node clock's reading at the start. With a real-time factor of 1 they are
    wall-clock stamps; with another they run faster or slower. They never go back: after a reset simulated time 0 takes
    the stamp at which the reset found the table.
    """

    def __init__(self, epoch: int) -> None:
        self._epoch = epoch

    def at(self, time: float) -> int:
        """Stamp of a simulated time (s), ns."""
        return self._epoch + round(time * NANOSECONDS)

    def restart(self, time: float) -> None:
        """Simulated time goes back to 0 at this simulated time (s)."""
        self._epoch = self.at(time)


def set_stamp(message: Time, stamp: int) -> None:
    """Write a stamp (ns) into a message."""
    message.sec, message.nanosec = divmod(stamp, NANOSECONDS)


def stamp_of(message: WrenchStamped) -> tuple[int, int]:
    """(sec, nanosec) of a message's header."""
    return message.header.stamp.sec, message.header.stamp.nanosec


def new_poses(count: int, radius: float) -> PoseArray:
    """Poses of `count` balls on the cloth, for `update_poses` to fill in. Orientations stay the identity."""
    message = PoseArray()
    message.header.frame_id = FRAME
    message.poses = [Pose() for _ in range(count)]
    for pose in message.poses:
        pose.position.z = float(radius)
    return message


def update_poses(
    message: PoseArray,
    positions: Sequence[Sequence[float]],
    stamp: int,
    orientations: Sequence[Sequence[float]] | None = None,
) -> None:
    """Args:
    positions: (N, 2) m, Python floats.
    stamp: ns.
    orientations: (N, 4) unit quaternions x y z w; None leaves what is there.
    """
    set_stamp(message.header.stamp, stamp)
    for pose, (x, y) in zip(message.poses, positions):
        pose.position.x = x
        pose.position.y = y
    for pose, (x, y, z, w) in zip(message.poses, orientations or ()):
        pose.orientation.x = x
        pose.orientation.y = y
        pose.orientation.z = z
        pose.orientation.w = w


def new_twist(name: str) -> VelocityStamped:
    """Velocity of one ball with respect to the table, for `update_twist` to fill in."""
    message = VelocityStamped()
    message.header.frame_id = FRAME
    message.reference_frame_id = FRAME
    message.body_frame_id = name
    return message


def update_twist(message: VelocityStamped, velocity: Sequence[float], spin: Sequence[float], stamp: int) -> None:
    """Args:
    velocity: (x, y) m/s, Python floats.
    spin: (x, y, z) rad/s, Python floats.
    stamp: ns.
    """
    set_stamp(message.header.stamp, stamp)
    linear, angular = message.velocity.linear, message.velocity.angular
    linear.x, linear.y = velocity
    angular.x, angular.y, angular.z = spin


def collision_json(event: Event, stamp: int, radius: float) -> str:
    """One engine event as JSON for `collisions`, see `collision_record`."""
    return json.dumps(collision_record(event, stamp, radius))


def collision_record(event: Event, stamp: int, radius: float) -> dict[str, Any]:
    """One engine event for JSON. Points lie at the height of the balls' centres.

    Args:
        stamp: of the event's own time, ns.
        radius: of the balls, m.
    """
    sec, nanosec = divmod(stamp, NANOSECONDS)
    return {
        "version": COLLISION_VERSION,
        "kind": event.kind,
        "time": event.time,
        "stamp": {"sec": sec, "nanosec": nanosec},
        "balls": event.balls,
        "rail": event.rail,
        "point": [*event.point, radius],
        "normal": [*event.normal, 0.0],
        "approach_speed": event.approach_speed,
        "impulse": event.impulse,
    }


def verdict_json(accepted: bool, reason: str, time: float) -> str:
    """The table's answer at a simulated time (s), as JSON for `shot_result` and `placement_result`."""
    return json.dumps({"accepted": accepted, "reason": reason, "time": time})
