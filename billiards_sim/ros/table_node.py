# SPDX-License-Identifier: Apache-2.0
"""The node `table`: subscriptions, timers and publishers around a `Simulation`."""

from __future__ import annotations

import argparse
import dataclasses
import gc
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import wraps
from typing import Any, TypeVar, cast

import numpy as np
import rclpy
from geometry_msgs.msg import PoseArray, WrenchStamped
from numpy.typing import NDArray
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockChange, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from billiards_sim.command_line import Parser, Refusal, Stopped, one_line, run_to_end
from billiards_sim.engine import machine
from billiards_sim.engine.events import Event
from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.engine.simulation import Simulation, StallError
from billiards_sim.ros import messages, parameters, qos
from billiards_sim.ros.answers import answer, check_at_rest
from billiards_sim.ros.event_queue import MOST_WAITING
from billiards_sim.ros.followed_clock import FollowedClock
from billiards_sim.ros.inbox import Inbox
from billiards_sim.ros.metronome import Metronome
from billiards_sim.ros.placement import Places, named_balls, placed_balls
from billiards_sim.ros.previews import Previews, Question
from billiards_sim.ros.process import (
    announce_often,
    own_arguments,
    ros,
    stoppable,
)
from billiards_sim.ros.qos import ANSWER_DEPTH
from billiards_sim.ros.state_publisher import Forms, StatePublisher
from billiards_sim.ros.transforms import tf_message_type
from billiards_sim.ros.wrench import CUE_BALL, shot_from_wrench

LOST_TIME_TOLD = 0.1
"""s by which the stamps of a shot fall behind the clock before the log tells: what those who look up transforms
commonly allow for (`transform_tolerance`)."""

WORK_BUDGET = 0.02
"""s of the wall clock after which the engine gives way to a tick's messages, to requests and to signals. The first tick
of a break needs 0.1 ms of it, or 10 ms where the engine is interpreted."""

TIME_ROUNDING = 1e-9
"""s of simulated time by which a tick may end early without having given way: rounding up to table times of 1e6 s."""

SWITCH_INTERVAL = 5e-4
"""s that a thread keeps Python's interpreter at most while another waits for it: by so much a preview, which is played
on a thread of its own, holds up what a tick does. Python's own 5 ms would be five ticks at 1000 Hz."""

LOG_PERIOD = 1.0
"""s between two warnings of one kind in the log; every refusal is answered on its topic."""

LONGEST_WAIT = 1.0
"""s that the executor waits at most."""

Method = TypeVar("Method", bound=Callable[..., Any])


@dataclass(frozen=True)
class Change:
    """New parameters, checked but not yet in use.

    Attributes:
        settings: for what is on the table.
        after_reset: from the next reset on.
        forms: for what goes out, by `settings`.
    """

    settings: parameters.Settings
    after_reset: parameters.Settings
    forms: Forms


def between_ticks(method: Method) -> Method:
    """For what the executor calls: ticks are on a thread of their own, and each waits for the other."""

    @wraps(method)
    def exclusive(self: TableNode, *given: Any) -> Any:
        with self.lock:
            return method(self, *given)

    return cast(Method, exclusive)


class TableNode(Node):
    """A billiards table to shoot on. It starts with `start`, once the engine is warm; `metronome` lets its time go on.

    Attributes:
        lock: held by whoever uses what is on the table.
        metronome: beats a tick.
        previews: answers them.

    Raises:
        ValueError: bad parameters, see `parameters.read_settings`.
    """

    def __init__(self) -> None:
        super().__init__("table", automatically_declare_parameters_from_overrides=True)
        self._settings = parameters.read_settings(parameters.take_overrides(self))
        self._leave_out_what_is_not_installed()
        parameters.declare(self, self._settings)
        for name in parameters.unknown(self):
            self.get_logger().warning(f"parameter {name!r} is not one of this node's")
        self._after_reset = self._settings
        self._change: Change | None = None
        self._adopting = False
        self.lock = threading.RLock()  # a reset to a new scene sets parameters, whose callbacks take it again
        self.metronome = Metronome(self._on_beat, self.lock)
        self._paused = False
        self._next_logs: dict[str, float] = {}  # s, of the steady clock, by what is told
        self._lost_before = 0.0  # s, `metronome.lost` at the last tick
        self._lost_time = 0.0  # s that stamps are behind the clock, and that the log has not told of
        self._lags = False  # whether stamps count simulated time, which may fall behind the clock
        self._stamps_ended = False
        self._simulation = Simulation(self._scene)
        self._stamps = messages.Stamps(self._now())
        self._jumps: Any = None  # rclpy forgets the callback for jumps of the clock with it
        self._followed = FollowedClock()
        self._dropped_events = 0  # of `_publisher.dropped_events`, likewise

        self._publisher = StatePublisher(self, self._settings)
        self._shot_result_publisher = self.create_publisher(String, "shot_result", ANSWER_DEPTH)
        self.previews = Previews(self, self._question)
        self._placement_result_publisher = self.create_publisher(String, "placement_result", ANSWER_DEPTH)

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: QoSProfile | int, **options: Any) -> Publisher:
        """As every node's, but that `qos_overrides.*` is heard."""
        with qos.overriding(self, topic, "publisher") as policies:
            return super().create_publisher(
                msg_type, topic, qos.own(qos_profile), qos_overriding_options=policies, **options
            )

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], None], qos_profile: QoSProfile | int, **options: Any
    ) -> Subscription:
        """As every node's, but that `qos_overrides.*` is heard."""
        with qos.overriding(self, topic, "subscription") as policies:
            return super().create_subscription(
                msg_type, topic, callback, qos.own(qos_profile), qos_overriding_options=policies, **options
            )

    @property
    def settings(self) -> parameters.Settings:
        """What the node was told."""
        return self._settings

    @property
    def simulation(self) -> Simulation:
        """What is on the table."""
        return self._simulation

    @property
    def _scene(self) -> Scene:
        return self._settings.scene

    def start(self) -> None:
        """Show the table, let stamps begin, take shots."""
        self._stamps = messages.Stamps(self._now())
        self.metronome.set_rate(self._settings.update_rate)
        self._publisher.table(self._stamp())
        self._publisher.at_rest(self._simulation)
        threshold = JumpThreshold(
            min_forward=Duration(nanoseconds=1), min_backward=Duration(nanoseconds=-1), on_clock_change=True
        )
        self._jumps = self.get_clock().create_jump_callback(threshold, post_callback=self._on_clock)
        if self._follows_clock:
            self.get_logger().info("use_sim_time is true: time goes on with /clock")
        self.add_pre_set_parameters_callback(parameters.as_declared)
        self.add_on_set_parameters_callback(self._on_set_parameters)
        self.add_post_set_parameters_callback(self._on_parameters_set)
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_service(SetBool, "~/pause", self._on_pause)
        self.create_service(Trigger, "~/step", self._on_step)
        Inbox(self, WrenchStamped, "cue_shot", self._on_cue_shot)
        Inbox(self, WrenchStamped, "cue_shot/preview", self._on_preview)
        Inbox(self, PoseArray, "place_balls", self._on_place_balls)
        Inbox(self, MultiDOFJointState, "set_balls", self._on_set_balls)
        for name in qos.unknown_overrides(self):
            self.get_logger().warning(f"parameter {name!r} names no topic or policy of this node")

    def advance(self, duration: float) -> None:
        """Go on by `duration` s of simulated time, or by as much as `WORK_BUDGET` allows, and publish the state."""
        rested, stamp, until = self._simulation.at_rest, self._stamp(), self._simulation.time + duration
        try:
            events = self._simulation.advance(duration, budget=WORK_BUDGET)
        except StallError as error:
            self.get_logger().error(f"the table goes back to the start of its scene: {error}")
            self._publisher.events(error.events, self._stamps)
            self._restart()
            at_rest = self._simulation.at_rest
        else:
            self._publisher.events(events, self._stamps)
            if len(events):
                self._log_scratch(events)
            missing = until - self._simulation.time
            self._lost_time += missing if missing > TIME_ROUNDING else 0.0
            at_rest = self._simulation.at_rest if len(events) or not rested else True
        self._lags = self._settings.publish_clock or not at_rest
        if at_rest and not self._settings.publish_clock:
            # Simulated time that went on at rest does not count. No stamp goes back or, lest tf complain, comes twice.
            earliest = 1 + (stamp if rested else self._stamp())
            due = self._now() - round(self.metronome.late() * messages.NANOSECONDS)
            self._stamps = messages.Stamps(max(due, earliest), self._simulation.time)
        self._publisher.state(self._simulation, at_rest, self._stamp())

    def reset(self) -> str:
        """Back to the start of the scene, or to a new one; returns what is now on the table.

        Raises:
            ValueError: the new scene cannot be put on the table. Nothing changes then.
        """
        # Of a shot that no tick has followed yet:
        self._publisher.events(self._simulation.advance(0.0, budget=WORK_BUDGET), self._stamps)
        if self._after_reset is not self._settings:
            self._adopt_scene(self._after_reset)
        self._restart()
        self._publisher.at_rest(self._simulation)
        return f"{len(self._scene)} balls back at the start of scene {self._settings.scene_name}"

    @property
    def _tick_time(self) -> float:
        return self._settings.real_time_factor / self._settings.update_rate  # s, simulated

    @property
    def _period(self) -> int:
        return round(messages.NANOSECONDS / self._settings.update_rate)  # ns

    @property
    def _follows_clock(self) -> bool:
        # A table that publishes the clock makes the time that others, and with use_sim_time it too, read.
        return bool(self.get_clock().ros_time_is_active) and not self._settings.publish_clock

    @between_ticks
    def _on_clock(self, jump: TimeJump) -> None:
        # At every reading of a clock that is followed. What raises here is lost, so the metronome does the work.
        if jump.clock_change == ClockChange.ROS_TIME_DEACTIVATED:
            self._stamps = messages.Stamps(self._now(), self._simulation.time)
        if self._follows_clock and self._followed.due(self._now(), self._period):
            self.metronome.ring()

    def _on_beat(self) -> None:
        if not self._follows_clock:
            self._count_lost_beats()
            self._on_tick(self._tick_time)
        elif self._followed.due(now := self._now(), self._period):
            self._tick_by_clock(now)
        else:
            self._publisher.happenings(self._simulation)

    def _tick_by_clock(self, now: int) -> None:
        elapsed = self._followed.tick(now)
        if elapsed is not None and elapsed < 0:
            back, to = -elapsed / messages.NANOSECONDS, now / messages.NANOSECONDS
            _, what = self._try_reset()
            self.get_logger().warning(f"the clock went back by {back:.9g} s, to {to:.9g} s: {what}")
            elapsed = None
        if elapsed is None:
            self._stamps = messages.Stamps(now - 1, self._simulation.time)  # this tick has the reading itself
        self._on_tick((elapsed or 0) / messages.NANOSECONDS * self._settings.real_time_factor)

    def _on_tick(self, duration: float) -> None:
        self.advance(0.0 if self._paused else duration)
        self._publisher.draw(self._stamp())
        self._log_lost_time()
        self._log_end_of_stamps()
        self._log_dropped_events()

    @between_ticks
    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        self._paused = request.data
        response.success = True
        response.message = f"{'paused' if self._paused else 'running'} at {self._simulation.time:.9g} s"
        self.get_logger().info(response.message)
        return response

    @between_ticks
    def _on_step(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success = self._paused
        if self._paused:
            self.advance(self._tick_time)
            response.message = f"stepped to {self._simulation.time:.9g} s"
        else:
            response.message = "the table is not paused: call pause with true first"
        return response

    @between_ticks
    def _on_cue_shot(self, message: WrenchStamped) -> None:
        try:
            shot = shot_from_wrench(message, self._settings.frame_id)
            check_at_rest(self._simulation, "a shot")
            self._simulation.strike(shot.force, shot.offset, shot.ball)
        except ValueError as error:
            self._log_refusal("shot", error)
            answer(self._shot_result_publisher, message, self._simulation.time, one_line(error))
            return
        self.get_logger().info(f"shot accepted: {_describe(shot)}")
        answer(self._shot_result_publisher, message, self._simulation.time)
        self._publisher.at_rest(self._simulation)

    @between_ticks
    def _on_preview(self, message: WrenchStamped) -> None:
        self.previews.ask(message, self._simulation.time)

    @between_ticks
    def _question(self) -> Question:
        return Question(self._simulation.copy(), self._stamps, self._settings.frame_id, self.previews.erased)

    def _on_place_balls(self, message: PoseArray) -> None:
        self._on_placement(message, placed_balls)

    def _on_set_balls(self, message: MultiDOFJointState) -> None:
        self._on_placement(message, named_balls)

    def _on_placement(
        self,
        message: PoseArray | MultiDOFJointState,
        find: Callable[[Any, Scene, float, str], Places],
    ) -> None:
        try:
            settings = self._settings_at_rest("a placement")
            # Resting balls stay where they are, so time may go on while their new places are looked for.
            places = find(message, settings.scene, settings.placement_tolerance, settings.frame_id)
            self._place(settings, places)
        except ValueError as error:
            self._log_refusal("placement", error)
            answer(self._placement_result_publisher, message, self._simulation.time, one_line(error))
            return
        self.get_logger().info(f"placement accepted: {len(places)} of {len(settings.scene)} balls")
        answer(self._placement_result_publisher, message, self._simulation.time)

    @between_ticks
    def _settings_at_rest(self, before: str) -> parameters.Settings:
        check_at_rest(self._simulation, before)
        return self._settings

    @between_ticks
    def _place(self, settings: parameters.Settings, places: Places) -> None:
        if self._settings is not settings:
            raise ValueError("the table was reset meanwhile")
        scene, positions = settings.scene, self._simulation.positions
        in_play = np.array([name in places for name in scene.names])
        positions[in_play] = [places[name] for name in scene.names if name in places] or np.empty((0, 2))
        self._put(self._resting(scene, positions, np.zeros((len(scene), 3)), in_play))

    @between_ticks
    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._try_reset()
        if response.success:
            self.get_logger().info(f"reset: {response.message}")
        return response

    def _try_reset(self) -> tuple[bool, str]:
        try:
            return True, self.reset()
        except ValueError as error:
            self._log_refusal("reset", error)
            return False, one_line(error)

    def _restart(self) -> None:
        self._stamps = self._stamps.restarted(self._simulation.time)
        self._simulation = Simulation(self._scene)
        self._publisher.jump()

    def _adopt_scene(self, settings: parameters.Settings) -> None:
        # The new scene may have other balls, and brings a table and physics of its own. First what may fail:
        Simulation(settings.scene)
        forms = self._publisher.prepare(settings)
        self._show(settings.values())
        self._publisher.erase()
        self.previews.erase()
        self._settings = settings
        self._publisher.use(forms)
        self._publisher.table(self._stamp())

    def _show(self, values: Mapping[str, Any]) -> None:
        shown = {name: self.get_parameter(name).value for name in values}
        changed = [Parameter(name, value=value) for name, value in values.items() if value != shown[name]]
        if not changed:  # rclpy refuses an empty list
            return
        with self._adopting_parameters():
            result = self.set_parameters_atomically(changed)
        if not result.successful:
            raise ValueError(result.reason)

    @contextmanager
    def _adopting_parameters(self) -> Iterator[None]:
        self._adopting = True
        try:
            yield
        finally:
            self._adopting = False

    @between_ticks
    def _on_set_parameters(self, given: list[Parameter]) -> SetParametersResult:
        self._change = None
        if self._adopting:
            return SetParametersResult(successful=True)
        shown = {name: self.get_parameter(name).value for name in self._settings.values()}
        changes = parameters.changes(given, shown)
        try:
            self._change = self._prepare(changes) if changes else None
        except ValueError as error:
            self._log_refusal("parameters", error)
            return SetParametersResult(successful=False, reason=one_line(error))
        return SetParametersResult(successful=True)

    def _prepare(self, changes: Mapping[str, Any]) -> Change:
        now = {name: value for name, value in changes.items() if name != "scene"}
        parameters.check_changeable(self._settings, now)
        check_at_rest(self._simulation, f"a change of {', '.join(changes)}")
        settings = parameters.change_settings(self._settings, now) if now else self._settings
        same = "scene" not in changes and self._after_reset is self._settings
        after_reset = settings if same else parameters.change_settings(self._after_reset, changes)
        self._relaid(settings.scene)  # only to see that it can be: time goes on until the change comes into force
        return Change(settings, after_reset, self._publisher.prepare(settings))

    def _put(self, simulation: Simulation) -> None:
        # The balls may lie elsewhere then, but are turned as they are.
        if simulation is not self._simulation:
            turned = self._publisher.orientations(self._simulation)
            self._simulation = simulation
            self._publisher.jump(turned)

    def _relaid(self, scene: Scene) -> Simulation:
        # The balls where they lie, under the new physics.
        simulation, old = self._simulation, self._scene
        if (scene.physics, scene.track_orientation) == (old.physics, old.track_orientation):
            return simulation
        return self._resting(scene, simulation.positions, simulation.angular_velocities, simulation.in_play)

    def _resting(
        self,
        scene: Scene,
        positions: NDArray[np.float64],
        spins: NDArray[np.float64],
        in_play: NDArray[np.bool_],
    ) -> Simulation:
        # The scene's balls at rest at these positions, at the present time.
        still = np.zeros_like(positions)
        laid = dataclasses.replace(
            scene, positions=positions, velocities=still, angular_velocities=spins, in_play=in_play, shot=None
        )
        return Simulation(laid, self._simulation.time)

    @between_ticks
    def _on_parameters_set(self, _: list[Parameter]) -> None:
        if self._change is None:
            return
        change, self._change = self._change, None
        self._put(self._relaid(change.settings.scene))
        moved = change.settings.frame_id != self._settings.frame_id
        self._settings, self._after_reset = change.settings, change.after_reset
        self._show(parameters.followers(self._settings))
        self.metronome.set_rate(self._settings.update_rate)
        self._publisher.use(change.forms)
        if moved:
            self._publisher.table(self._stamp())

    def _log_scratch(self, events: Sequence[Event]) -> None:
        names = self._scene.names
        if CUE_BALL not in names or self._simulation.in_play[names.index(CUE_BALL)]:
            return  # as nearly always: events are not built to be looked at
        for event in events:
            if event.kind == "pocketed" and event.balls == (CUE_BALL,):
                self.get_logger().warning(f"scratch: ball {CUE_BALL} fell into pocket {event.pocket}")

    def _leave_out_what_is_not_installed(self) -> None:
        if self._settings.publish_tf:
            try:
                tf_message_type()
            except ValueError as error:
                self.get_logger().error(f"{error}; the table goes on without it")
                self._settings = parameters.change_settings(self._settings, {"publish_tf": False})

    def _log_refusal(self, what: str, error: ValueError) -> None:
        if self._may_log(what):
            self.get_logger().warning(f"{what} refused: {one_line(error)}")

    def _count_lost_beats(self) -> None:
        lost, self._lost_before = self.metronome.lost - self._lost_before, self.metronome.lost
        self._lost_time += lost

    def _log_lost_time(self) -> None:
        if not self._lags:
            self._lost_time = 0.0
            return
        if self._lost_time >= LOST_TIME_TOLD and self._may_log("lost time"):
            self.get_logger().warning(
                f"the table does not keep up: stamps fall {self._lost_time:.3g} s behind the clock"
            )
            self._lost_time = 0.0

    def _log_end_of_stamps(self) -> None:
        ended = self._stamp() == messages.LAST_STAMP
        if ended and not self._stamps_ended:
            sec, nanosec = divmod(messages.LAST_STAMP, messages.NANOSECONDS)
            self.get_logger().error(f"stamps stay at {sec}.{nanosec} s, the last that a message can have")
        self._stamps_ended = ended

    def _log_dropped_events(self) -> None:
        dropped = self._publisher.dropped_events - self._dropped_events
        if dropped > 0 and self._may_log("dropped events"):
            self._dropped_events += dropped
            self.get_logger().warning(
                f"{dropped} events dropped: more than {MOST_WAITING} waited to go out on collisions, whose sequence "
                "skips them"
            )

    def _may_log(self, what: str) -> bool:
        # rclpy's own throttling looks for its caller every time, which takes longer than all else in a refusal.
        now = time.monotonic()
        if now < self._next_logs.get(what, now):
            return False
        self._next_logs[what] = now + LOG_PERIOD
        return True

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _stamp(self) -> int:
        return self._stamps.at(self._simulation.time)


def main(arguments: list[str]) -> int:
    """Run the node until it is told to stop; returns the exit code."""
    parser = Parser(
        prog="table",
        description="A billiards table as a ROS 2 node: shoot on cue_shot, see what every ball does.",
        epilog=f"parameters (default, bounds):\n{parameters.help_lines()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        usage="table [-h] [--ros-args -p NAME:=VALUE ... --params-file FILE ... -r __ns:=/NAMESPACE ...]",
    )

    def play() -> int:
        parser.parse_args(own_arguments("table", arguments))
        announce_often(os.environ)
        with suppress(Stopped), ros("table", arguments):
            _serve(_new_node())
        return 0

    return run_to_end("table", play)


def _new_node() -> TableNode:
    try:
        return TableNode()
    except ValueError as error:
        raise Refusal(str(error)) from None


def _serve(node: TableNode) -> None:
    executor = SingleThreadedExecutor()
    try:
        with stoppable():
            _start(node)
            settings = node.settings
            node.get_logger().info(
                f"ready: scene {settings.scene_name}, {len(settings.scene)} balls, {settings.update_rate:g} Hz, "
                f"real-time factor {settings.real_time_factor:g}, markers {settings.marker_rate:g} Hz"
            )
            # What lives until the end need not be searched for garbage in the middle of a tick.
            gc.collect()
            gc.freeze()
            # A signal that comes just before the executor begins to wait is heard when it wakes.
            node.create_timer(LONGEST_WAIT, lambda: None, clock=Clock(clock_type=ClockType.STEADY_TIME))
            executor.add_node(node)
            sys.setswitchinterval(SWITCH_INTERVAL)
            node.metronome.start(fail=lambda error: executor.create_task(_raise, "a tick failed", error))
            node.previews.start(fail=lambda error: executor.create_task(_raise, "a preview failed", error))
            _spin(node, executor)
    finally:
        node.metronome.stop()
        node.previews.stop()
        executor.shutdown()


def _start(node: TableNode) -> None:
    try:
        machine.seek()  # or the first tick would
        node.start()
    except ValueError as error:
        raise Refusal(str(error)) from None


def _spin(node: TableNode, executor: SingleThreadedExecutor) -> None:
    while True:
        try:
            executor.spin()
            return
        except ValueError as error:
            # rclpy's own, of a service request with figures that mean nothing: it is left without an answer.
            if not rclpy.ok():
                raise
            node.get_logger().error(f"a request cannot be served: {error}")


def _raise(what: str, error: Exception) -> None:
    raise RuntimeError(what) from error


def _describe(shot: Shot) -> str:
    force = ", ".join(f"{value:g}" for value in shot.force)
    side, up = shot.offset
    return f"force ({force}) N, {side:g} m to the side, {up:g} m up"
