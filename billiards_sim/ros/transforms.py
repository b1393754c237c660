# SPDX-License-Identifier: Apache-2.0
"""A frame for each ball on /tf. Optional: the node needs tf2_msgs only where a parameter asks for the frames."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rclpy.serialization import serialize_message
from std_msgs.msg import Bool

from billiards_sim.quaternion import IDENTITY
from billiards_sim.ros.messages import DOUBLE, NANOSECONDS

TF_TYPE = "tf2_msgs/msg/TFMessage"
"""What goes out on /tf."""

_STAMP = struct.Struct("=iI")
_COUNT = struct.Struct("=I")
_WORD = 4
"""Bytes that a stamp and the length of a sequence or a text are aligned to."""


def tf_message_type() -> Any:
    """The class `tf2_msgs.msg.TFMessage`.

    Raises:
        ValueError: the package is not installed.
    """
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError as error:
        raise ValueError(
            f"parameter 'publish_tf' needs the ROS package tf2_msgs (Ubuntu: ros-$ROS_DISTRO-tf2-msgs): {error}"
        ) from None
    return TFMessage


class BallFrames:
    """Frames at the balls' centres, in the frame of the table: a message of `TF_TYPE` as bytes, for which tf2_msgs need
    not be there.

    Its one field is a sequence of `geometry_msgs/TransformStamped`: stamp, two names, seven numbers.

    Args:
        bodies: names of the frames, one a ball.
        radius: m.
        frame: of the table.
    """

    def __init__(self, bodies: Sequence[str], radius: float, frame: str) -> None:
        content = bytearray(_COUNT.pack(len(bodies)))
        self._stamps, places = [], []
        for body in bodies:
            _align(content, _WORD)
            self._stamps.append(len(content))
            content += bytes(_STAMP.size)
            for name in (frame, body):
                _align(content, _WORD)
                text = name.encode() + b"\0"
                content += _COUNT.pack(len(text)) + text
            _align(content, DOUBLE)
            places.append(len(content))
            content += np.array([0.0, 0.0, radius, *IDENTITY]).tobytes()
        head = serialize_message(Bool())[:_WORD]  # tells the order of bytes; places are counted from behind it
        self._bytes = bytearray(head) + content
        self._numbers = [np.ndarray(7, np.float64, self._bytes, _WORD + place) for place in places]

    def at(
        self,
        positions: NDArray[np.float64],
        stamp: int,
        orientations: NDArray[np.float64] | None = None,
    ) -> bytes:
        """The serialized message.

        Args:
            positions: (N, 2) m.
            stamp: ns.
            orientations: (N, 4) unit quaternions x y z w; None leaves the frames as they are turned.
        """
        sec, nanosec = divmod(stamp, NANOSECONDS)
        for place in self._stamps:
            _STAMP.pack_into(self._bytes, _WORD + place, sec, nanosec)
        for index, numbers in enumerate(self._numbers):
            numbers[:2] = positions[index]
            if orientations is not None:
                numbers[3:] = orientations[index]
        return bytes(self._bytes)


def _align(content: bytearray, size: int) -> None:
    content += bytes(-len(content) % size)
