# SPDX-License-Identifier: Apache-2.0
"""A frame for each ball on /tf. Optional: the node needs tf2_msgs only where a parameter asks for the frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from geometry_msgs.msg import TransformStamped

from billiards_sim.ros.messages import set_stamp


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
    """Frames at the balls' centres, in the frame of the table.

    Args:
        message_type: see `tf_message_type`.
        bodies: names of the frames, one a ball.
        radius: m.
        frame: of the table.
    """

    def __init__(self, message_type: Any, bodies: Sequence[str], radius: float, frame: str) -> None:
        self._message = message_type()
        self._message.transforms = [TransformStamped() for _ in bodies]
        for one, body in zip(self._message.transforms, bodies):
            one.header.frame_id = frame
            one.child_frame_id = body
            one.transform.translation.z = float(radius)

    def at(
        self, positions: Sequence[Sequence[float]], stamp: int, orientations: Sequence[Sequence[float]] | None = None
    ) -> Any:
        """The message, the same one each time.

        Args:
            positions: (N, 2) m, Python floats.
            stamp: ns.
            orientations: (N, 4) unit quaternions x y z w; None leaves the frames upright.
        """
        frames = self._message.transforms
        for frame, (x, y) in zip(frames, positions):
            set_stamp(frame.header.stamp, stamp)
            frame.transform.translation.x = x
            frame.transform.translation.y = y
        for frame, (x, y, z, w) in zip(frames, orientations or ()):
            turn = frame.transform.rotation
            turn.x, turn.y, turn.z, turn.w = x, y, z, w
        return self._message
