# SPDX-License-Identifier: Apache-2.0
"""Evenness of the ticks and processor load of the node: `python3 -m billiards_sim.ros.tools.node_load`.

A table of 16 balls in one process; the topics that are asked for subscribed in another, this one. Measured with the
balls at rest, when twists are quiet, and moving, when every tick carries 16 of them: without rolling friction a break
off centre keeps every ball moving for minutes. Or in breaks one after the other, each from before the shot until rest;
or at rest, while previews of breaks are asked for.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, VelocityStamped, WrenchStamped
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from billiards_sim.command_line import Parser, positive_seconds, run_to_end, say
from billiards_sim.engine.scenes import BUILT_IN
from billiards_sim.ros.process import Child, isolate, ros, stoppable
from billiards_sim.ros.qos import LATCHED
from billiards_sim.ros.wrench import wrench_from_shot

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
SCENES = ("rack", "eight_ball")

SHOT_AIM = 10.0
"""N along y, with `BREAK`: it sets every ball in motion."""

BREAK = 128.0
"""N along x: 8 m/s."""

WIDEST_AIM = 3.0
"""N along y, with `BREAK`: 1.3 degrees to either side."""

DEPTH = 1000
"""Messages kept for this process when it falls behind: a tick has 16 twists."""

START_TIMEOUT = 60.0
"""s for the table to start and be discovered."""

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
        self.asked: list[float] = []  # s of the steady clock, when previews were asked for
        self.answered: list[float] = []  # and answered, in the same order
        self._topics = tuple(topics)
        self._executor = EventsExecutor()  # the default one is late where 16 000 twists a second arrive
        self._executor.add_node(self)
        ticks = next((name for name in EVERY_TICK if name in self._topics), None)
        for name in self._topics:
            topic, kind = TOPICS[name]
            callback = self._on_tick if name == ticks else partial(self._count, name)
            self.create_subscription(kind, topic, callback, DEPTH, raw=True)
        self.create_subscription(Bool, "at_rest", self._on_at_rest, LATCHED)
        self.create_subscription(String, "preview/result", self._on_preview, DEPTH, raw=True)
        self.cue = self.create_publisher(WrenchStamped, "cue_shot", 1)
        self.asker = self.create_publisher(WrenchStamped, "cue_shot/preview", DEPTH)
        self.reset = self.create_client(Trigger, "table/reset")

    def wait(self, done: Callable[[], bool]) -> None:
        """Take what comes until something is so.

        Raises:
            TimeoutError: it is not within `START_TIMEOUT`.
        """
        deadline = time.monotonic() + START_TIMEOUT
        while not done():
            if time.monotonic() > deadline:
                raise TimeoutError("the table did not answer")
            self._executor.spin_once(timeout_sec=0.1)

    def pass_time(self, seconds: float) -> None:
        """Take what comes for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=min(left, 0.1))

    def hears_all(self) -> bool:
        """Whether the table and this node have found each other on every topic that is measured or used."""
        ticks = self.arrivals or not any(name in self._topics for name in EVERY_TICK)
        twists = self.counts["twists"] >= BALLS or "twists" not in self._topics
        heard = all(publisher.get_subscription_count() > 0 for publisher in (self.cue, self.asker))
        return bool(ticks and twists and heard and self.reset.service_is_ready())

    def previews(self) -> dict[str, float]:
        """How many previews were asked for, if any, and the time until their answers, s."""
        if not self.asked:
            return {}
        self.wait(lambda: len(self.answered) == len(self.asked))
        median, p95 = np.quantile(np.subtract(self.answered, self.asked), (0.5, 0.95)).tolist()
        return {"previews": len(self.asked), "preview_median": median, "preview_p95": p95}

    def _on_tick(self, _: bytes) -> None:
        self.arrivals.append(time.monotonic())

    def _count(self, name: str, _: bytes) -> None:
        self.counts[name] += 1

    def _on_preview(self, _: bytes) -> None:
        self.answered.append(time.monotonic())

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


def measure(listener: Listener, pid: int, rate: float, play: Callable[[], None]) -> dict[str, Any]:
    """Rates (Hz), tick spacing (s), and load of the table and of this process (shares of one core).

    Args:
        listener: to what is measured.
        pid: of the table.
        rate: that the table was asked for, Hz.
        play: lets the time pass that is measured, and takes what comes for the listener.
    """
    listener.arrivals.clear()
    listener.counts.clear()
    began, load, own_load = time.monotonic(), processor_time(pid), time.process_time()
    play()
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
    """Measure and print one line of JSON for each of the two states, for each break, or for the previews."""
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
    parser.add_argument("--scene", choices=SCENES, default=SCENES[0], help="of 16 balls (%(default)s)")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument("--breaks", type=int, default=0, metavar="N", help="measure N breaks instead")
    instead.add_argument(
        "--previews", type=positive_seconds, metavar="HZ", help="measure at rest, with HZ previews of a break a second"
    )

    def play() -> int:
        options = parser.parse_args(arguments)
        isolate(os.environ)
        given = [f"scene:={options.scene}", f"update_rate:={options.rate}"]
        if not options.breaks:
            given.append("physics.rolling_friction:=0.0")
        _measure(options, [part for parameter in given for part in ("-p", parameter)])
        return 0

    return run_to_end("node_load", play)


def _measure(options: argparse.Namespace, table_arguments: Sequence[str]) -> None:
    with ros("node_load", []), stoppable(), Child("table", "--ros-args", *table_arguments) as table:
        listener = Listener(options.topics)
        listener.wait(lambda: listener.at_rest is True and listener.hears_all())
        listener.pass_time(SETTLING)

        def report(balls: str, play: Callable[[], None]) -> None:
            figures = measure(listener, table.pid, options.rate, play)
            say(json.dumps({"balls": balls, "topics": options.topics, **figures, **listener.previews()}))

        if options.previews:
            force = _force(options.scene, 0.0)
            report("at rest", partial(_ask, listener, force, options.previews, options.duration))
            return
        if options.breaks:
            aims = np.random.default_rng(1).uniform(-WIDEST_AIM, WIDEST_AIM, options.breaks)
            for aim in aims.tolist():
                report("break", partial(_break, listener, *_force(options.scene, aim)))
                listener.wait(listener.reset.call_async(Trigger.Request()).done)
                listener.wait(lambda: listener.at_rest is True)
            return
        report("at rest", partial(listener.pass_time, options.duration))
        with Child("shoot", "--force", *map(repr, _force(options.scene, SHOT_AIM))) as shoot:
            listener.wait(lambda: shoot.exit_code is not None and listener.at_rest is False)
        listener.pass_time(SETTLING)
        report("moving", partial(listener.pass_time, options.duration))


def _force(scene: str, aim: float) -> tuple[float, float]:
    # N, of a break of the scene: 8 m/s, or as fast as its own.
    shot = BUILT_IN[scene]().shot
    force = BREAK if shot is None else math.hypot(*shot.force)
    return force, aim / BREAK * force


def _break(listener: Listener, along: float, across: float) -> None:
    listener.pass_time(SETTLING)
    listener.cue.publish(wrench_from_shot((along, across, 0.0), (0.0, 0.0)))
    listener.wait(lambda: listener.at_rest is False)
    listener.wait(lambda: listener.at_rest is True)
    listener.pass_time(SETTLING)


def _ask(listener: Listener, force: Sequence[float], rate: float, duration: float) -> None:
    # At times that keep no step with the ticks.
    message, end = wrench_from_shot((*force, 0.0), (0.0, 0.0)), time.monotonic() + duration
    pauses = np.random.default_rng(1).uniform(0.5 / rate, 1.5 / rate, math.ceil(2.0 * rate * duration))
    for pause in pauses.tolist():
        if time.monotonic() >= end:
            return
        listener.asked.append(time.monotonic())
        listener.asker.publish(message)
        listener.pass_time(pause)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
