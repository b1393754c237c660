# SPDX-License-Identifier: Apache-2.0
"""Processes of the package and a client in the test's own process. Every wait is bounded and ends on an event."""

import json
import os
import selectors
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any

import rclpy
import rclpy.parameter
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, VelocityStamped, WrenchStamped
from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from billiards_sim.ros.process import end_group

START_TIMEOUT = 120.0
"""s. A second on an idle machine."""

GRACE = 10.0
"""s that a process has to end itself and its own children before it is killed."""

TIMEOUT = 20.0
"""s. Discovery takes up to 3 s."""

DEPTH = 1000
"""Messages that wait for a client that is not spinning."""

NOTHING_LOST = tuple(
    f"qos_overrides./{topic}.publisher.depth:={DEPTH}" for topic in ("balls/poses", "balls/states", "markers")
)
"""Parameters of a table that keeps messages of more than ten ticks for a client that the machine gives no time."""

LATCHED = QoSProfile(depth=DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Process:
    """A command in its own process group, with its stderr at hand."""

    def __init__(
        self,
        arguments: list[str],
        domain: int,
        *,
        command: list[str] | None = None,
        environment: Mapping[str, str] | None = None,
        directory: Path | None = None,
        stdout: int | IO[bytes] = subprocess.PIPE,
    ) -> None:
        self._process = subprocess.Popen(
            [*(command or [sys.executable, "-m", "billiards_sim"]), *arguments],
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), **(environment or {})},
            cwd=directory,
            stdout=stdout,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
        self._streams = {"stdout": b"", "stderr": b""}
        self._pipes = {name: getattr(self._process, name) for name in self._streams if getattr(self._process, name)}
        self._selector = selectors.DefaultSelector()
        for name, pipe in self._pipes.items():
            self._selector.register(pipe, selectors.EVENT_READ, name)

    @property
    def stdout(self) -> str:
        return self._streams["stdout"].decode()

    @property
    def stderr(self) -> str:
        return self._streams["stderr"].decode()

    def wait_for(self, text: str, timeout: float = START_TIMEOUT) -> None:
        """Read until stdout or stderr contains the text."""
        self._read(lambda: text in self.stdout or text in self.stderr, timeout)
        assert text in self.stdout or text in self.stderr, f"no {text!r} in:\n{self.stdout}\n{self.stderr}"

    def wait(self, timeout: float = START_TIMEOUT) -> int:
        """Read until the process ends; returns its exit code."""
        self._read(lambda: False, timeout)
        return self._process.wait(timeout)

    def signal(self, number: int) -> None:
        self._process.send_signal(number)

    def close(self) -> None:
        end_group(self._process, GRACE)
        self._selector.close()
        for pipe in self._pipes.values():
            pipe.close()

    def _read(self, done: Callable[[], bool], timeout: float) -> None:
        deadline = time.monotonic() + timeout
        while not done() and self._selector.get_map():
            ready = self._selector.select(max(deadline - time.monotonic(), 0.0))
            assert ready, f"nothing more within {timeout} s after:\n{self.stdout}\n{self.stderr}"
            for key, _ in ready:
                block = os.read(key.fd, 65536)
                self._streams[key.data] += block
                if not block:
                    self._selector.unregister(key.fileobj)


class Client:
    """Hears everything that a table publishes, shoots, resets."""

    def __init__(self, domain: int, namespace: str = "") -> None:
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node("client", namespace=namespace, context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._subscriptions: dict[str, Subscription] = {}
        self.poses: list[PoseArray] = []
        self._sent_poses: deque[tuple[PoseArray, int]] = deque(maxlen=DEPTH)  # and when, ns of the wall clock
        self.states: list[MultiDOFJointState] = []
        self.twists: list[VelocityStamped] = []
        self.markers: list[MarkerArray] = []
        self.table_markers: list[MarkerArray] = []
        self.collisions: list[dict] = []  # events
        self.sequence: list[int] = []  # numbers of the messages that brought them
        self.results: list[dict] = []
        self.placements: list[dict] = []
        self.previews: list[dict] = []
        self.drawings: list[MarkerArray] = []
        self.at_rest: list[bool] = []
        # A table learns of these in this order, so whoever hears the last one is known to hear all.
        self._subscribe(String, "shot_result", lambda message: self.results.append(json.loads(message.data)))
        self._subscribe(String, "preview/result", lambda message: self.previews.append(json.loads(message.data)))
        self._subscribe(MarkerArray, "preview", self.drawings.append)
        self._subscribe(String, "placement_result", lambda message: self.placements.append(json.loads(message.data)))
        self._subscribe(String, "collisions", self._on_collisions)
        self._subscribe(MultiDOFJointState, "balls/states", self.states.append)
        self._subscribe(VelocityStamped, "balls/twists", self.twists.append)
        self._subscribe(MarkerArray, "markers", self.markers.append)
        self._subscribe(MarkerArray, "table_markers", self.table_markers.append, LATCHED)
        self._subscribe(Bool, "at_rest", lambda message: self.at_rest.append(message.data), LATCHED)
        self._subscribe(PoseArray, "balls/poses", self._on_poses)
        self.cue = self.node.create_publisher(WrenchStamped, "cue_shot", 10)
        self.asker = self.node.create_publisher(WrenchStamped, "cue_shot/preview", 1000)
        self.placer = self.node.create_publisher(PoseArray, "place_balls", 10)
        self.setter = self.node.create_publisher(MultiDOFJointState, "set_balls", 10)
        self._reset = self.node.create_client(Trigger, "table/reset")
        self._pause = self.node.create_client(SetBool, "table/pause")
        self._step = self.node.create_client(Trigger, "table/step")
        self._parameters = AsyncParameterClient(self.node, "table")

    def connect(self) -> None:
        """Wait until the table hears this client and the client hears the table."""
        self.spin_until(
            lambda: (
                self.poses
                and self.at_rest
                and self.table_markers
                and all(one.get_subscription_count() == 1 for one in (self.cue, self.placer, self.setter, self.asker))
                and all(one.service_is_ready() for one in (self._reset, self._pause, self._step))
                and self._parameters.services_are_ready()
            )
        )

    def ignore(self, *topics: str) -> None:
        """Hear no more of these."""
        for topic in topics:
            self.node.destroy_subscription(self._subscriptions.pop(topic))

    def spin_until(self, done: Callable[[], object], timeout: float = TIMEOUT) -> None:
        deadline = time.monotonic() + timeout
        while not done():
            assert time.monotonic() < deadline, f"not within {timeout} s"
            self._executor.spin_once(timeout_sec=0.1)

    def shoot(self, message: WrenchStamped) -> dict:
        """Publish a shot; returns the verdict."""
        before = len(self.results)
        self.cue.publish(message)
        self.spin_until(lambda: len(self.results) > before)
        assert len(self.results) == before + 1
        return self.results[-1]

    def preview(self, message: WrenchStamped) -> dict:
        """Ask what a shot would do; returns the answer."""
        before = len(self.previews)
        self.asker.publish(message)
        self.spin_until(lambda: len(self.previews) > before)
        assert len(self.previews) == before + 1
        return self.previews[-1]

    def place(self, message: PoseArray) -> dict:
        """Publish a placement; returns the verdict."""
        return self._placed(self.placer, message)

    def set_balls(self, message: MultiDOFJointState) -> dict:
        """Publish the balls that lie on the table; returns the verdict."""
        return self._placed(self.setter, message)

    def _placed(self, publisher: Publisher, message: PoseArray | MultiDOFJointState) -> dict:
        before = len(self.placements)
        publisher.publish(message)
        self.spin_until(lambda: len(self.placements) > before)
        assert len(self.placements) == before + 1
        return self.placements[-1]

    def reset(self) -> Trigger.Response:
        return self._result(self._reset.call_async(Trigger.Request()))

    def pause(self, on: bool) -> SetBool.Response:
        return self._result(self._pause.call_async(SetBool.Request(data=on)))

    def step(self) -> Trigger.Response:
        return self._result(self._step.call_async(Trigger.Request()))

    def set_parameters(self, **values: object) -> list[SetParametersResult]:
        """Each on its own, as `ros2 param load` does."""
        return self._result(self._parameters.set_parameters(_parameters(values))).results

    def set_parameters_atomically(self, **values: object) -> SetParametersResult:
        return self._result(self._parameters.set_parameters_atomically(_parameters(values))).result

    def get_parameters(self, *names: str) -> list[object]:
        values = self._result(self._parameters.get_parameters(list(names))).values
        return [rclpy.parameter.parameter_value_to_python(value) for value in values]

    def set_own_parameters(self, **values: object) -> None:
        assert all(one.successful for one in self.node.set_parameters(_parameters(values)))

    def fresh_poses(self, count: int = 1) -> list[PoseArray]:
        """The first poses that are sent after this call; those that were on their way are skipped."""
        start = time.time_ns()

        def found() -> list[PoseArray]:
            return [message for message, sent in self._sent_poses if sent > start]

        self.spin_until(lambda: len(found()) >= count)
        return found()[:count]

    def fresh_state(self) -> MultiDOFJointState:
        """The first state that is sent after this call, or a later one."""
        start = stamp_ns(self.fresh_poses()[0].header.stamp)
        self.spin_until(lambda: stamp_ns(self.states[-1].header.stamp) >= start)
        return self.states[-1]

    def stamps(self, count: int) -> list[int]:
        """Of the next poses, ns."""
        return [stamp_ns(message.header.stamp) for message in self.fresh_poses(count)]

    def _on_poses(self, message: PoseArray, about: Mapping[str, int]) -> None:
        self.poses.append(message)
        self._sent_poses.append((message, about["source_timestamp"]))

    def _result(self, future: rclpy.Future) -> Any:
        self.spin_until(future.done)
        return future.result()

    def next_poses(self, count: int = 1, after: int | None = None) -> list[PoseArray]:
        """The first poses with a stamp after `after` ns, by default after now: at a real-time factor of 1 no stamp is
        ahead of the clock."""
        start = self.node.get_clock().now().nanoseconds if after is None else after

        def found() -> list[PoseArray]:
            return [message for message in self.poses if stamp_ns(message.header.stamp) > start]

        self.spin_until(lambda: len(found()) >= count)
        return found()[:count]

    def close(self) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._context.try_shutdown()

    def _on_collisions(self, message: String) -> None:
        content = json.loads(message.data)
        assert (content["version"], len(content["events"]) > 0) == (2, True)
        self.sequence.append(content["sequence"])
        self.collisions += content["events"]

    def _subscribe(self, kind: type, topic: str, callback: Callable, qos: QoSProfile | int = DEPTH) -> None:
        self._subscriptions[topic] = self.node.create_subscription(kind, topic, callback, qos)


def _parameters(values: Mapping[str, object]) -> list[rclpy.Parameter]:
    return [rclpy.Parameter(name, value=value) for name, value in values.items()]


def stamp_ns(stamp: Time) -> int:
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def positions(message: PoseArray) -> list[tuple[float, float]]:
    return [(pose.position.x, pose.position.y) for pose in message.poses]
