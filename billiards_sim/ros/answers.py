# SPDX-License-Identifier: Apache-2.0
"""What the table says to those who ask for something."""

from __future__ import annotations

import json
import math

import numpy as np
from numpy.typing import NDArray
from rclpy.publisher import Publisher
from std_msgs.msg import String

from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros import messages


def answer(publisher: Publisher, request: messages.Request, time: float, reason: str = "") -> None:
    """Accept a request at a simulated time, s, or refuse it where there is a reason."""
    publisher.publish(String(data=json.dumps(messages.answer_record(reason, time, messages.stamp_of(request)))))


def check_at_rest(simulation: Simulation, before: str) -> None:
    """Raises:
    ValueError: a ball moves, or spins ever less, before something that has to wait for rest.
    """
    if simulation.at_rest:
        return
    name, speed = _fastest(simulation, simulation.velocities)
    how = f"moves at {speed:.6g} m/s"
    if speed == 0.0:
        name, spin = _fastest(simulation, simulation.angular_velocities)
        how = f"spins at {spin:.6g} rad/s"
    raise ValueError(f"every ball must rest before {before}: ball {name!r} {how}")


def _fastest(simulation: Simulation, rates: NDArray[np.float64]) -> tuple[str, float]:
    sizes = [math.hypot(*rate) for rate in rates.tolist()]
    fastest = max(range(len(sizes)), key=sizes.__getitem__)
    return simulation.start_scene.names[fastest], sizes[fastest]
