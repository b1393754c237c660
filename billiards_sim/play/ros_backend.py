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
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import Transform, WrenchStamped
from rcl_interfaces.msg import ParameterEvent
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from std_srvs.srv import SetBool, Trigger
from visualization_msgs.msg import MarkerArray

from billiards_sim import quaternion
from billiards_sim.command_line import Failure, one_line
from billiards_sim.engine.quantity import number, numbers, shown
from billiards_sim.engine.scene import Scene
from billiards_sim.engine.scenes import BUILT_IN
from billiards_sim.play.backend import Backend, Message
from billiards_sim.play.effects import EFFECTS
from billiards_sim.play.engine_backend import MOST_BALLS, MOST_UNDONE, played, read_file, written_file
from billiards_sim.play.records import PHYSICS, run_record, table_record
from billiards_sim.play.shots import aim_of, choice, mapping
from billiards_sim.ros import parameters
from billiards_sim.ros.qos import LATCHED
from billiards_sim.ros.wrench import CUE_BALL, wrench_from_shot

PATIENCE = 10.0
"""s that the table has for an answer, and to be found."""

GONE = "the table has ended; it is shown again when it runs again"

FRAME = 1.0 / 60.0
"""s between two states that a page is told of."""

SLACK = 0.003
"""s by which a state may come early: those of a table at 100 Hz that are told then come every 20 ms, evenly."""

EACH = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The last message, and every later one however late it is taken: who has only the last misses a short run."""

QUIET = 0.1
"""s without news before a table at rest has told all: topics keep no order among each other."""

LONGEST_TURN = 0.1
"""s between two states over which balls are turned by their spins; what is longer is a gap."""

Places = list[list[float] | None]
"""Of each ball x, y m and the quaternion x, y, z, w; None off the table."""

Position = dict[str, tuple[float, float]]
"""Where the balls lie that are on the table, m, by name."""


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
        self._due = 0.0
        self._listening: list[Any] = []
        self._before: deque[Position] = deque(maxlen=MOST_UNDONE)  # positions at rest that can be gone back to
        self._note_soon = Lull(self._note)
        self._sum_up_soon = Lull(self._sum_up)
        self._reread_soon = Lull(self._begin_to_reread)
        self._rereading: asyncio.Task[None] | None = None  # asyncio keeps none that nobody holds
        for topic in ("shot_result", "preview/result", "placement_result"):
            self._node.create_subscription(String, topic, self._on_answer, 100)
        ends = SubscriptionEventCallbacks(matched=self._on_end)
        self._node.create_subscription(Bool, "at_rest", self._on_at_rest, EACH, event_callbacks=ends)
        self._shots = self._node.create_publisher(WrenchStamped, "cue_shot", 10)
        self._previews = self._node.create_publisher(WrenchStamped, "cue_shot/preview", 10)
        self._balls = self._node.create_publisher(MultiDOFJointState, "set_balls", 10)
        self._name = table = self._find()
        self._parameters = AsyncParameterClient(self._node, table)
        self._reset = self._node.create_client(Trigger, f"{table}/reset")
        self._step = self._node.create_client(Trigger, f"{table}/step")
        self._pause = self._node.create_client(SetBool, f"{table}/pause")
        self._spin_until(self._parameters.services_are_ready, f"the node {table} did not tell its parameters")
        future = self._parameters.get_parameters(NAMES)
        self._spin_until(future.done, f"the node {table} did not tell its parameters")
        self._settings = self._read(future.result())
        self._rested: Position | None = None  # at the last rest
        self._told: tuple[Places, bool] | None
        self._lie_still: bool  # the places: topics keep no order, and that all rest may be known before where
        self._places: Places
        self._turning: Turning
        self._begin()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def greeting(self) -> list[Message]:
        menu = {"tell": "menu", "live": True, "scenes": list(BUILT_IN), "tables": [], "physics": list(PHYSICS)}
        return [menu, self._table(), self._state()]

    def attend(self, pages: int) -> None:
        self._loop = asyncio.get_running_loop()
        if pages and not self._listening:
            self._turning = Turning(self._turning.names)
            self._listening = [
                self._node.create_subscription(MultiDOFJointState, "balls/states", self._on_states, 10, raw=True),
                self._node.create_subscription(String, "collisions", self._on_collisions, 1000),
                # for what others change: parameters, and the scene with a reset
                self._node.create_subscription(ParameterEvent, "/parameter_events", self._on_parameters, 1000),
                self._node.create_subscription(MarkerArray, "table_markers", self._on_scene, LATCHED, raw=True),
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
        if self._node.count_subscribers("cue_shot") == 0:
            raise ValueError(GONE)
        return await do(self, asked) or {}

    async def _preview(self, asked: Message) -> Message:
        answer: Message = {}
        if asked.get("without") is not None:  # the same engine, here
            effect = choice("without", asked["without"], EFFECTS)
            scene = self._present()
            other = effect.switched(scene, not effect.is_on(scene))
            answer["without"] = run_record(played(other, mapping(asked, "shot")).run, spins=False)
        told = await self._request(self._previews, self._wrench(asked))
        return {"run": _run(told, self._scene), **answer}

    async def _shoot(self, asked: Message) -> None:
        self._note()
        answer = await self._request(self._shots, self._wrench(asked))
        self._began = answer["time"]
        self._events = [event for event in self._events if event["time"] >= self._began]

    async def _place(self, asked: Message) -> None:
        position = self._position()
        for name, at in mapping(asked, "balls").items():
            if name not in self._scene.names:
                raise ValueError(f"no ball is named {shown(name)}")
            position.pop(name, None)
            if at is not None:
                x, y = numbers(f"position of ball {name!r}", at, 2)
                position[name] = x, y
        await self._lay(position)
        self._renew()

    async def _lay(self, position: Position) -> None:
        self._note()
        message = MultiDOFJointState()
        message.joint_names = list(position)
        for x, y in position.values():
            transform = Transform()
            transform.translation.x, transform.translation.y = x, y
            message.transforms.append(transform)
        await self._request(self._balls, message)  # where they lie comes with the next tick, which is under way

    async def _undo(self, _: Message) -> None:
        self._note()
        if not self._before:
            raise ValueError("there is nothing to undo")
        await self._lay(self._before[-1])
        self._rested = self._before.pop()
        self._renew()

    async def _load(self, asked: Message) -> None:
        scene = read_file(asked, MOST_BALLS)
        if scene.table != self._scene.table:
            raise ValueError(
                "the file has another table than the one that runs: start the node with the file as its scene"
            )
        if scene.velocities.any() or scene.angular_velocities.any():
            raise ValueError("balls of the file move: a running table takes balls at rest")
        await self._change_to(scene)
        await self._lay(_lying(scene))
        self._renew()

    async def _save(self, _: Message) -> Message:
        return written_file(self._present())

    async def _set(self, asked: Message) -> None:
        if "scene" not in asked:
            physics = choice("physics", asked.get("physics"), PHYSICS)()
            await self._change_to(dataclasses.replace(self._scene, physics=physics))
            return
        name = asked["scene"]
        choice("scene", name, BUILT_IN)
        await self._change([Parameter("scene", value=name)])
        await self._reset_table({})

    async def _effect(self, asked: Message) -> None:
        effect, on = choice("effect", asked.get("effect"), EFFECTS), asked.get("on")
        if not isinstance(on, bool):
            raise ValueError(f"on must be true or false, got {shown(on)}")
        await self._change_to(effect.switched(self._scene, on, asked.get("value")))

    async def _change_to(self, scene: Scene) -> None:
        # The physics and the table of another scene.
        before, after = _values(self._scene), _values(scene)
        await self._change([Parameter(name, value=value) for name, value in after.items() if value != before[name]])
        await self._reread()

    async def _pace(self, asked: Message) -> None:
        factor = number("factor", asked.get("factor"))
        await self._change([Parameter("real_time_factor", value=factor)])
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
        if not changed:  # which rclpy does not take
            return
        response = await self._awaited(self._parameters.set_parameters_atomically(changed))
        if not response.result.successful:
            raise ValueError(response.result.reason)

    async def _reread(self) -> None:
        names = self._scene.names
        self._settings = self._read(await self._awaited(self._parameters.get_parameters(NAMES)))
        if self._scene.names != names:
            self._before.clear()
            self._rested = None
            self._begin()
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

    def _begin(self) -> None:
        # Until the first state of a scene tells more.
        scene = self._scene
        self._turning = Turning(scene.names)
        self._told, self._lie_still = None, False
        self._places = [
            [*at, *quaternion.IDENTITY] if there else None for at, there in zip(scene.positions.tolist(), scene.in_play)
        ]

    @property
    def _scene(self) -> Scene:
        return self._settings.scene

    def _position(self) -> Position:
        return {name: (at[0], at[1]) for name, at in zip(self._scene.names, self._places) if at is not None}

    def _present(self) -> Scene:
        # What is on the table, at rest. ValueError: what lies there is no scene, as while balls meet.
        position = self._position()
        return dataclasses.replace(
            self._scene,
            positions=np.array([position.get(name, (np.nan, np.nan)) for name in self._scene.names]),
            velocities=np.zeros((len(self._scene), 2)),
            angular_velocities=np.zeros((len(self._scene), 3)),
            in_play=np.array([name in position for name in self._scene.names]),
            shot=None,
        )

    def _read(self, response: Any) -> parameters.Settings:
        values = {name: parameter_value_to_python(value) for name, value in zip(NAMES, response.values)}
        try:
            return parameters.read_settings(values)
        except ValueError as error:
            raise Failure(f"what listens on cue_shot is not a table that this page can show: {error}") from None

    def _renew(self) -> None:
        self._revision += 1
        self.tell(self._table())

    def _table(self) -> Message:
        try:
            record = table_record(self._present())
        except ValueError:
            record = {**table_record(dataclasses.replace(self._scene, shot=None)), "link": None}
        for ball, at in zip(record["balls"], self._places):
            ball["at"] = None if at is None else at[:2]
        told = {"revision": self._revision, "undo": len(self._before), "pace": self._settings.real_time_factor}
        return {"tell": "table", "table": {**record, **told}}

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

    def _on_end(self, matched: Any) -> None:
        if matched.current_count == 0:
            self._hand_over(self.tell, {"tell": "said", "error": GONE})

    def _on_collisions(self, message: String) -> None:
        self._hand_over(self._take_events, message.data)

    def _on_parameters(self, event: ParameterEvent) -> None:
        changed = {one.name for one in event.changed_parameters}
        if event.node == self._name and changed - {"scene"}:  # which takes effect with a reset
            self._hand_over(self._reread_soon)

    def _on_scene(self, _: bytes) -> None:
        self._hand_over(self._reread_soon)

    def _on_states(self, data: bytes) -> None:
        now = time.monotonic()
        if now < self._due - SLACK:
            return
        self._due = max(self._due + FRAME, now)
        message = deserialize_message(data, MultiDOFJointState)  # what is not told need not be read
        there = {name: index for index, name in enumerate(message.joint_names)}
        turning = self._turning  # of one scene, whatever the server's thread sets meanwhile
        turns = None if self._settings.track_orientation else turning.until(message)
        places: Places = []
        for name in turning.names:
            if name not in there:
                places.append(None)
                continue
            transform = message.transforms[there[name]]
            at, turn = transform.translation, transform.rotation
            places.append([at.x, at.y, *(turns[name] if turns else (turn.x, turn.y, turn.z, turn.w))])
        still = not any(
            one.linear.x or one.linear.y or one.angular.x or one.angular.y for one in message.twist
        )  # spins about the vertical go on where a ball lies
        if (places, still) != self._told:
            self._told = places, still
            self._hand_over(self._take_places, turning.names, places, still)

    # In the server's:

    def _take_answer(self, text: str) -> None:
        answer = json.loads(text)
        future = self._waiting.get((answer["request"]["sec"], answer["request"]["nanosec"]))
        if future is not None and not future.done():
            future.set_result(answer)

    def _take_places(self, names: tuple[str, ...], places: Places, still: bool) -> None:
        if names != self._scene.names:
            return
        renewed = [at is None for at in places] != [at is None for at in self._places] or self._at_rest
        self._places, self._lie_still = places, still
        self.tell(self._state())
        if self._rested is None:
            self._note()
        self._note_soon()
        if renewed and self._at_rest:  # somebody has placed them
            self._renew()

    def _take_rest(self, at_rest: bool) -> None:
        if at_rest == self._at_rest:
            return
        self._at_rest = at_rest
        self.tell(self._state())
        if at_rest:
            self._sum_up_soon()
            self._note_soon()
            self._renew()

    def _note(self) -> None:
        # What lay at the last rest can be gone back to, whoever has shot or placed since.
        position = self._position()
        if not self._at_rest or not self._lie_still or position == self._rested:
            return
        if self._rested is not None:
            self._before.append(self._rested)
        self._rested = position
        self._renew()

    def _begin_to_reread(self) -> None:
        self._rereading = asyncio.get_running_loop().create_task(self._reread_again())

    async def _reread_again(self) -> None:
        try:
            await self._reread()
        except (ValueError, Failure) as error:
            self.tell({"tell": "said", "error": one_line(error)})

    def _take_events(self, text: str) -> None:
        events = json.loads(text)["events"]
        shots = [event["time"] for event in events if event["kind"] == "shot"]
        if shots:
            self._began, self._events = shots[-1], []
        self._events += [event for event in events if event["time"] >= self._began]
        self._sum_up_soon()

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


class Lull:
    """Has something done when nothing has called for it for `QUIET`."""

    def __init__(self, work: Callable[[], object]) -> None:
        self._work = work
        self._due: asyncio.TimerHandle | None = None

    def __call__(self) -> None:
        if self._due is not None:
            self._due.cancel()
        self._due = asyncio.get_running_loop().call_later(QUIET, self._work)


class Turning:
    """How balls are turned of which the table tells only the spins."""

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self._turns = np.tile(quaternion.IDENTITY, (len(names), 1))
        self._at: float | None = None

    def until(self, message: MultiDOFJointState) -> Mapping[str, list[float]]:
        """Quaternions by name, at the time of a state, which comes after the last one."""
        stamp = message.header.stamp
        now = stamp.sec + 1e-9 * stamp.nanosec
        passed = 0.0 if self._at is None else now - self._at
        self._at = now
        if 0.0 < passed <= LONGEST_TURN:
            told = dict(zip(message.joint_names, message.twist))
            spins = np.zeros((len(self.names), 3))
            for row, name in zip(spins, self.names):
                if name in told:
                    spin = told[name].angular
                    row[:] = spin.x, spin.y, spin.z
            self._turns = quaternion.turned(self._turns, spins, passed)
        return dict(zip(self.names, self._turns.tolist()))


NAMES = ["scene", "real_time_factor", "track_orientation", *parameters.GROUP_QUANTITIES]
"""Parameters of the table that the page shows."""

DOES: dict[str, Any] = {
    "preview": RosBackend._preview,
    "shoot": RosBackend._shoot,
    "place": RosBackend._place,
    "set": RosBackend._set,
    "effect": RosBackend._effect,
    "pace": RosBackend._pace,
    "load": RosBackend._load,
    "save": RosBackend._save,
    "reset": RosBackend._reset_table,
    "undo": RosBackend._undo,
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


def _lying(scene: Scene) -> Position:
    return {
        name: (x, y) for name, (x, y), in_play in zip(scene.names, scene.positions.tolist(), scene.in_play) if in_play
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
    rest = {} if answer["complete"] else {"rest": None}
    return {"end": answer["duration"], **rest, "names": list(scene.names), "arcs": arcs, "events": events}


def _line(one: list[float], other: list[float], began: float, centre_x: float, centre_y: float) -> list[float]:
    t, x, y = one
    duration = max(other[0] - t, 1e-9)  # of the push of the cue, which takes no time
    speed = (other[1] - x) / duration, (other[2] - y) / duration
    return [t - began, x - centre_x, y - centre_y, *speed, 0.0, 0.0]
