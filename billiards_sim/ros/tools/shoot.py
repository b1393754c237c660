# SPDX-License-Identifier: Apache-2.0
"""The executable `shoot`: one cue shot, or what it would do, and the table's verdict."""

from __future__ import annotations

import argparse
import json
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String

from billiards_sim.command_line import FAILED, Failure, Parser, positive_seconds, run_to_end, say
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.physics import Physics
from billiards_sim.engine.scene import Shot
from billiards_sim.ros.process import own_arguments, ros, stoppable
from billiards_sim.ros.qos import SHOT_DEPTH
from billiards_sim.ros.tools.commentary import Commentary
from billiards_sim.ros.wrench import CUE_BALL, wrench_from_shot
from billiards_sim.shot_options import add_shot_options, shot_asked_for

LONGEST_REST = 60.0
"""s that --wait waits by default; with the paper's constants no shot that a person plays goes on for half as long."""

LAST_EVENTS = 1.0
"""s that events have to arrive once the table rests: after a reset the missing ones never come."""

DESCRIPTION = """Publish one cue shot on cue_shot, wait for the table's verdict on shot_result and print it.
Say it as --speed and --angle, or as --force.
Exit code 0: accepted; 1: refused, no answer, or stopped; 2: bad arguments."""


class NoAnswer(Failure):
    """The table did not do in time what was waited for."""


class Shooter(Node):
    """One shot at one table.

    Args:
        timeout: longest wait for the table, its parameters and its answer together, s.
        name: of the node, and of who speaks.
    """

    def __init__(self, timeout: float, name: str = "shoot") -> None:
        super().__init__(name)
        self._timeout = timeout
        self._deadline = time.monotonic() + timeout
        self._answer: dict[str, Any] | None = None
        self._request: dict[str, int] | None = None
        self._at_rest: bool | None = None
        self._has_moved = False
        self._events: deque[dict[str, Any]] = deque()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self)
        # In this order: a table announces its latched at_rest only to a subscriber it knows, and learns of the
        # subscriptions of a process in the order of their making. So once at_rest is here, the answers will be.
        self.create_subscription(String, "shot_result", self._on_answer, 100)
        self.create_subscription(String, "preview/result", self._on_answer, 100)
        self.create_subscription(String, "collisions", self._on_collisions, 100)
        latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(Bool, "at_rest", self._on_at_rest, latched)
        self._shots = self.create_publisher(WrenchStamped, "cue_shot", SHOT_DEPTH)
        self._previews = self.create_publisher(WrenchStamped, "cue_shot/preview", SHOT_DEPTH)

    def parameters(self, *names: str) -> list[Any]:
        """Values of the table's parameters.

        Raises:
            NoAnswer: no table or several, or no answer in time.
        """
        topic = self._shots.topic_name
        self._spin_until(self._tables, f"no table listens on {topic}")
        tables = sorted(self._tables())
        if len(tables) > 1:
            raise NoAnswer(f"{len(tables)} tables listen on {topic}, {', '.join(tables)}: give each a namespace")
        client = AsyncParameterClient(self, tables[0])
        missing = f"the table on {topic}, node {tables[0]}, did not tell its parameters"
        self._spin_until(client.services_are_ready, missing)
        future = client.get_parameters(list(names))
        self._spin_until(future.done, missing)
        values = future.result().values
        if len(values) != len(names):
            raise NoAnswer(f"node {tables[0]} has no parameters {', '.join(names)}: it is not a billiards table")
        return [parameter_value_to_python(value) for value in values]

    def states(self) -> MultiDOFJointState:
        """Where the balls are from now on, by the first message of `balls/states` that comes.

        Raises:
            NoAnswer: none came in time.
        """
        heard: list[MultiDOFJointState] = []
        subscription = self.create_subscription(MultiDOFJointState, "balls/states", heard.append, 1)
        try:
            self._spin_until(lambda: heard, f"nothing came on {subscription.topic_name}")
        finally:
            self.destroy_subscription(subscription)
        return heard[-1]

    def begin_anew(self) -> None:
        """Have the timeout count from here: time went by that was not the table's."""
        self._deadline = time.monotonic() + self._timeout

    def wait_for_rest(self, longest: float) -> None:
        """Wait until every ball rests, s at most; that time does not count for the timeout.

        Raises:
            NoAnswer: no table in time, or balls that move on.
        """
        self._wait_for_table(self._shots)
        if self._at_rest:
            return
        say(f"{self.get_name()}: balls move; waiting up to {longest:g} s for all to rest")
        began = time.monotonic()
        self._spin(lambda: self._at_rest, began + longest, f"balls still moved after {longest:g} s")
        self._deadline += time.monotonic() - began

    def shoot(self, message: WrenchStamped) -> dict[str, Any]:
        """Publish the shot; returns the JSON of `shot_result`.

        Raises:
            NoAnswer: no table, or no verdict, in time.
        """
        self._wait_for_table(self._shots)
        self._events.clear()
        self._has_moved = False
        return self._ask(self._shots, message)

    def preview(self, message: WrenchStamped) -> dict[str, Any]:
        """Ask what the shot would do; returns the JSON of `preview/result`.

        Raises:
            NoAnswer: no table, or no answer, in time.
        """
        self._wait_for_table(self._previews)
        return self._ask(self._previews, message)

    def watch(self, commentary: Commentary) -> None:
        """Print the events of an accepted shot until the table rests, however long that takes.

        Raises:
            NoAnswer: the table went away.
        """
        last = None
        while not (commentary.finished and self._has_moved and self._at_rest):  # a ball may spin on where it lies
            if self.count_publishers("collisions") == 0:
                raise NoAnswer("the table went away before the balls came to rest")
            if self._has_moved and self._at_rest:
                last = last or time.monotonic() + LAST_EVENTS
                if time.monotonic() > last:
                    break
            self._executor.spin_once(timeout_sec=0.1)
            while self._events:
                for line in commentary.take(self._events.popleft()):
                    say(line)
        for line in commentary.held_back():
            say(line)

    def _wait_for_table(self, publisher: Any) -> None:
        def listens() -> bool:
            return self._at_rest is not None and publisher.get_subscription_count() > 0

        self._spin_until(listens, f"no table listens on {publisher.topic_name}")

    def _tables(self) -> set[str]:
        # Nodes that take shots and answer: a recorder does only the one, a player of its records only the other.
        takers = self.get_subscriptions_info_by_topic("cue_shot")
        answerers = self.get_publishers_info_by_topic("shot_result")
        named = set(self.get_node_names_and_namespaces())  # an end is known before the name of its node
        for ends in (takers, answerers):
            named &= {(end.node_name, end.node_namespace) for end in ends}
        return {f"{namespace.rstrip('/')}/{name}" for name, namespace in named}

    def _ask(self, publisher: Any, message: WrenchStamped) -> dict[str, Any]:
        message.header.stamp = stamp = self.get_clock().now().to_msg()
        self._request = {"sec": stamp.sec, "nanosec": stamp.nanosec}
        publisher.publish(message)
        self._spin_until(lambda: self._answer is not None, f"the table on {publisher.topic_name} did not answer")
        assert self._answer is not None
        return self._answer

    def _spin_until(self, done: Callable[[], object], missing: str) -> None:
        self._spin(done, self._deadline, f"{missing} within {self._timeout:g} s")

    def _spin(self, done: Callable[[], object], deadline: float, missing: str) -> None:
        while not done():
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise NoAnswer(missing)
            self._executor.spin_once(timeout_sec=min(left, 0.1))  # a matched subscription does not wake the executor

    def _on_answer(self, message: String) -> None:
        answer = json.loads(message.data)
        if answer["request"] == self._request:
            self._answer = answer

    def _on_collisions(self, message: String) -> None:
        self._events.extend(json.loads(message.data)["events"])

    def _on_at_rest(self, message: Bool) -> None:
        self._at_rest = message.data
        self._has_moved = self._has_moved or not message.data


def main(arguments: list[str]) -> int:
    """Shoot once; returns the exit code."""
    return run_to_end("shoot", lambda: _shoot(arguments))


def _shoot(arguments: list[str]) -> int:
    parser = _parser()
    options = parser.parse_args(own_arguments("shoot", arguments))
    asked = _asked_for(parser, options)
    with ros("shoot", arguments), stoppable():
        return _play(options, asked)


def _parser() -> Parser:
    parser = Parser(prog="shoot", description=DESCRIPTION, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_shot_options(parser)
    parser.add_argument("--ball", default=CUE_BALL, metavar="NAME", help=f"only {CUE_BALL}: the table shoots no other")
    parser.add_argument("--preview", action="store_true", help="only ask what the shot would do")
    parser.add_argument("--watch", action="store_true", help="print the collisions until every ball rests")
    parser.add_argument(
        "--wait",
        type=positive_seconds,
        nargs="?",
        const=LONGEST_REST,
        metavar="S",
        help=f"wait until every ball rests before the shot, S s at most ({LONGEST_REST:g})",
    )
    parser.add_argument("--timeout", type=positive_seconds, default=10.0, metavar="S", help="longest wait, s (10)")
    return parser


def _asked_for(parser: Parser, options: argparse.Namespace) -> Aim | Shot:
    """The shot that the options say. A usage error ends the process."""
    if options.ball != CUE_BALL:
        parser.error(f"--ball must be {CUE_BALL}, the ball that cue_shot shoots; got {options.ball}")
    if options.preview and options.watch:
        parser.error("--watch follows a shot, and --preview plays none: give one of them")
    try:
        asked = shot_asked_for(options)
    except ValueError as error:
        parser.error(str(error))
    if asked is None:
        parser.error("give --speed and --angle, or --force")
    return asked


def _play(options: argparse.Namespace, asked: Aim | Shot) -> int:
    shooter = Shooter(options.timeout)
    shot = asked.shot(_physics(shooter)) if isinstance(asked, Aim) else asked
    message = wrench_from_shot(shot.force, shot.offset)
    say(f"shoot: {_describe(message, shot)}")
    if options.wait is not None:
        shooter.wait_for_rest(options.wait)
    answer = shooter.preview(message) if options.preview else shooter.shoot(message)
    if not answer["accepted"]:
        say(f"shoot: refused: {answer['reason']}")
        return FAILED
    if options.preview:
        _print_preview(answer)
        return 0
    say(f"shoot: accepted at {answer['time']:.3f} s of the table's time")
    if options.watch:
        commentary = Commentary()
        shooter.watch(commentary)
        say(f"shoot: at rest after {commentary.last_time - commentary.first_time:.3f} s")
    return 0


def _physics(shooter: Shooter) -> Physics:
    # As far as a shot in words needs it: the table's.
    names = ("mass", "radius", "cue_contact_time")
    values = shooter.parameters(*(f"physics.{name}" for name in names))
    try:
        return Physics(**dict(zip(names, values, strict=True)))
    except ValueError as error:
        raise NoAnswer(f"what listens on cue_shot is not a billiards table: {error}") from None


def _describe(message: WrenchStamped, shot: Shot) -> str:
    force, torque = (
        ", ".join(_written(part) for part in (vector.x, vector.y, vector.z))
        for vector in (message.wrench.force, message.wrench.torque)
    )
    side, up = map(_written, shot.offset)
    return f"force ({force}) N, torque ({torque}) N m: {side} m to the side, {up} m up"


def _written(number: float) -> str:
    return f"{number + 0.0:g}"  # -0.0 + 0.0 is 0.0


def _print_preview(answer: dict[str, Any]) -> None:
    say(f"shoot: would be accepted at {answer['time']:.3f} s of the table's time")
    commentary = Commentary()
    for event in answer["events"]:
        for line in commentary.take(event):
            say(line)
    for line in commentary.held_back():
        say(line)
    for name, pocket in answer["pocketed"].items():
        say(f"shoot: ball {name} would fall into pocket {pocket}")
    ended = "at rest" if answer["complete"] else "still moving, the preview ends"
    say(f"shoot: {ended} after {answer['duration']:.3f} s; the balls would lie at")
    for name, (x, y) in answer["final_positions"].items():
        say(f"  {name:>6}  {x:.4f} {y:.4f} m")
