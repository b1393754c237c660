# SPDX-License-Identifier: Apache-2.0
"""Evenness of the ticks and processor load of the node: `python3 -m billiards_sim.ros.tools.node_load`.

A table of 16 balls in one process; the topics that are asked for subscribed in another, this one. Measured with the
balls at rest, when twists are quiet, and moving, when every tick carries 16 of them: without rolling friction a break
off centre keeps every ball moving for minutes.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, VelocityStamped
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

from billiards_sim.command_line import Parser, positive_seconds
from billiards_sim.ros.process import Child, Stopped, isolate, ros, stoppable
from billiards_sim.ros.qos import LATCHED

TOPICS = {
    "states": ("balls/states", MultiDOFJointState),
    "poses": ("balls/poses", PoseArray),
    "twists": ("balls/twists", VelocityStamped),
    "markers": ("markers", MarkerArray),
    "collisions": ("collisions", String),
}
"""What can be subscribed, by the name on the command line."""

EVERY_TICK = ("states", "poses")
"""Those of which each tick sends one message: the first that is subscribed tells the ticks."""

BALLS = 16
SHOT = ("128", "10")  # N, off centre: it sets every ball in motion

DEPTH = 1000
"""Messages kept for this process when it falls behind: a tick has 16 twists."""

START_TIMEOUT = 60.0
"""s for the table to compile, start and be discovered."""

STOPPED = 1
"""Exit code of a measurement that a signal ended."""

SETTLING = 1.0
"""s after the start, or after the shot, that are not measured: processes still find or forget each other."""


class Listener(Node):
    """Counts what arrives; messages stay serialised, so that this process takes little of the machine.

    Args:
        topics: names in `TOPICS`.
    """

    def __init__(self, topics: Iterable[str]) -> None:
        super().__init__("node_load")
        self.arrivals: list[float] = []
        self.counts: Counter[str] = Counter()
        self.at_rest: bool | None = None
        topics = tuple(topics)
        ticks = next((name for name in EVERY_TICK if name in topics), None)
        for name in topics:
            topic, kind = TOPICS[name]
            callback = self._on_tick if name == ticks else partial(self._count, name)
            self.create_subscription(kind, topic, callback, DEPTH, raw=True)
        self.create_subscription(Bool, "at_rest", self._on_at_rest, LATCHED)

    def _on_tick(self, _: bytes) -> None:
        self.arrivals.append(time.monotonic())

    def _count(self, name: str, _: bytes) -> None:
        self.counts[name] += 1

    def _on_at_rest(self, message: Bool) -> None:
        self.at_rest = message.data


def processor_time(pid: int) -> float:
    """User and system time of a process so far, s (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def evenness(arrivals: Sequence[float], rate: float) -> dict[str, float | None]:
    """Mean rate (Hz) of ticks that arrived at these times (s), and their spacing (s).

    `jitter_p99` is what 99 % of the spacings differ from 1 / rate by, at most. None where nothing arrived twice.
    """
    names = ("spacing_p1", "spacing_p99", "spacing_deviation", "spacing_longest", "jitter_p99")
    if len(arrivals) < 2:
        return dict.fromkeys(("mean_rate", *names))
    spacing = np.diff(arrivals)
    figures = (
        *np.percentile(spacing, (1, 99)),
        spacing.std(),
        spacing.max(),
        np.percentile(np.abs(spacing - 1.0 / rate), 99),
    )
    return {"mean_rate": float(1.0 / spacing.mean()), **{name: float(value) for name, value in zip(names, figures)}}


def measure(listener: Listener, spin: Callable[[], None], pid: int, rate: float, duration: float) -> dict[str, Any]:
    """Rates (Hz), tick spacing (s), and load of the table and of this process (shares of one core).

    Args:
        listener: to what is measured.
        spin: takes what has come for the listener.
        pid: of the table.
        rate: that the table was asked for, Hz.
        duration: of the measurement, s.
    """
    listener.arrivals.clear()
    listener.counts.clear()
    began, load, own_load = time.monotonic(), processor_time(pid), time.process_time()
    while time.monotonic() - began < duration:
        spin()
    elapsed, load, own_load = time.monotonic() - began, processor_time(pid) - load, time.process_time() - own_load
    return {
        **evenness(listener.arrivals, rate),
        "twist_rate": listener.counts["twists"] / elapsed,
        "marker_rate": listener.counts["markers"] / elapsed,
        "load": load / elapsed,
        "listener_load": own_load / elapsed,
    }


def topic_names(text: str) -> tuple[str, ...]:
    """An argument type: names in `TOPICS` with commas between them, `all` or `none`."""
    if text in ("all", "none"):
        return tuple(TOPICS) if text == "all" else ()
    names = tuple(text.split(","))
    for name in names:
        if name not in TOPICS:
            raise argparse.ArgumentTypeError(f"must be all, none or some of {','.join(TOPICS)}, got {name!r}")
    return names


def main(arguments: list[str]) -> int:
    """Measure and print one line of JSON for each of the two states."""
    parser = Parser(prog="node_load", description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--duration", type=positive_seconds, default=20.0, metavar="S", help="of each part, s (20)")
    parser.add_argument("--rate", type=positive_seconds, default=100.0, metavar="HZ", help="update_rate (100)")
    parser.add_argument(
        "--topics",
        type=topic_names,
        default="states,markers",
        metavar="T,T",
        help=f"to subscribe: all, none or some of {','.join(TOPICS)} (%(default)s)",
    )
    options = parser.parse_args(arguments)
    isolate(os.environ)
    given = ("scene:=eight_ball", f"update_rate:={options.rate}", "physics.rolling_friction:=0.0")
    table_arguments = [part for parameter in given for part in ("-p", parameter)]
    try:
        _measure(options, table_arguments)
    except Stopped:
        return STOPPED
    return 0


def _measure(options: argparse.Namespace, table_arguments: Sequence[str]) -> None:
    with ros("node_load", []), stoppable(), Child("table", "--ros-args", *table_arguments) as table:
        listener = Listener(options.topics)
        executor = EventsExecutor()  # the default one is late where 16 000 twists a second arrive
        executor.add_node(listener)

        def spin() -> None:
            executor.spin_once(timeout_sec=0.1)

        def wait(done: Callable[[], bool]) -> None:
            deadline = time.monotonic() + START_TIMEOUT
            while not done():
                if time.monotonic() > deadline:
                    raise TimeoutError("the table did not answer")
                spin()

        def settle() -> None:
            settled = time.monotonic() + SETTLING
            wait(lambda: time.monotonic() > settled)

        def report(balls: str) -> None:
            figures = measure(listener, spin, table.pid, options.rate, options.duration)
            print(json.dumps({"balls": balls, "topics": options.topics, **figures}), flush=True)

        def heard() -> bool:
            ticks = not any(name in options.topics for name in EVERY_TICK) or bool(listener.arrivals)
            return ticks and ("twists" not in options.topics or listener.counts["twists"] >= BALLS)

        wait(lambda: listener.at_rest is True and heard())
        settle()
        report("at rest")
        with Child("shoot", "--force", *SHOT) as shoot:
            wait(lambda: shoot.exit_code is not None and listener.at_rest is False)
        settle()
        report("moving")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
