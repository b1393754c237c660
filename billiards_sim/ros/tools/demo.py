# SPDX-License-Identifier: Apache-2.0
"""The executable `demo`: a table in one process, a break shot from another, and what the table publishes."""

from __future__ import annotations

import json
import math
import os
import statistics
import time
from collections.abc import Callable, Sequence

from geometry_msgs.msg import PoseArray
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Bool, String

from billiards_sim.command_line import Failure, Parser, Stopped, positive_seconds, run_to_end, say
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.scenes import BUILT_IN
from billiards_sim.ros.process import Child, isolate, noted_signals, own_arguments, ros
from billiards_sim.ros.qos import LATCHED
from billiards_sim.ros.tools.commentary import Commentary

SCENE = "eight_ball"
TABLE = BUILT_IN[SCENE]()
assert TABLE.shot is not None
BREAK = [repr(part) for part in TABLE.shot.force[:2]]
"""N. The break of the scene."""


class DemoError(Failure):
    """The demo cannot go on."""


class Spectator(Node):
    """Prints collisions as they arrive and keeps what the summary needs."""

    def __init__(self) -> None:
        super().__init__("spectator")
        self.balls = 0
        self.commentary = Commentary()
        self.largest_overlap = 0.0
        self.first_poses: PoseArray | None = None
        self.last_poses: PoseArray | None = None
        self.at_rest: bool | None = None
        self.create_subscription(String, "collisions", self._on_collisions, 100)
        self.create_subscription(PoseArray, "balls/poses", self._on_poses, 100)
        self.create_subscription(Bool, "at_rest", self._on_at_rest, LATCHED)

    @property
    def ready(self) -> bool:
        """Whether the table publishes and its balls rest."""
        return self.balls > 0 and self.at_rest is True

    @property
    def finished(self) -> bool:
        """Whether the shot is over and the last event has arrived."""
        return self.commentary.finished and self.at_rest is True

    def _on_collisions(self, message: String) -> None:
        for event in json.loads(message.data)["events"]:
            for line in self.commentary.take(event):
                say(line)

    def _on_poses(self, message: PoseArray) -> None:
        self.balls = len(message.poses)
        self.first_poses, self.last_poses = self.first_poses or message, message
        self.largest_overlap = max(self.largest_overlap, overlap(message))

    def _on_at_rest(self, message: Bool) -> None:
        self.at_rest = message.data


def overlap(poses: PoseArray) -> float:
    """Depth by which the worst pair of balls in play overlaps, m; 0 where none does. A ball's z is its radius."""
    centres = [(pose.position.x, pose.position.y, pose.position.z) for pose in poses.poses]
    worst = 0.0
    for index, (x, y, radius) in enumerate(centres):
        for other_x, other_y, other_radius in centres[:index]:
            worst = max(worst, radius + other_radius - math.hypot(x - other_x, y - other_y))
    return worst


def spread(before: PoseArray, after: PoseArray) -> float:
    """How far the balls have come, but for the first one, the cue ball; the median, m."""
    pairs = zip(before.poses[1:], after.poses[1:])
    return statistics.median(
        math.hypot(one.position.x - other.position.x, one.position.y - other.position.y) for one, other in pairs
    )


def deepest_press(physics: Physics, speed: float) -> float:
    """How deep two balls can press each other, with all the energy of one at a speed, m/s; m.

    Hertz: m v^2/2 is then the energy of their contact, 2/5 K d^(5/2). 0 for rigid balls.
    """
    if physics.youngs_modulus == 0.0:
        return 0.0
    modulus = physics.youngs_modulus / (2.0 * (1.0 - physics.poisson_ratio**2))
    stiffness = 4.0 / 3.0 * modulus * math.sqrt(0.5 * physics.radius)
    return float((1.25 * physics.mass * speed**2 / stiffness) ** 0.4)


def main(arguments: list[str]) -> int:
    """Run the demo; returns the exit code."""
    parser = Parser(
        prog="demo",
        description="Start a table with an eight-ball rack on a 9 ft pool table, break it from a second process over "
        "ROS 2, print the collisions as the table publishes them and a summary: what was pocketed and where, and how "
        "far the rack spread, in a ROS domain of their own. Takes about 15 s. "
        "Exit code 0: the break came to rest; 1: something failed; 2: bad arguments.",
    )
    parser.add_argument("--timeout", type=positive_seconds, default=120.0, metavar="S", help="longest run, s (120)")

    def play() -> int:
        isolate(os.environ)
        options = parser.parse_args(own_arguments("demo", arguments))
        with noted_signals() as signals, ros("demo", arguments):
            _play(options.timeout, signals)
        return 0

    return run_to_end("demo", play)


def _play(timeout: float, signals: Sequence[int]) -> None:
    deadline = time.monotonic() + timeout
    spectator = Spectator()
    executor = SingleThreadedExecutor()
    executor.add_node(spectator)
    say(f"demo: starting a 9 ft table with an eight-ball rack, ROS_DOMAIN_ID {os.environ['ROS_DOMAIN_ID']}")
    with Child("table", "--ros-args", "-p", f"scene:={SCENE}") as table:

        def watch(done: Callable[[], bool], missing: str, shooter: Child | None = None) -> None:
            while not done():
                if signals:
                    raise Stopped
                if table.exit_code is not None:
                    raise DemoError(f"the table ended with exit code {table.exit_code}")
                if shooter is not None and shooter.exit_code not in (None, 0):
                    raise DemoError(f"the shot ended with exit code {shooter.exit_code}")
                left = deadline - time.monotonic()
                if left <= 0.0:
                    raise DemoError(f"{missing} within {timeout:g} s")
                executor.spin_once(timeout_sec=min(left, 0.1))

        watch(lambda: spectator.ready, "the table did not publish")
        say(f"demo: {spectator.balls} balls rest; breaking from a second process")
        with Child("shoot", "--force", *BREAK) as shoot:
            watch(lambda: spectator.finished, "the break did not come to rest", shoot)
            watch(lambda: shoot.exit_code == 0, "the shot got no verdict", shoot)
    _print_summary(spectator)


def _print_summary(spectator: Spectator) -> None:
    commentary = spectator.commentary
    counts = commentary.counts
    say("demo: summary")
    say(f"  balls            {spectator.balls}")
    say(f"  collisions       {counts['ball_ball']} ball-ball, {counts['ball_rail']} ball-rail")
    pocketed = ", ".join(f"{name} in {pocket}" for name, pocket in commentary.pocketed.items())
    say(f"  pocketed         {pocketed or 'none'}")
    if spectator.first_poses is not None and spectator.last_poses is not None:
        say(f"  spread           {spread(spectator.first_poses, spectator.last_poses):.2f} m, median of the rack")
    say(f"  time to rest     {commentary.last_time - commentary.first_time:.3f} s")
    bound = deepest_press(TABLE.physics, commentary.fastest)
    say(f"  largest overlap  {spectator.largest_overlap:.3g} m; balls that meet give, by up to {bound:.2g} m here")
