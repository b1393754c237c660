"""The node `table`: subscriptions, timers and publishers around a `Simulation`."""

from __future__ import annotations

import argparse
import gc
import sys
import time
from collections.abc import Sequence

from geometry_msgs.msg import PoseArray, VelocityStamped, WrenchStamped
from rclpy.clock import Clock, ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from visualization_msgs.msg import MarkerArray

from billiards_sim.command_line import USAGE_ERROR, Parser
from billiards_sim.engine import scenes
from billiards_sim.engine.events import Event
from billiards_sim.engine.scene import Shot
from billiards_sim.engine.simulation import Simulation, StallError
from billiards_sim.ros import markers, messages, parameters
from billiards_sim.ros.process import STOPPED, StartError, own_arguments, ros, wake_on_signals
from billiards_sim.ros.wrench import shot_from_wrench

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A late subscriber gets the last message."""

EVENT_DEPTH = 1000
"""Messages kept for a reliable subscriber that falls behind; a break has a few hundred events."""

STATE_DEPTH = 10
"""Ticks kept for one."""


class TableNode(Node):
    """A billiards table to shoot on. It starts with `start`, once the engine is warm.

    Raises:
        ValueError: bad parameters, see `parameters.read_settings`.
    """

    def __init__(self) -> None:
        super().__init__("table", automatically_declare_parameters_from_overrides=True)
        self._settings = parameters.read_settings(parameters.take_overrides(self))
        parameters.declare(self, self._settings)
        for name in parameters.unknown(self):
            self.get_logger().warning(f"parameter {name!r} is not one of this node's")
        scene = self._settings.scene
        radius = scene.physics.radius
        self._scene = scene
        self._tick_time = self._settings.real_time_factor / self._settings.update_rate
        self._steady_clock = Clock(clock_type=ClockType.STEADY_TIME)

        self._poses = messages.new_poses(len(scene), radius)
        self._twists = [messages.new_twist(name) for name in scene.names]
        self._twists_due = [True] * len(scene)
        self._twist_subscribers = 0
        self._ball_markers = markers.new_ball_markers(scene.names, radius)

        self._poses_publisher = self.create_publisher(PoseArray, "balls/poses", STATE_DEPTH)
        self._twists_publisher = self.create_publisher(VelocityStamped, "balls/twists", STATE_DEPTH * len(scene))
        self._markers_publisher = self.create_publisher(MarkerArray, "markers", STATE_DEPTH)
        self._table_markers_publisher = self.create_publisher(MarkerArray, "table_markers", LATCHED)
        self._collisions_publisher = self.create_publisher(String, "collisions", EVENT_DEPTH)
        self._shot_result_publisher = self.create_publisher(String, "shot_result", EVENT_DEPTH)
        self._at_rest_publisher = self.create_publisher(Bool, "at_rest", LATCHED)

    @property
    def settings(self) -> parameters.Settings:
        """What the node was told."""
        return self._settings

    def start(self) -> None:
        """Put the scene on the table, start the clock, take shots."""
        self._simulation = Simulation(self._scene)
        self._stamps = messages.Stamps(self.get_clock().now().nanoseconds)
        self._table_markers_publisher.publish(
            markers.table_markers(self._scene.table, self._scene.physics.radius, self._stamps.at(0.0))
        )
        self._at_rest: bool | None = None
        self._publish_at_rest()
        self.create_service(Trigger, "~/reset", self._on_reset)
        self.create_subscription(WrenchStamped, "cue_shot", self._on_cue_shot, EVENT_DEPTH)
        self.create_timer(1.0 / self._settings.update_rate, self._on_tick, clock=self._steady_clock)
        if self._settings.marker_rate > 0.0:
            self.create_timer(1.0 / self._settings.marker_rate, self._publish_markers, clock=self._steady_clock)

    def _on_tick(self) -> None:
        try:
            self._publish_events(self._simulation.advance(self._tick_time))
        except StallError as error:
            self.get_logger().error(f"the table goes back to the start of its scene: {error}")
            self._publish_events(error.events)
            self._restart()
        self._publish_poses()
        self._publish_twists()
        self._publish_at_rest()

    def _on_cue_shot(self, message: WrenchStamped) -> None:
        try:
            shot = shot_from_wrench(message)
            self._check_at_rest()
            self._simulation.strike(shot.force, shot.offset, shot.ball)
        except ValueError as error:
            self.get_logger().warning(f"shot refused: {error}")
            self._publish_shot_result(False, str(error))
            return
        self.get_logger().info(f"shot accepted: {_describe(shot)}")
        self._publish_shot_result(True, "")
        self._publish_at_rest()

    def _check_at_rest(self) -> None:
        if self._simulation.at_rest:
            return
        speeds = [(vx * vx + vy * vy) ** 0.5 for vx, vy in self._simulation.velocities.tolist()]
        fastest = max(range(len(speeds)), key=speeds.__getitem__)
        raise ValueError(
            f"every ball must rest before a shot: ball {self._scene.names[fastest]!r} moves at "
            f"{speeds[fastest]:.6g} m/s"
        )

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._publish_events(self._simulation.advance(0.0))  # of a shot that no tick has followed yet
        self._restart()
        self._publish_at_rest()
        response.success = True
        response.message = f"{len(self._scene)} balls back at the start of scene {self._settings.scene_name}"
        self.get_logger().info(f"reset: {response.message}")
        return response

    def _restart(self) -> None:
        self._stamps.restart(self._simulation.time)
        self._simulation = Simulation(self._scene)
        self._twists_due = [True] * len(self._scene)

    def _publish_events(self, events: Sequence[Event]) -> None:
        if len(events) == 0 or self._collisions_publisher.get_subscription_count() == 0:
            return
        radius = self._scene.physics.radius
        for event in events:
            text = messages.collision_json(event, self._stamps.at(event.time), radius)
            self._collisions_publisher.publish(String(data=text))

    def _publish_poses(self) -> None:
        if self._poses_publisher.get_subscription_count() == 0:
            return
        messages.update_poses(self._poses, self._simulation.positions.tolist(), self._stamp())
        self._poses_publisher.publish(self._poses)

    def _publish_twists(self) -> None:
        # A ball that rests is published once, and once more when somebody new listens.
        subscribers = self._twists_publisher.get_subscription_count()
        if subscribers > self._twist_subscribers:
            self._twists_due = [True] * len(self._scene)
        self._twist_subscribers = subscribers
        if subscribers == 0 or (self._simulation.at_rest and not any(self._twists_due)):
            return
        stamp = self._stamp()
        velocities = self._simulation.velocities.tolist()
        spins = self._simulation.angular_velocities.tolist()
        for index, (velocity, spin) in enumerate(zip(velocities, spins)):
            moves = any(velocity) or any(spin[:2])
            if moves or self._twists_due[index]:
                messages.update_twist(self._twists[index], velocity, spin, stamp)
                self._twists_publisher.publish(self._twists[index])
                self._twists_due[index] = moves

    def _publish_markers(self) -> None:
        if self._markers_publisher.get_subscription_count() == 0:
            return
        markers.update_ball_markers(self._ball_markers, self._simulation.positions.tolist(), self._stamp())
        self._markers_publisher.publish(self._ball_markers)

    def _publish_at_rest(self) -> None:
        at_rest = self._simulation.at_rest
        if at_rest != self._at_rest:
            self._at_rest = at_rest
            self._at_rest_publisher.publish(Bool(data=at_rest))

    def _publish_shot_result(self, accepted: bool, reason: str) -> None:
        text = messages.shot_result_json(accepted, reason, self._simulation.time)
        self._shot_result_publisher.publish(String(data=text))

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
    try:
        parser.parse_args(own_arguments("table", arguments))
        with ros("table", arguments):
            _serve(TableNode())
    except (StartError, ValueError) as error:
        print(f"table: {' '.join(str(error).split())}", file=sys.stderr)
        return USAGE_ERROR
    return 0


def _serve(node: TableNode) -> None:
    _warm_up(node)
    wake_on_signals()
    executor = SingleThreadedExecutor()
    try:
        node.start()
        settings = node.settings
        node.get_logger().info(
            f"ready: scene {settings.scene_name}, {len(settings.scene)} balls, {settings.update_rate:g} Hz, "
            f"real-time factor {settings.real_time_factor:g}, markers {settings.marker_rate:g} Hz"
        )
        # What lives until the end need not be searched for garbage in the middle of a tick.
        gc.collect()
        gc.freeze()
        executor.add_node(node)
        executor.spin()
    except STOPPED:
        pass
    finally:
        executor.shutdown()


def _warm_up(node: TableNode) -> None:
    """Run a break, so that no later tick waits for the compiler."""
    node.get_logger().info("preparing the engine")
    began = time.monotonic()
    simulation = Simulation(scenes.eight_ball())
    simulation.strike((100.0, 1.0, 0.0), (0.005, 0.005))
    simulation.run()
    node.get_logger().info(f"engine ready after {time.monotonic() - began:.2f} s")


def _describe(shot: Shot) -> str:
    force = ", ".join(f"{value:g}" for value in shot.force)
    side, up = shot.offset
    return f"force ({force}) N, {side:g} m to the side, {up:g} m up"
