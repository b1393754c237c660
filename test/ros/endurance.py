# SPDX-License-Identifier: Apache-2.0
"""What a running table must stand: three hours of random shots, a flood of malformed ones, kills, late joiners, short
queues.

python test/ros/endurance.py [hours] [flood] [kill] [late] [queue] [--hours 3] [--seconds 30] [--kills 3] [--joiners 5]
                             [--breaks 100]

Each part runs tables of its own, in a ROS domain of this machine, and prints one line of JSON. It is bounded in count
and time. Exit code 1: a figure is out of its bounds; "broken" names it.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PoseArray, VelocityStamped, WrenchStamped
from numpy.typing import NDArray
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from tqdm import tqdm
from visualization_msgs.msg import MarkerArray
from watcher import Watcher

import billiards_sim as bs
from billiards_sim.ros.process import end_group, isolate
from billiards_sim.ros.tools.node_load import evenness, processor_time
from billiards_sim.ros.wrench import wrench_from_shot

UPDATE_RATE = 100.0  # Hz, the default
REAL_TIME_FACTOR = 20.0
LONG_FACTOR = 60.0  # real-time factor of the hours
BREAK_FACTOR = 10.0  # real-time factor of the breaks that the short queue sees
RESET_EVERY = 10  # shots
FORCE, OFFSET = (100.0, 3.0, 0.0), (0.004, 0.003)  # N, m: a break with english
BURST = 1e-3  # s between two bursts of the flood

DEPTH = 10_000
"""Messages kept for a process that falls behind: none is lost on the way."""

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SPAWN = get_context("spawn")
"""Processes that take over nothing of this one's ROS."""

START_TIMEOUT = 60.0
"""s for a table to start, and for a client to find it."""

SHOT_TIMEOUT = 10.0
"""s for a shot to be answered and to come to rest: the longest takes 1 s at the real-time factor."""

QUIET = 2.0
"""s without an answer, after which none is on its way."""

WARM_UP = 0.5
"""Share of the hours that the slope of the memory leaves out: it rises by 5 MB in some 1 000 shots, while caches and
send queues fill, at a factor of 20 as at 60, and then levels off."""

LEAST_TAIL = 0.5
"""h, simulated. Over less the slope is that of a few pages, and not judged."""

PIECES = 10
"""Of the hours, whose median growth counts: a leak is in each, the peak of one shot with thousands of events in one."""

MOST_GROWTH = 1.0
"""MB of resident memory in a simulated hour, without such peaks."""

MOST_RISE = 10.0
"""MB of resident memory with them: 25 000 events at once need 5."""

LEAST_SENT = 0.99
"""Of the malformed shots that the flood is to have."""

MOST_RATE_ERROR = 0.05
"""Of the rate of the ticks, relative."""

CALM = 5.0
"""s of good shots alone before the flood, to tell what a refusal costs."""

MOST_REFUSAL = 1.5e-4
"""s of the table's processor time for a malformed shot."""

MOST_SPACING = 0.1
"""s between two ticks under the flood."""

MOST_LINES = 1.2
"""Lines a second about refused shots: one, and room for the two ends of the flood."""

MOST_POSITION_ERROR = 1e-9
"""m between the table and the engine's own run: rounding of the times in the shot, grown by the collisions."""

MOST_WAIT = 2.0
"""s until a new client has what is latched."""

MOST_WAIT_OF_OLD = 7.0
"""s after the start of a new table until an old client has; what its middleware misses it repeats 3 s later."""


class Table:
    """A table in its own process group, which can be killed and started again."""

    def __init__(self, factor: float = REAL_TIME_FACTOR) -> None:
        given = ("scene:=rack", f"update_rate:={UPDATE_RATE}", f"real_time_factor:={factor}")
        self._arguments = [part for parameter in given for part in ("-p", parameter)]

    def __enter__(self) -> Table:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        end_group(self._process)

    def start(self) -> None:
        self._log = tempfile.TemporaryFile()  # noqa: SIM115  a pipe that nobody reads would stop the table
        command = [sys.executable, "-m", "billiards_sim", "table", "--ros-args", *self._arguments]
        self._process = subprocess.Popen(command, stderr=self._log, start_new_session=True)

    def kill(self) -> None:
        os.killpg(self.pid, signal.SIGKILL)
        self._process.wait()

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def log(self) -> str:
        size = os.fstat(self._log.fileno()).st_size
        return os.pread(self._log.fileno(), size, 0).decode()  # leaves the place where the table writes

    @property
    def ready(self) -> bool:
        if self._process.poll() is not None:
            raise TimeoutError(f"the table ended: {self.log}")
        return "ready: " in self.log

    @property
    def memory(self) -> float:
        """Resident, MB (Linux)."""
        pages = int(Path(f"/proc/{self.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6

    @property
    def segments(self) -> set[Path]:
        """Of shared memory (Linux)."""
        words = Path(f"/proc/{self.pid}/maps").read_text().split()
        return {Path(word) for word in words if word.startswith("/dev/shm/")}


class Latches:
    """Hears what a table has latched.

    Args:
        node: that subscribes.
        on_at_rest: told what is heard.
    """

    def __init__(self, node: Node, on_at_rest: Callable[[bool], None] = bool) -> None:
        self._heard: set[str] = set()
        self._on_at_rest = on_at_rest
        for kind, topic in ((Bool, "at_rest"), (MarkerArray, "table_markers")):
            node.create_subscription(kind, topic, partial(self._on_message, topic), LATCHED)

    @property
    def complete(self) -> bool:
        return len(self._heard) == 2

    def clear(self) -> None:
        """For the next table."""
        self._heard.clear()

    def _on_message(self, topic: str, message: Any) -> None:
        self._heard.add(topic)
        if topic == "at_rest":
            self._on_at_rest(message.data)


class Client:
    """Shoots, and counts what arrives; messages stay serialised, so that it keeps up with the table.

    Args:
        everything: subscribe to every topic, so that the table has all its work.
    """

    def __init__(self, everything: bool = True) -> None:
        self.refusals: list[float] = []  # s, when they came
        self.delays: list[float] = []  # s, from a shot until it was accepted
        self.poses: list[float] = []  # s, when they came
        self.rests: list[bool] = []
        self.simulated = 0.0  # s, until the last answer
        self._time = 0.0  # s, simulated, of the last answer or reset
        self.listeners = 0  # tables that were ever found to listen to the cue
        self._last_poses = b""
        self._shot: tuple[int, int, float] | None = None
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node("client", context=self._context)
        self._executor = EventsExecutor(context=self._context)
        self._subscribe(String, "shot_result", self._on_answer)
        if everything:
            for kind, topic in ((String, "collisions"), (VelocityStamped, "balls/twists"), (MarkerArray, "markers")):
                self._subscribe(kind, topic, lambda _: None)
        self._subscribe(PoseArray, "balls/poses", self._on_poses)
        self.latches = Latches(self._node, self.rests.append)
        events = PublisherEventCallbacks(matched=self._on_listener)
        self._cue = self._node.create_publisher(WrenchStamped, "cue_shot", DEPTH, event_callbacks=events)
        self._reset = self._node.create_client(Trigger, "table/reset")
        self._executor.add_node(self._node)

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    @property
    def accepted(self) -> int:
        """Shots."""
        return len(self.delays)

    @property
    def answers(self) -> int:
        """To shots of whoever shot."""
        return len(self.refusals) + len(self.delays)

    @property
    def at_rest(self) -> bool:
        return bool(self.rests) and self.rests[-1]

    @property
    def shooting(self) -> bool:
        """Whether the last shot is not accepted yet, or its balls move."""
        if self._shot is None:
            return False
        accepted, rests, _ = self._shot
        return not (self.accepted > accepted and len(self.rests) > rests and self.at_rest)

    def connect(self) -> None:
        """Wait until the table hears this client and the client hears the table."""
        wait = self._reset.service_is_ready
        self.spin_until(lambda: self.poses and self.at_rest and self.latches.complete and self.listeners and wait())

    def spin(self) -> None:
        """Take what has come, or wait for a moment."""
        self._executor.spin_once(timeout_sec=0.01)

    def spin_until(self, done: Callable[[], object], timeout: float = START_TIMEOUT) -> None:
        deadline = time.monotonic() + timeout
        while not done():
            if time.monotonic() > deadline:
                raise TimeoutError(f"the table did not answer within {timeout:g} s")
            self.spin()

    def shoot(self, shot: WrenchStamped) -> None:
        self._shot = self.accepted, len(self.rests), time.monotonic()
        self._cue.publish(shot)

    def play(self, shot: WrenchStamped) -> None:
        """Shoot, and wait until every ball rests again."""
        self.shoot(shot)
        self.spin_until(lambda: not self.shooting, SHOT_TIMEOUT)

    def reset(self) -> bool:
        """Whether the table says that it went back to the start, and did."""
        future = self._reset.call_async(Trigger.Request())
        self.spin_until(future.done, SHOT_TIMEOUT)
        self._time = 0.0
        return future.result().success and self.error(bs.scenes.rack().positions) == 0.0

    def error(self, positions: NDArray[np.float64]) -> float:
        """The furthest that a ball is from where it should be, m, by poses that are sent after this call."""
        after = len(self.poses) + 2  # one may be on its way
        self.spin_until(lambda: len(self.poses) >= after, SHOT_TIMEOUT)
        poses = deserialize_message(self._last_poses, PoseArray).poses
        return float(np.abs([(pose.position.x, pose.position.y) for pose in poses] - positions).max())

    def wait_for_silence(self) -> None:
        """Until no more answers come."""
        count, began = self.answers, time.monotonic()
        while time.monotonic() < began + QUIET:
            self.spin()
            if self.answers > count:
                count, began = self.answers, time.monotonic()

    def _subscribe(self, kind: type, topic: str, callback: Callable[[bytes], None]) -> None:
        self._node.create_subscription(kind, topic, callback, DEPTH, raw=True)

    def _on_answer(self, data: bytes) -> None:
        now = time.monotonic()
        answer = json.loads(data[8:].rstrip(b"\0"))  # behind the head of the encoding and the length
        self.simulated += answer["time"] - self._time
        self._time = answer["time"]
        if answer["accepted"]:
            self.delays.append(now - self._shot[2])
        else:
            self.refusals.append(now)

    def _on_poses(self, data: bytes) -> None:
        self.poses.append(time.monotonic())
        self._last_poses = data

    def _on_listener(self, status: Any) -> None:
        self.listeners = status.total_count


class Watch:
    """Time and processor time since its start."""

    def __init__(self, table: Table) -> None:
        self._table = table
        self._began = self._readings()

    def loads(self) -> dict[str, float]:
        """Wall time, s, and shares of one core."""
        wall, table, client = (now - before for now, before in zip(self._readings(), self._began))
        return {"wall_s": wall, "table_load": table / wall, "client_load": client / wall}

    def _readings(self) -> tuple[float, ...]:
        return time.monotonic(), processor_time(self._table.pid), time.process_time()


def random_shot(random: np.random.Generator) -> WrenchStamped:
    """In any direction, with english."""
    size, angle = random.uniform(5.0, 150.0), random.uniform(0.0, 2.0 * math.pi)
    offset = random.uniform(-0.4, 0.4, 2) * bs.Physics().radius
    return wrench_from_shot((size * math.cos(angle), size * math.sin(angle), 0.0), offset)


def malformed_shots() -> list[WrenchStamped]:
    """Of every kind that no table takes."""
    along_x, centre = (80.0, 0.0, 0.0), (0.0, 0.0)
    wrong_frame, torque_along_force = wrench_from_shot(along_x, centre), wrench_from_shot(along_x, centre)
    wrong_frame.header.frame_id = "map"
    torque_along_force.wrench.torque.x = 50.0
    return [
        wrench_from_shot((math.nan, 0.0, 0.0), centre),
        wrench_from_shot((math.inf, 0.0, 0.0), centre),
        wrench_from_shot((1e300, 0.0, 0.0), centre),
        wrench_from_shot((80.0, 0.0, 10.0), centre),
        wrench_from_shot((0.0, 0.0, 0.0), centre),
        wrench_from_shot(along_x, (0.0, 0.6)),  # off the ball
        torque_along_force,
        wrong_frame,
    ]


def positions_after_break() -> NDArray[np.float64]:
    """(N, 2) m, where the engine's own run ends."""
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.strike(FORCE, OFFSET)
    simulation.run()
    return simulation.positions


def broken(**bounds: object) -> list[str]:
    """The names of those that do not hold."""
    return [name for name, holds in bounds.items() if not holds]


def steady_growth(hours: NDArray[np.float64], megabytes: NDArray[np.float64]) -> float | None:
    """MB/h: the median slope of straight lines, least squares, through equal pieces; None of too few shots."""
    if len(hours) < 2 * PIECES:
        return None
    pieces = np.array_split(np.arange(len(hours)), PIECES)
    return float(np.median([np.polyfit(hours[piece], megabytes[piece], 1)[0] for piece in pieces]))


def run_hours(given: argparse.Namespace) -> dict[str, Any]:
    """Random shots, each when the last one has come to rest, and a reset after every tenth."""
    random = np.random.default_rng(1)
    duration = 3600.0 * given.hours  # s, simulated
    memory: list[tuple[float, float]] = []  # h, MB
    shots = asked = resets = 0
    with Table(LONG_FACTOR) as table, Client() as client:
        client.connect()
        watch = Watch(table)
        deadline = time.monotonic() + 1.5 * duration / LONG_FACTOR + SHOT_TIMEOUT
        with tqdm(total=round(duration / 60.0), desc="hours", unit="min") as progress:
            while (simulated := client.simulated) < duration:
                if time.monotonic() > deadline:
                    raise TimeoutError(f"only {simulated:.0f} s were simulated")
                client.play(random_shot(random))
                shots += 1
                if shots % RESET_EVERY == 0:
                    asked += 1
                    resets += client.reset()
                memory.append((simulated / 3600.0, table.memory))
                progress.update(int(simulated / 60.0) - progress.n)
        loads = watch.loads()
        client.wait_for_silence()
    hours, megabytes = np.array(memory).T
    late = hours >= WARM_UP * hours[-1]
    growth = steady_growth(hours[late], megabytes[late])
    rise = megabytes[-1] - megabytes[late][0]
    judged = growth is not None and hours[-1] - hours[late][0] >= LEAST_TAIL
    return {
        "simulated_hours": simulated / 3600.0,
        **loads,
        "shots": shots,
        "answers": client.answers,
        "accepted": client.accepted,
        "resets_asked": asked,
        "resets": resets,
        "memory_mb": {"start": megabytes[0], "warm": megabytes[late][0], "end": megabytes[-1]},
        "growth_mb_per_hour": {"steady": growth, "overall": np.polyfit(hours[late], megabytes[late], 1)[0]},
        **evenness(client.poses, UPDATE_RATE),
        "broken": broken(
            answers=client.answers == shots,
            accepted=client.accepted == shots,
            resets=resets == asked,
            growth=not judged or growth < MOST_GROWTH,
            rise=rise < MOST_RISE,
        ),
    }


def flood(rate: float, duration: float, pid: int) -> dict[str, float]:
    """Publish malformed shots, as bytes, which costs a tenth of what message objects do.

    Args:
        rate: Hz.
        duration: s.
        pid: of the table.

    Returns:
        How many were sent, when (s), and the loads meanwhile (shares of one core).
    """
    rclpy.init()
    node = rclpy.create_node("flood")
    publisher = node.create_publisher(WrenchStamped, "cue_shot", DEPTH)
    deadline = time.monotonic() + START_TIMEOUT
    while publisher.get_subscription_count() == 0:
        if time.monotonic() > deadline:
            raise TimeoutError("no table listens")
        time.sleep(0.01)
    shots = [serialize_message(shot) for shot in malformed_shots()]
    began, load, own_load, sent = time.monotonic(), processor_time(pid), time.process_time(), 0
    while (elapsed := time.monotonic() - began) < duration:
        for _ in range(int(elapsed * rate) - sent):
            publisher.publish(shots[sent % len(shots)])
            sent += 1
        time.sleep(BURST)
    ended, load, own_load = time.monotonic(), processor_time(pid) - load, time.process_time() - own_load
    publisher.wait_for_all_acked(Duration(seconds=START_TIMEOUT))
    node.destroy_node()
    rclpy.shutdown()
    loads = {"table_load": load / (ended - began), "flood_load": own_load / (ended - began)}
    return {"sent": sent, "began": began, "ended": ended, **loads}


def run_flood(given: argparse.Namespace) -> dict[str, Any]:
    """Malformed shots from one process, good ones from this one whenever the table rests; at the end one is checked."""
    random = np.random.default_rng(2)
    good = 0
    with Table() as table, Client(everything=False) as client:

        def play_until(done: Callable[[], bool]) -> None:
            nonlocal good
            while not done():
                if not client.shooting:
                    client.shoot(random_shot(random))
                    good += 1
                client.spin()

        client.connect()
        calm, calm_ends = Watch(table), time.monotonic() + CALM
        play_until(lambda: time.monotonic() > calm_ends)
        calm_load = calm.loads()["table_load"]
        with ProcessPoolExecutor(1, SPAWN) as pool:
            flooding, watch = pool.submit(flood, given.rate, given.seconds, table.pid), Watch(table)
            play_until(flooding.done)
            flooded, client_load = flooding.result(), watch.loads()["client_load"]
        client.wait_for_silence()
        client.spin_until(lambda: client.at_rest, SHOT_TIMEOUT)
        delays = 1e3 * np.array(client.delays)
        refusals_logged = table.log.count("shot refused")
        client.reset()
        client.play(wrench_from_shot(FORCE, OFFSET))
        error = client.error(positions_after_break())
    seconds = flooded["ended"] - flooded["began"]
    ticks = evenness([at for at in client.poses if flooded["began"] <= at <= flooded["ended"]], UPDATE_RATE)
    refused, accepted = len(client.refusals), len(delays)
    refusal = (flooded["table_load"] - calm_load) * seconds / max(refused, 1)  # s of processor time
    return {
        "malformed_sent": flooded["sent"],
        "malformed_per_s": flooded["sent"] / seconds,
        "refused": refused,
        "last_refusal_after_flood_s": client.refusals[-1] - flooded["ended"] if refused else None,
        "good_sent": good,
        "good_accepted": accepted,
        "good_answer_ms": {"median": np.median(delays), "longest": delays.max()},
        **ticks,
        "position_error_m": error,
        "refusals_logged": refusals_logged,
        "refusal_ms": 1e3 * refusal,
        "table_load": flooded["table_load"],
        "flood_load": flooded["flood_load"],
        "client_load": client_load,
        "broken": broken(
            malformed_sent=flooded["sent"] >= LEAST_SENT * given.rate * given.seconds,
            refused=refused == flooded["sent"],
            good_accepted=accepted == good,
            mean_rate=ticks["mean_rate"] and abs(ticks["mean_rate"] / UPDATE_RATE - 1.0) <= MOST_RATE_ERROR,
            spacing_longest=bool(ticks["mean_rate"]) and ticks["spacing_longest"] <= MOST_SPACING,
            refusal_ms=refusal <= MOST_REFUSAL,
            position_error=error <= MOST_POSITION_ERROR,
            refusals_logged=0 < refusals_logged <= MOST_LINES * given.seconds + 1.0,
        ),
    }


def run_kill(given: argparse.Namespace) -> dict[str, Any]:
    """Kill the table while a client waits for the answer to a shot, or while balls move, and start it again."""
    start, end = bs.scenes.rack().positions, positions_after_break()
    shot = wrench_from_shot(FORCE, OFFSET)
    waits: list[float] = []  # s
    waits_of_new: list[float] = []
    at_start = played = 0
    segments: set[Path] = set()
    with Table() as table, Client() as client:
        client.connect()
        for number in tqdm(range(given.kills), desc="kill"):
            client.shoot(shot)
            if number % 2:
                client.spin_until(lambda: not client.at_rest, SHOT_TIMEOUT)
            segments |= table.segments
            table.kill()
            client.wait_for_silence()
            client.latches.clear()
            listeners = client.listeners
            table.start()
            client.spin_until(lambda: table.ready)
            ready = time.monotonic()
            client.spin_until(lambda: client.latches.complete)
            waits.append(time.monotonic() - ready)
            client.spin_until(lambda: client.listeners > listeners)  # noqa: B023
            at_start += client.at_rest and client.error(start) == 0.0
            waits_of_new.append(in_new_process(join))
            answers = client.answers
            client.play(shot)
            client.wait_for_silence()
            played += client.answers == answers + 1 and client.error(end) <= MOST_POSITION_ERROR
    left = {path for path in segments if path.exists()}
    for path in left:
        path.unlink()
    return {
        "kills": given.kills,
        "latched_after_s": waits,
        "latched_for_new_client_after_s": waits_of_new,
        "tables_at_start": at_start,
        "shots_played": played,
        "segments_left": len(left),
        "broken": broken(
            latched=max(waits) <= MOST_WAIT_OF_OLD,
            latched_for_new_client=max(waits_of_new) <= MOST_WAIT,
            tables_at_start=at_start == given.kills,
            shots_played=played == given.kills,
        ),
    }


def join() -> float:
    """s from the subscriptions of a new node until it has what is latched, or much too long."""
    rclpy.init()
    node = rclpy.create_node("late_joiner")
    executor = EventsExecutor()
    executor.add_node(node)
    began = time.monotonic()
    latches = Latches(node)
    while not latches.complete and time.monotonic() < began + START_TIMEOUT:
        executor.spin_once(timeout_sec=0.01)
    elapsed = time.monotonic() - began
    executor.shutdown()
    node.destroy_node()
    rclpy.shutdown()
    return elapsed


def in_new_process(function: Callable[[], Any]) -> Any:
    with ProcessPoolExecutor(1, SPAWN) as pool:
        return pool.submit(function).result()


def run_late(given: argparse.Namespace) -> dict[str, Any]:
    """New clients of a table that has long been there, one after the other, each in a process of its own."""
    with Table() as table:
        deadline = time.monotonic() + START_TIMEOUT
        while not table.ready and time.monotonic() < deadline:
            time.sleep(0.1)
        waits = [in_new_process(join) for _ in tqdm(range(given.joiners), desc="late")]
    return {"latched_after_s": waits, "broken": broken(latched=max(waits) <= MOST_WAIT)}


def watch_breaks(count: int) -> dict[str, Any]:
    """Breaks as one sees them who looks 30 times a second at queues of 10 messages."""
    watcher = Watcher()
    watcher.connect()
    forces = [(100.0, across, 0.0) for across in np.random.default_rng(3).uniform(-3.0, 3.0, count).tolist()]
    times, expected = [], 0
    for force in tqdm(forces, desc="queue"):
        watcher.reset()
        watcher.play(wrench_from_shot(force, OFFSET))
        times.append(watcher.verdicts[-1]["time"])
    watcher.look_until(lambda: watcher.events[-1]["kind"] == "rest")
    for force, time_of_shot in zip(forces, times, strict=True):
        simulation = bs.Simulation(bs.scenes.rack())
        simulation.advance(time_of_shot)
        simulation.strike(force, OFFSET)
        expected += len(simulation.run())
    gaps = [after - before for before, after in pairwise(watcher.sequence) if after != before + 1]
    watcher.close()
    return {
        "breaks": count,
        "events": len(watcher.events),
        "events_expected": expected,
        "messages": len(watcher.collisions),
        "gaps": len(gaps),
        "longest_look_s": watcher.longest,
    }


def run_queue(given: argparse.Namespace) -> dict[str, Any]:
    """A subscriber in a process of its own, with the habitual queue of 10, at a table that is ten times as fast."""
    with Table(BREAK_FACTOR) as table:
        deadline = time.monotonic() + START_TIMEOUT
        while not table.ready and time.monotonic() < deadline:
            time.sleep(0.1)
        figures = in_new_process(partial(watch_breaks, given.breaks))
    complete = figures["events"] == figures["events_expected"]
    return {**figures, "broken": broken(gaps=figures["gaps"] == 0, events=complete)}


PARTS: dict[str, Callable[[argparse.Namespace], dict[str, Any]]] = {
    "hours": run_hours,
    "flood": run_flood,
    "kill": run_kill,
    "late": run_late,
    "queue": run_queue,
}


def rounded(figures: Any) -> Any:
    """Four digits of every figure."""
    if isinstance(figures, dict):
        return {name: rounded(value) for name, value in figures.items()}
    if isinstance(figures, list):
        return [rounded(value) for value in figures]
    return float(f"{figures:.4g}") if isinstance(figures, float) else figures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="part", help=f"{', '.join(PARTS)}; all without one")
    parser.add_argument("--hours", type=float, default=3.0, help="of simulated shots (%(default)s)")
    parser.add_argument("--seconds", type=float, default=30.0, help="of the flood (%(default)s)")
    parser.add_argument("--rate", type=float, default=2000.0, help="of the flood, shots a second (%(default)s)")
    parser.add_argument("--kills", type=int, default=3, help="in a row (%(default)s)")
    parser.add_argument("--breaks", type=int, default=100, help="that the short queue sees (%(default)s)")
    parser.add_argument("--joiners", type=int, default=5, help="one after the other (%(default)s)")
    given = parser.parse_args()
    if unknown := set(given.parts) - set(PARTS):
        parser.error(f"no part {', '.join(unknown)}")
    isolate(os.environ)
    good = True
    with tempfile.TemporaryDirectory() as logs:
        os.environ["ROS_LOG_DIR"] = logs
        for part in given.parts or PARTS:
            try:
                figures = PARTS[part](given)
            except TimeoutError as error:
                figures = {"error": str(error), "broken": ["time"]}
            print(json.dumps({"part": part, **rounded(figures)}), flush=True)
            good = good and not figures["broken"]
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
