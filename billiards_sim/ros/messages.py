# SPDX-License-Identifier: Apache-2.0
"""From state to messages. Those of every tick are kept as bytes: converting messages would cost most of a tick."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Pose, PoseArray, Transform, Twist, VelocityStamped, WrenchStamped
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from sensor_msgs.msg import MultiDOFJointState

from billiards_sim.engine.events import Event

NANOSECONDS = 1_000_000_000

LAST_STAMP = 2**31 * NANOSECONDS - 1
"""ns. The seconds of a message are 32 bits with a sign."""

VERSION = 2
"""Of the JSON on every topic; it changes when a key changes its meaning or goes."""

_STAMP = struct.Struct("=iI")
"""Seconds and nanoseconds of a serialized message, in the machine's own order of bytes as all of it is."""

_STAMP_PLACE = 4
"""Of the stamp in a serialized message, bytes."""

DOUBLE = 8
"""Bytes of a number in a serialized message, and what it is aligned to."""

LENGTH = 4
"""Bytes of the length of a sequence in a serialized message."""


Request: TypeAlias = "WrenchStamped | PoseArray | MultiDOFJointState"
"""What people ask with."""


class Stamps:
    """ROS stamps of simulated times, ns: one time has a stamp, and from there simulated time counts.

    Args:
        stamp: ns.
        time: simulated, s.
    """

    def __init__(self, stamp: int, time: float = 0.0) -> None:
        self._stamp = stamp
        self._time = time

    def at(self, time: float) -> int:
        """Stamp of a simulated time (s), ns; `LAST_STAMP` at most."""
        return min(self._stamp + round((time - self._time) * NANOSECONDS), LAST_STAMP)

    def restarted(self, time: float) -> Stamps:
        """Those that go on where simulated time goes back to 0 at this simulated time (s)."""
        return Stamps(self.at(time))


def set_stamp(message: Time, stamp: int) -> None:
    """Write a stamp (ns) into a message."""
    message.sec, message.nanosec = divmod(stamp, NANOSECONDS)


def stamp_of(message: Request) -> tuple[int, int]:
    """(sec, nanosec) of a message's header."""
    return message.header.stamp.sec, message.header.stamp.nanosec


class Serialized:
    """A message with a header first, as the bytes that go out.

    Converting a PoseArray of 16 poses costs 0.1 ms at every publishing; bytes are sent as they are. Common data
    representation (CDR), in which ROS 2 sends, puts fields one after the other: here 4 bytes of its own, the stamp,
    names that stay, and numbers to be written over.
    """

    def __init__(self, message: PoseArray | VelocityStamped | MultiDOFJointState) -> None:
        self._bytes = bytearray(serialize_message(message))

    def numbers(self, shape: tuple[int, ...], behind: int = 0) -> NDArray[np.float64]:
        """Doubles of the message, to be written over; `behind` bytes of it come after them."""
        begin = len(self._bytes) - behind - DOUBLE * math.prod(shape)
        return np.ndarray(shape, np.float64, self._bytes, begin)

    def stamped(self, stamp: int) -> bytes:
        """The message with this stamp, ns."""
        _STAMP.pack_into(self._bytes, _STAMP_PLACE, *divmod(stamp, NANOSECONDS))
        return bytes(self._bytes)


class Poses:
    """`balls/poses`: the balls lie on the cloth, upright unless orientations are given.

    Those that are not in play lie one radius under the cloth: in their pocket, or under the origin of the frame.

    Args:
        count: of balls.
        radius: m.
        frame: of the table.
    """

    def __init__(self, count: int, radius: float, frame: str) -> None:
        message = PoseArray()
        message.header.frame_id = frame
        message.poses = [Pose() for _ in range(count)]
        self._radius = radius
        self._serialized = Serialized(message)
        self._poses = self._serialized.numbers((count, 7))

    def show(
        self,
        positions: NDArray[np.float64],
        in_play: NDArray[np.bool_],
        orientations: NDArray[np.float64] | None = None,
    ) -> None:
        """Say where the balls are.

        Args:
            positions: (N, 2) m, of pocketed balls in their pockets, nan of those that are nowhere.
            in_play: (N,).
            orientations: (N, 4) unit quaternions x y z w.
        """
        self._poses[:, :2] = np.where(np.isnan(positions), 0.0, positions)
        self._poses[:, 2] = np.where(in_play, self._radius, -self._radius)
        if orientations is not None:
            self._poses[:, 3:] = orientations

    def stamped(self, stamp: int) -> bytes:
        """The serialized message with this stamp, ns."""
        return self._serialized.stamped(stamp)


class States:
    """`balls/states`: where the balls are and how they move, all of them with their names in one message.

    Args:
        names: of the balls.
        radius: m.
        frame: of the table.
    """

    def __init__(self, names: Sequence[str], radius: float, frame: str) -> None:
        message = MultiDOFJointState(joint_names=list(names))
        message.header.frame_id = frame
        message.transforms = [Transform() for _ in names]
        message.twist = [Twist() for _ in names]
        for transform in message.transforms:
            transform.translation.z = float(radius)
        self._serialized = Serialized(message)
        # At the end: the transforms, how many twists there are, these, and that there are no wrenches.
        self._twists = self._serialized.numbers((len(names), 6), LENGTH)
        self._transforms = self._serialized.numbers((len(names), 7), LENGTH + self._twists.nbytes + DOUBLE)

    def show(
        self,
        positions: NDArray[np.float64],
        velocities: NDArray[np.float64],
        spins: NDArray[np.float64],
        orientations: NDArray[np.float64] | None = None,
    ) -> None:
        """Say where the balls are and how they move.

        Args:
            positions: (N, 2) m.
            velocities: (N, 2) m/s.
            spins: (N, 3) rad/s.
            orientations: (N, 4) unit quaternions x y z w.
        """
        self._transforms[:, :2] = positions
        if orientations is not None:
            self._transforms[:, 3:] = orientations
        self._twists[:, :2] = velocities
        self._twists[:, 3:] = spins

    def stamped(self, stamp: int) -> bytes:
        """The serialized message with this stamp, ns."""
        return self._serialized.stamped(stamp)


class BallTwist:
    """`balls/twists`: velocity of one ball with respect to the table.

    Args:
        body: frame of the ball.
        frame: of the table.
    """

    def __init__(self, body: str, frame: str) -> None:
        message = VelocityStamped()
        message.header.frame_id = frame
        message.reference_frame_id = frame
        message.body_frame_id = body
        self._serialized = Serialized(message)
        self._twist = self._serialized.numbers((6,))

    def at(self, velocity: NDArray[np.float64], spin: NDArray[np.float64], stamp: int) -> bytes:
        """The serialized message.

        Args:
            velocity: (x, y) m/s.
            spin: (x, y, z) rad/s.
            stamp: ns.
        """
        self._twist[:2] = velocity
        self._twist[3:] = spin
        return self._serialized.stamped(stamp)


def collision_record(event: Event, stamp: int, radius: float) -> dict[str, Any]:
    """One engine event for JSON. Points lie at the height of the balls' centres.

    Args:
        stamp: of the event's own time, ns.
        radius: of the balls, m.
    """
    sec, nanosec = divmod(stamp, NANOSECONDS)
    return {
        "kind": event.kind,
        "time": event.time,
        "stamp": {"sec": sec, "nanosec": nanosec},
        "balls": event.balls,
        "rail": event.rail,
        "pocket": event.pocket,
        "point": [*event.point, radius],
        "normal": [*event.normal, 0.0],
        "approach_speed": event.approach_speed,
        "impulse": event.impulse,
    }


def answer_record(reason: str, time: float, request: tuple[int, int]) -> dict[str, Any]:
    """The table's answer to a request, for JSON.

    Args:
        reason: of a refusal; empty where the request is accepted.
        time: simulated, s.
        request: (sec, nanosec), the stamp of the message that asked.
    """
    sec, nanosec = request
    return {
        "version": VERSION,
        "accepted": not reason,
        "reason": reason,
        "time": time,
        "request": {"sec": sec, "nanosec": nanosec},
    }
