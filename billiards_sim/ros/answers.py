# SPDX-License-Identifier: Apache-2.0
"""What the table says to those who ask for something."""

from __future__ import annotations

import json

from rclpy.publisher import Publisher
from std_msgs.msg import String

from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros import messages


def answer(publisher: Publisher, request: messages.Request, time: float, reason: str = "") -> None:
    """Accept a request at a simulated time, s, or refuse it where there is a reason."""
    publisher.publish(String(data=json.dumps(messages.answer_record(reason, time, messages.stamp_of(request)))))


def check_at_rest(simulation: Simulation, before: str) -> None:
    """Raises:
    ValueError: a ball moves, before something that has to wait for rest.
    """
    if simulation.at_rest:
        return
    speeds = [(vx * vx + vy * vy) ** 0.5 for vx, vy in simulation.velocities.tolist()]
    fastest = max(range(len(speeds)), key=speeds.__getitem__)
    raise ValueError(
        f"every ball must rest before {before}: ball {simulation.start_scene.names[fastest]!r} moves at "
        f"{speeds[fastest]:.6g} m/s"
    )
