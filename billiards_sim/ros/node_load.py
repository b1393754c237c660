"""Mean rate and processor load of the node: `python3 -m billiards_sim.ros.node_load`.

A table of 16 balls at 100 Hz in one process; poses, twists and markers subscribed in another, this one. Measured with
the balls at rest, when twists are quiet, and moving, when every tick carries 16 of them. A low rolling friction keeps
the balls moving for the whole measurement.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, VelocityStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool
from visualization_msgs.msg import MarkerArray

from billiards_sim.command_line import Parser, positive_seconds
from billiards_sim.ros.process import Child, isolate, ros, wake_on_signals

START_TIMEOUT = 60.0
"""s for the table to compile, start and be discovered."""


class Listener(Node):
    """Counts what arrives; messages stay serialised, so that this process takes little of the machine."""

    def __init__(self) -> None:
        super().__init__("node_load")
        self.arrivals: list[float] = []
        self.twists = 0
        self.markers = 0
        self.at_rest: bool | None = None
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(PoseArray, "balls/poses", self._on_poses, 100, raw=True)
        self.create_subscription(VelocityStamped, "balls/twists", self._on_twist, 1000, raw=True)
        self.create_subscription(MarkerArray, "markers", self._on_markers, 100, raw=True)
        self.create_subscription(Bool, "at_rest", self._on_at_rest, latched)

    def _on_poses(self, _: bytes) -> None:
        self.arrivals.append(time.monotonic())

    def _on_twist(self, _: bytes) -> None:
        self.twists += 1

    def _on_markers(self, _: bytes) -> None:
        self.markers += 1

    def _on_at_rest(self, message: Bool) -> None:
        self.at_rest = message.data


def processor_time(pid: int) -> float:
    """User and system time of a process so far, s (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(listener: Listener, spin: Callable[[], None], pid: int, duration: float) -> dict[str, Any]:
    """Rates (Hz), load (share of one core) and tick spacing (s) over a duration, s."""
    listener.arrivals.clear()
    listener.twists = listener.markers = 0
    began, load = time.monotonic(), processor_time(pid)
    while time.monotonic() - began < duration:
        spin()
    elapsed, load = time.monotonic() - began, processor_time(pid) - load
    spacing = np.diff(listener.arrivals)
    return {
        "mean_rate": len(spacing) / (listener.arrivals[-1] - listener.arrivals[0]),
        "spacing_p1": float(np.percentile(spacing, 1)),
        "spacing_p99": float(np.percentile(spacing, 99)),
        "twist_rate": listener.twists / elapsed,
        "marker_rate": listener.markers / elapsed,
        "load": load / elapsed,
    }


def main(arguments: list[str]) -> int:
    """Measure and print one line of JSON for each of the two states."""
    parser = Parser(prog="node_load", description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--duration", type=positive_seconds, default=20.0, metavar="S", help="of each part, s (20)")
    parser.add_argument("--rate", type=positive_seconds, default=100.0, metavar="HZ", help="update_rate (100)")
    options = parser.parse_args(arguments)
    isolate(os.environ)
    given = ("scene:=eight_ball", f"update_rate:={options.rate}", "physics.rolling_friction:=0.0005")
    table_arguments = [part for parameter in given for part in ("-p", parameter)]
    with ros("node_load", []), Child("table", "--ros-args", *table_arguments) as table:
        wake_on_signals()
        listener = Listener()
        executor = SingleThreadedExecutor()
        executor.add_node(listener)

        def spin() -> None:
            executor.spin_once(timeout_sec=0.1)

        def wait(done: Callable[[], bool]) -> None:
            deadline = time.monotonic() + START_TIMEOUT
            while not done():
                if time.monotonic() > deadline:
                    raise TimeoutError("the table did not answer")
                spin()

        wait(lambda: listener.at_rest is True and bool(listener.arrivals) and listener.twists >= 16)
        print(json.dumps({"balls": "at rest", **measure(listener, spin, table.pid, options.duration)}), flush=True)
        with Child("shoot", "--force", "128", "0") as shoot:
            wait(lambda: shoot.exit_code is not None and listener.at_rest is False)
        print(json.dumps({"balls": "moving", **measure(listener, spin, table.pid, options.duration)}), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
