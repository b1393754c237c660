"""The executable `shoot`: one cue shot, and the table's verdict."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, String

from billiards_sim.command_line import USAGE_ERROR, Parser, positive_seconds
from billiards_sim.ros.process import STOPPED, StartError, own_arguments, ros, wake_on_signals
from billiards_sim.ros.wrench import wrench_from_shot

REFUSED = 1
"""Exit code of a shot that the table refused or did not answer."""

DESCRIPTION = """Publish one cue shot on cue_shot, wait for the table's verdict on shot_result and print it.
Exit code 0: accepted; 1: refused, or no answer; 2: bad arguments.
The verdict taken is the first after the shot: with several players at one table it may be another's."""


class NoAnswer(Exception):
    """The table did not do in time what was waited for."""


class Shooter(Node):
    """One shot at one table."""

    def __init__(self) -> None:
        super().__init__("shoot")
        self._verdict: dict[str, Any] | None = None
        self._table_heard = False
        # In this order: a table announces its latched at_rest only to a subscriber it knows, and learns of the
        # subscriptions of a process in the order of their making. So once at_rest is here, the verdict will be.
        self.create_subscription(String, "shot_result", self._on_shot_result, 10)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(Bool, "at_rest", self._on_at_rest, latched)
        self._publisher = self.create_publisher(WrenchStamped, "cue_shot", 10)

    def shoot(self, message: WrenchStamped, timeout: float) -> dict[str, Any]:
        """Publish the shot and wait for the verdict: {"accepted", "reason", "time"}.

        Raises:
            NoAnswer: no table, or no verdict, within `timeout` s.
        """
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        deadline = time.monotonic() + timeout
        topic = self._publisher.topic_name

        def table_listens() -> bool:
            return self._table_heard and self._publisher.get_subscription_count() > 0

        _spin_until(executor, table_listens, deadline, f"no table listens on {topic}")
        self._verdict = None  # of somebody's earlier shot
        message.header.stamp = self.get_clock().now().to_msg()
        self._publisher.publish(message)
        _spin_until(executor, lambda: self._verdict is not None, deadline, f"the table on {topic} did not answer")
        assert self._verdict is not None
        return self._verdict

    def _on_shot_result(self, message: String) -> None:
        if self._verdict is None:
            self._verdict = json.loads(message.data)

    def _on_at_rest(self, _: Bool) -> None:
        self._table_heard = True


def main(arguments: list[str]) -> int:
    """Shoot once; returns the exit code."""
    parser = Parser(prog="shoot", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--force",
        nargs=2,
        type=float,
        required=True,
        metavar=("FX", "FY"),
        help="force of the cue, N, in the frame of the table; 80 0 gives 5 m/s along x with the default physics",
    )
    parser.add_argument(
        "--offset",
        nargs=2,
        type=float,
        default=(0.0, 0.0),
        metavar=("SIDE", "UP"),
        help="where the tip hits, m from the centre of the ball seen along the force: to the left and up (0 0)",
    )
    parser.add_argument("--timeout", type=positive_seconds, default=10.0, metavar="S", help="longest wait, s (10)")
    try:
        options = parser.parse_args(own_arguments("shoot", arguments))
        with ros("shoot", arguments):
            return _shoot(options)
    except StartError as error:
        print(f"shoot: {error}", file=sys.stderr)
        return USAGE_ERROR
    except NoAnswer as error:
        print(f"shoot: {error} within {options.timeout:g} s", file=sys.stderr)
        return REFUSED
    except STOPPED:
        return REFUSED


def _shoot(options: argparse.Namespace) -> int:
    wake_on_signals()
    shooter = Shooter()
    (fx, fy), (side, up) = options.force, options.offset
    print(f"shoot: force ({fx:g}, {fy:g}, 0) N, {side:g} m to the side, {up:g} m up", flush=True)
    verdict = shooter.shoot(wrench_from_shot((fx, fy, 0.0), (side, up)), options.timeout)
    if not verdict["accepted"]:
        print(f"shoot: refused: {verdict['reason']}", flush=True)
        return REFUSED
    print(f"shoot: accepted at {verdict['time']:.3f} s of the table's time", flush=True)
    return 0


def _spin_until(executor: SingleThreadedExecutor, done: Callable[[], bool], deadline: float, missing: str) -> None:
    while not done():
        left = deadline - time.monotonic()
        if left <= 0.0:
            raise NoAnswer(missing)
        executor.spin_once(timeout_sec=min(left, 0.1))  # a matched subscription does not wake the executor
