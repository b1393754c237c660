# SPDX-License-Identifier: Apache-2.0
"""What is on the table, to whoever listens."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, VelocityStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

from billiards_sim.engine.events import Event
from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros import markers, messages
from billiards_sim.ros.messages import Stamps
from billiards_sim.ros.parameters import Settings
from billiards_sim.ros.transforms import BallFrames, tf_message_type

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""A late subscriber gets the last message."""

EVENT_DEPTH = 1000
"""Messages kept for a reliable subscriber that falls behind; a break has a few hundred events."""

EVENTS_A_TICK = 200
"""Most events published at a tick: some 5 ms. A dense cluster can have thousands, which would hold up the ticks and
overrun the queues of subscribers; they wait for the next ticks."""

STATE_DEPTH = 10
"""Ticks kept for one."""

TF_DEPTH = 100
"""Of /tf, as tf2 has it."""

MOST_BALLS = 22
"""Of the games in use (snooker): twists are kept for as many, or for the first scene's if it has more."""


class StatePublisher:
    """Publishes poses, twists, markers, events, rest, and where asked the clock and frames; to nobody, nothing.

    Before the first state comes `use`.

    Args:
        node: whose topics they are.
        count: of balls at the start.
    """

    def __init__(self, node: Node, count: int) -> None:
        self._node = node
        self._poses_publisher = node.create_publisher(PoseArray, "balls/poses", STATE_DEPTH)
        twists_depth = STATE_DEPTH * max(count, MOST_BALLS)
        self._twists_publisher = node.create_publisher(VelocityStamped, "balls/twists", twists_depth)
        self._markers_publisher = node.create_publisher(MarkerArray, "markers", STATE_DEPTH)
        self._table_publisher = node.create_publisher(MarkerArray, "table_markers", LATCHED)
        self._collisions_publisher = node.create_publisher(String, "collisions", EVENT_DEPTH)
        self._at_rest_publisher = node.create_publisher(Bool, "at_rest", LATCHED)
        self._clock_publisher: Publisher | None = None
        self._frames_publisher: Publisher | None = None
        self._clock = Clock()
        self._waiting: deque[Iterator[tuple[Event, int]]] = deque()  # with their stamps, ns
        self._at_rest: bool | None = None
        self._twist_subscribers = 0
        self._markers_due = 0.0

    def use(self, settings: Settings) -> None:
        """Publish by these settings, and the balls of their scene, from now on.

        Raises:
            ValueError: frames are asked for, and `tf_message_type` has none.
        """
        scene, radius = settings.scene, settings.scene.physics.radius
        self._scene = scene
        self._poses = messages.Poses(len(scene), radius)
        self._twists = [messages.Twist(name) for name in scene.names]
        self._twists_due = [True] * len(scene)
        self._markers_a_tick = min(settings.marker_rate / settings.update_rate, 1.0)
        self._balls = markers.BallMarkers(scene.names, radius, self._markers_a_tick * settings.update_rate)
        tf_type = tf_message_type() if settings.publish_tf else None
        self._frames = BallFrames(tf_type, scene.names, radius) if settings.publish_tf else None
        # Only a table that is told to publishes on topics that all nodes share: one time for all has one source.
        self._clock_publisher = self._switched(self._clock_publisher, settings.publish_clock, Clock, "/clock", 1)
        self._frames_publisher = self._switched(self._frames_publisher, settings.publish_tf, tf_type, "/tf", TF_DEPTH)

    def table(self, stamp: int) -> None:
        """The cloth and the rails, once for all; stamps are in ns here and below."""
        self._table_publisher.publish(markers.table_markers(self._scene.table, self._scene.physics.radius, stamp))

    def erase(self) -> None:
        """Take all markers away: the next scene may have fewer."""
        for publisher in (self._markers_publisher, self._table_publisher):
            publisher.publish(markers.erasing())

    def jump(self) -> None:
        """The balls are not where they were before."""
        self._twists_due = [True] * len(self._scene)
        self._balls.restart()

    def events(self, events: Sequence[Event], stamps: Stamps) -> None:
        """What happened: one message an event, `EVENTS_A_TICK` of them with each state."""
        if len(events) == 0:
            return
        if _heard(self._markers_publisher):
            self._balls.flash(markers.contact_points(events))
        if _heard(self._collisions_publisher):
            self._waiting.append((event, stamps.at(event.time)) for event in events)

    def flush(self) -> None:
        """Let no event wait."""
        self._publish_events(math.inf)

    def state(self, simulation: Simulation, stamp: int) -> None:
        """Where the balls are and how they move."""
        self._publish_events(EVENTS_A_TICK)
        if self._clock_publisher is not None:
            messages.set_stamp(self._clock.clock, stamp)
            self._clock_publisher.publish(self._clock)
        if _heard(self._poses_publisher):
            message = self._poses.at(simulation.positions, stamp, self._orientations(simulation))
            self._poses_publisher.publish(message)
        frames, publisher = self._frames, self._frames_publisher
        if frames is not None and publisher is not None and _heard(publisher):
            positions, orientations = self._places(simulation)
            publisher.publish(frames.at(positions, stamp, orientations))
        self._publish_twists(simulation, stamp)
        self.at_rest(simulation)

    def draw(self, simulation: Simulation, stamp: int) -> None:
        """Markers, if they are due at this tick."""
        self._markers_due += self._markers_a_tick
        if self._markers_due < 1.0:
            return
        self._markers_due -= 1.0
        if _heard(self._markers_publisher):
            positions, orientations = self._places(simulation)
            self._markers_publisher.publish(self._balls.update(positions, stamp, orientations))
        else:
            self._balls.restart()

    def at_rest(self, simulation: Simulation) -> None:
        """Whether all balls rest, where that is new. It comes after the events of the way there."""
        at_rest = simulation.at_rest and not self._waiting
        if at_rest != self._at_rest:
            self._at_rest = at_rest
            self._at_rest_publisher.publish(Bool(data=at_rest))

    def _publish_events(self, most: float) -> None:
        radius = self._scene.physics.radius
        count = 0
        while self._waiting and count < most:
            found = next(self._waiting[0], None)
            if found is None:
                self._waiting.popleft()
                continue
            self._collisions_publisher.publish(String(data=messages.collision_json(*found, radius)))
            count += 1

    def _publish_twists(self, simulation: Simulation, stamp: int) -> None:
        # A ball that rests is published once, and once more when somebody new listens.
        subscribers = self._twists_publisher.get_subscription_count()
        if subscribers > self._twist_subscribers:
            self._twists_due = [True] * len(self._scene)
        self._twist_subscribers = subscribers
        if subscribers == 0 or (simulation.at_rest and not any(self._twists_due)):
            return
        velocities, spins = simulation.velocities, simulation.angular_velocities
        motion = np.concatenate((velocities, spins[:, :2]), axis=1)
        moving: list[bool] = (np.abs(motion).max(axis=1) > 0.0).tolist()
        for index, moves in enumerate(moving):
            if moves or self._twists_due[index]:
                self._twists_publisher.publish(self._twists[index].at(velocities[index], spins[index], stamp))
        self._twists_due = moving

    def _orientations(self, simulation: Simulation) -> NDArray[np.float64] | None:
        return simulation.orientations if self._scene.track_orientation else None

    def _places(self, simulation: Simulation) -> tuple[list[list[float]], list[list[float]] | None]:
        # Positions and orientations as Python floats: other kinds of floats are garbage in a message.
        turned = self._orientations(simulation)
        return simulation.positions.tolist(), None if turned is None else turned.tolist()

    def _switched(self, publisher: Publisher | None, on: bool, kind: Any, topic: str, depth: int) -> Publisher | None:
        if on and publisher is None:
            return self._node.create_publisher(kind, topic, depth)
        if not on and publisher is not None:
            self._node.destroy_publisher(publisher)
            return None
        return publisher


def _heard(publisher: Publisher) -> bool:
    return bool(publisher.get_subscription_count() > 0)
