# SPDX-License-Identifier: Apache-2.0
"""A running table as the page sees it: a client of its topics, services and parameters.

rclpy spins in a thread of its own; what it hears goes to the server's loop. Nothing is listened to but answers while no
page is open.
"""

from __future__ import annotations

import asyncio
import dataclasses
import json
import threading
import time
from collections.abc import Callable
from typing import Any

import rclpy
from geometry_msgs.msg import Transform, WrenchStamped
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger

from billiards_sim.command_line import Failure
from billiards_sim.engine.quantity import numbers, shown
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.scenes import BUILT_IN
from billiards_sim.play.backend import Backend, Message
from billiards_sim.play.effects import EFFECTS
from billiards_sim.play.records import table_record
from billiards_sim.play.shots import aim_of, choice, mapping
from billiards_sim.ros import parameters
from billiards_sim.ros.qos import LATCHED
from billiards_sim.ros.wrench import CUE_BALL, wrench_from_shot

PATIENCE = 10.0
"""s that the table has for an answer, and to be found."""

FRAME = 1.0 / 60.0
"""s between two states that a page is told of."""

SLACK = 0.003
"""s by which a state may come early: those of a table at 100 Hz that are told then come every 20 ms, evenly."""

QUIET = 0.1
"""s without an event before a table at rest has told all: topics keep no order among each other."""

Places = list[list[float] | None]
"""Of each ball x, y m and the quaternion x, y, z, w; None off the table."""


class RosBackend(Backend):
    """Plays on the table that listens on `cue_shot`.

    Raises:
        Failure: there is no table, or several, or it does not tell its parameters.
    """

    def __init__(self) -> None:
        self.tell = lambda _: None
        self._node = Node("play")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting: dict[tuple[int, int], asyncio.Future[Message]] = {}
        self._last_stamp = 0
        self._revision = 0
        self._at_rest = True
        self._events: list[Message] = []
        self._began = 0.0  # s of the table's time, of the last shot
        self._summing: asyncio.TimerHandle | None = None
        self._due = 0.0
        self._listening: list[Any] = []
        for topic in ("shot_result", "preview/result", "placement_result"):
            self._node.create_subscription(String, topic, self._on_answer, 100)
        self._node.create_subscription(Bool, "at_rest", self._on_at_rest, LATCHED)
        self._shots = self._node.create_publisher(WrenchStamped, "cue_shot", 10)
        self._previews = self._node.create_publisher(WrenchStamped, "cue_shot/preview", 10)
        self._balls = self._node.create_publisher(MultiDOFJointState, "set_balls", 10)
        table = self._find()
        self._parameters = AsyncParameterClient(self._node, table)
        self._reset = self._node.create_client(Trigger, f"{table}/reset")
        self._step = self._node.create_client(Trigger, f"{table}/step")
        self._pause = self._node.create_client(SetBool, f"{table}/pause")
        self._spin_until(self._parameters.services_are_ready, f"the node {table} did not tell its parameters")
        future = self._parameters.get_parameters(NAMES)
        self._spin_until(future.done, f"the node {table} did not tell its parameters")
        self._scene = self._read(future.result())
        self._places: Places = [[*at, 0.0, 0.0, 0.0, 1.0] for at in self._scene.positions.tolist()]
        self._told: Places = []
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def greeting(self) -> list[Message]:
        menu = {"tell": "menu", "live": True, "scenes": list(BUILT_IN), "tables": [], "physics": []}
        return [menu, self._table(), self._state()]

    def attend(self, pages: int) -> None:
        self._loop = asyncio.get_running_loop()
        if pages and not self._listening:
            self._listening = [
                self._node.create_subscription(MultiDOFJointState, "balls/states", self._on_states, 10),
                self._node.create_subscription(String, "collisions", self._on_collisions, 1000),
            ]
        elif not pages:
            for subscription in self._listening:
                self._node.destroy_subscription(subscription)
            self._listening = []

    def close(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()

    async def answer(self, asked: Message) -> Message:
        do = choice("do", asked.get("do"), DOES)
        return await do(self, asked) or {}

    async def _preview(self, asked: Message) -> Message:
        answer = await self._request(self._previews, self._wrench(asked))
        return {"run": _run(answer, self._scene)}

    async def _shoot(self, asked: Message) -> None:
        answer = await self._request(self._shots, self._wrench(asked))
        self._began = answer["time"]
        self._events = [event for event in self._events if event["time"] >= self._began]

    async def _place(self, asked: Message) -> None:
        places = {name: at for name, at in zip(self._scene.names, self._places) if at is not None}
        for name, at in mapping(asked, "balls").items():
            if name not in self._scene.names:
                raise ValueError(f"no ball is named {shown(name)}")
            places.pop(name, None)
            if at is not None:
                places[name] = [*numbers(f"position of ball {name!r}", at, 2)]
        message = MultiDOFJointState()
        message.joint_names = list(places)
        for x, y, *_ in places.values():
            transform = Transform()
            transform.translation.x, transform.translation.y = x, y
            message.transforms.append(transform)
        await self._request(self._balls, message)
        # Where they lie comes with the next tick, which is under way.
        self._renew()

    async def _set(self, asked: Message) -> None:
        name = asked.get("scene")
        choice("scene", name, BUILT_IN)
        await self._change([Parameter("scene", value=name)])
        await self._reset_table({})

    async def _effect(self, asked: Message) -> None:
        effect, on = choice("effect", asked.get("effect"), EFFECTS), asked.get("on")
        if not isinstance(on, bool):
            raise ValueError(f"on must be true or false, got {shown(on)}")
        changed = effect.switched(self._scene, on, asked.get("value"))
        before, after = _values(self._scene), _values(changed)
        await self._change([Parameter(name, value=value) for name, value in after.items() if value != before[name]])
        await self._reread()

    async def _reset_table(self, _: Message) -> None:
        await self._call(self._reset, Trigger.Request())
        await self._reread()

    async def _pause_table(self, asked: Message) -> None:
        if not isinstance(asked.get("on"), bool):
            raise ValueError(f"on must be true or false, got {shown(asked.get('on'))}")
        await self._call(self._pause, SetBool.Request(data=asked["on"]))

    async def _step_table(self, _: Message) -> None:
        await self._call(self._step, Trigger.Request())

    def _wrench(self, asked: Message) -> WrenchStamped:
        aim, ball = aim_of(mapping(asked, "shot"))
        if ball != CUE_BALL:
            raise ValueError(f"the table shoots the ball {CUE_BALL!r} alone, got {shown(ball)}")
        shot = aim.shot(self._scene.physics)
        return wrench_from_shot(shot.force, shot.offset)

    async def _request(self, publisher: Any, message: Any) -> Message:
        # The answer to a message; by its stamp, which no other has.
        stamp = max(self._node.get_clock().now().nanoseconds, self._last_stamp + 1)
        self._last_stamp = stamp
        message.header.stamp.sec, message.header.stamp.nanosec = key = divmod(stamp, 1_000_000_000)
        future = asyncio.get_running_loop().create_future()
        self._waiting[key] = future
        publisher.publish(message)
        try:
            answer: Message = await asyncio.wait_for(future, PATIENCE)
        except asyncio.TimeoutError:
            raise ValueError(f"the table did not answer within {PATIENCE:g} s") from None
        finally:
            del self._waiting[key]
        if not answer["accepted"]:
            raise ValueError(answer["reason"])
        return answer

    async def _call(self, client: Any, request: Any) -> None:
        response = await self._awaited(client.call_async(request))
        if not response.success:
            raise ValueError(response.message)

    async def _change(self, changed: list[Parameter]) -> None:
        response = await self._awaited(self._parameters.set_parameters_atomically(changed))
        if not response.result.successful:
            raise ValueError(response.result.reason)

    async def _reread(self) -> None:
        self._scene = self._read(await self._awaited(self._parameters.get_parameters(NAMES)))
        self._renew()

    async def _awaited(self, asked: Any) -> Any:
        # What rclpy's thread answers, in the server's.
        loop = asyncio.get_running_loop()
        done = asyncio.Event()
        asked.add_done_callback(lambda _: loop.call_soon_threadsafe(done.set))
        try:
            await asyncio.wait_for(done.wait(), PATIENCE)
        except asyncio.TimeoutError:
            raise ValueError(f"the table did not answer within {PATIENCE:g} s") from None
        return asked.result()

    def _read(self, response: Any) -> Scene:
        values = {name: parameter_value_to_python(value) for name, value in zip(NAMES, response.values)}
        try:
            return parameters.read_settings(values).scene
        except ValueError as error:
            raise Failure(f"what listens on cue_shot is not a table that this page can show: {error}") from None

    def _renew(self) -> None:
        self._revision += 1
        self.tell(self._table())

    def _table(self) -> Message:
        record = table_record(dataclasses.replace(self._scene, shot=None))
        by_name = dict(zip(self._scene.names, self._places))
        for ball in record["balls"]:
            at = by_name.get(ball["name"])
            ball["at"] = None if at is None else at[:2]
        return {"tell": "table", "table": {**record, "revision": self._revision, "undo": 0, "link": None}}

    def _state(self) -> Message:
        return {"tell": "state", "balls": self._places, "at_rest": self._at_rest}

    # In rclpy's thread:

    def _spin(self) -> None:
        try:
            self._executor.spin()
        except Exception:
            if rclpy.ok():
                raise

    def _hand_over(self, work: Callable[..., None], *given: Any) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(work, *given)

    def _on_answer(self, message: String) -> None:
        self._hand_over(self._take_answer, message.data)

    def _on_at_rest(self, message: Bool) -> None:
        if self._loop is None:
            self._at_rest = message.data
        self._hand_over(self._take_rest, message.data)

    def _on_collisions(self, message: String) -> None:
        self._hand_over(self._take_events, message.data)

    def _on_states(self, message: MultiDOFJointState) -> None:
        now = time.monotonic()
        if now < self._due - SLACK:
            return
        self._due = max(self._due + FRAME, now)
        there = dict(zip(message.joint_names, message.transforms))
        places: Places = []
        for name in self._scene.names:
            transform = there.get(name)
            if transform is None:
                places.append(None)
                continue
            at, turn = transform.translation, transform.rotation
            places.append([at.x, at.y, turn.x, turn.y, turn.z, turn.w])
        if places != self._told:
            self._told = places
            self._hand_over(self._take_places, places)

    # In the server's:

    def _take_answer(self, text: str) -> None:
        answer = json.loads(text)
        future = self._waiting.get((answer["request"]["sec"], answer["request"]["nanosec"]))
        if future is not None and not future.done():
            future.set_result(answer)

    def _take_places(self, places: Places) -> None:
        renewed = [at is None for at in places] != [at is None for at in self._places] or self._at_rest
        self._places = places
        self.tell(self._state())
        if renewed and self._at_rest:  # somebody has placed them
            self._renew()

    def _take_rest(self, at_rest: bool) -> None:
        if at_rest == self._at_rest:
            return
        self._at_rest = at_rest
        self.tell(self._state())
        if at_rest:
            self._sum_up_soon()
            self._renew()

    def _take_events(self, text: str) -> None:
        events = json.loads(text)["events"]
        shots = [event["time"] for event in events if event["kind"] == "shot"]
        if shots:
            self._began, self._events = shots[-1], []
        self._events += [event for event in events if event["time"] >= self._began]
        self._sum_up_soon()

    def _sum_up_soon(self) -> None:
        if self._summing is not None:
            self._summing.cancel()
        self._summing = asyncio.get_running_loop().call_later(QUIET, self._sum_up)

    def _sum_up(self) -> None:
        if self._at_rest and self._events:
            end = self._events[-1]["time"] - self._began
            self.tell({"tell": "happened", "run": {"end": end, "events": self._events}})

    def _find(self) -> str:
        self._spin_until(self._tables, "no table listens on cue_shot")
        tables = sorted(self._tables())
        if len(tables) > 1:
            raise Failure(f"{len(tables)} tables listen on cue_shot, {', '.join(tables)}: give each a namespace")
        return tables[0]

    def _tables(self) -> set[str]:
        takers = self._node.get_subscriptions_info_by_topic("cue_shot")
        named = set(self._node.get_node_names_and_namespaces())  # an end is known before the name of its node
        named &= {(end.node_name, end.node_namespace) for end in takers}
        return {f"{namespace.rstrip('/')}/{name}" for name, namespace in named}

    def _spin_until(self, done: Callable[[], object], missing: str) -> None:
        deadline = time.monotonic() + PATIENCE
        while not done():
            if time.monotonic() > deadline:
                raise Failure(f"{missing} within {PATIENCE:g} s")
            self._executor.spin_once(timeout_sec=0.1)


NAMES = ["scene", *parameters.GROUP_QUANTITIES]
"""Parameters of the table that the page shows."""

DOES: dict[str, Any] = {
    "preview": RosBackend._preview,
    "shoot": RosBackend._shoot,
    "place": RosBackend._place,
    "set": RosBackend._set,
    "effect": RosBackend._effect,
    "reset": RosBackend._reset_table,
    "pause": RosBackend._pause_table,
    "step": RosBackend._step_table,
}
"""What a page can ask for."""


def _values(scene: Scene) -> dict[str, float]:
    return {
        name: value
        for group in parameters.GROUPS
        for name, value in parameters.group_values(group, getattr(scene, group)).items()
    }


def _run(answer: Message, scene: Scene) -> Message:
    # A preview of the table as a run: its paths are straight lines, from point to point.
    began, (centre_x, centre_y) = answer["time"], scene.table.centre
    arcs = []
    for name in scene.names:
        points = answer["paths"].get(name, [])
        arcs.append([_line(one, other, began, centre_x, centre_y) for one, other in zip(points, points[1:])])
        if points:
            t, x, y = points[-1]
            arcs[-1].append([t - began, x - centre_x, y - centre_y, 0.0, 0.0, 0.0, 0.0])
    events = [{**event, "time": event["time"] - began} for event in answer["events"]]
    return {"end": answer["duration"], "names": list(scene.names), "arcs": arcs, "events": events}


def _line(one: list[float], other: list[float], began: float, centre_x: float, centre_y: float) -> list[float]:
    t, x, y = one
    duration = max(other[0] - t, 1e-9)  # of the push of the cue, which takes no time
    speed = (other[1] - x) / duration, (other[2] - y) / duration
    return [t - began, x - centre_x, y - centre_y, *speed, 0.0, 0.0]
