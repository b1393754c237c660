# SPDX-License-Identifier: Apache-2.0
"""What is on the table, to whoever listens."""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseArray, VelocityStamped
from numpy.typing import NDArray
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

from billiards_sim.engine.events import Event
from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros import markers, messages
from billiards_sim.ros.event_queue import EventQueue
from billiards_sim.ros.messages import Stamps
from billiards_sim.ros.parameters import Settings
from billiards_sim.ros.qos import EVENT_DEPTH, LATCHED, MOST_BALLS, STATE_DEPTH, TF_DEPTH
from billiards_sim.ros.transforms import BallFrames, tf_message_type

MOST_DRAWN = 200
"""Of the last events of a tick: more than eyes tell apart, and some ms of work where there are thousands."""

TWIST_PERIOD = 1.0
"""s between two twists of a ball that rests: whoever missed one knows it soon."""


class Look:
    """What there is to see of a simulation now; each part is made when it is first asked for."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation

    @cached_property
    def positions(self) -> NDArray[np.float64]:
        """(N, 2) m."""
        return self._simulation.positions

    @cached_property
    def velocities(self) -> NDArray[np.float64]:
        """(N, 2) m/s."""
        return self._simulation.velocities

    @cached_property
    def spins(self) -> NDArray[np.float64]:
        """(N, 3) rad/s."""
        return self._simulation.angular_velocities

    @cached_property
    def orientations(self) -> NDArray[np.float64] | None:
        """(N, 4) x y z w; None where they are not tracked."""
        return self._simulation.orientations if self._simulation.start_scene.track_orientation else None


class Forms:
    """What goes out of one scene under one set of settings: messages to be filled in, and what they need.

    Raises:
        ValueError: frames are asked for, and `tf_message_type` has none.
    """

    def __init__(self, settings: Settings) -> None:
        scene, radius = settings.scene, settings.scene.physics.radius
        self.scene = scene
        self.frame = frame = settings.frame_id
        bodies = [settings.frame_prefix + name for name in scene.names]
        self.states = messages.States(scene.names, radius, frame)
        self.poses = messages.Poses(len(scene), radius, frame)
        self.twists = [messages.BallTwist(body, frame) for body in bodies]
        # Balls that rest take turns: at one tick they would overrun a short queue.
        self.round = max(round(TWIST_PERIOD * settings.update_rate), 1)  # ticks
        self.turns = np.arange(len(scene)) * self.round // len(scene)
        self.markers_a_tick = min(settings.marker_rate / settings.update_rate, 1.0)
        self.balls = markers.BallMarkers(scene.names, radius, self.markers_a_tick * settings.update_rate, frame)
        tf_type = tf_message_type() if settings.publish_tf else None
        self.frames = BallFrames(tf_type, bodies, radius, frame) if settings.publish_tf else None
        # Only a table that is told to publishes on topics that all nodes share: one time for all has one source.
        self.shared: dict[str, tuple[Any, int]] = {}  # type and depth by topic
        if settings.publish_clock:
            self.shared["/clock"] = Clock, 1
        if settings.publish_tf:
            self.shared["/tf"] = tf_type, TF_DEPTH


class StatePublisher:
    """Publishes states, markers, events, rest, and where asked the clock and frames; to nobody, nothing.

    Args:
        node: whose topics they are.
        settings: to publish by.

    Raises:
        ValueError: as `prepare`.
    """

    def __init__(self, node: Node, settings: Settings) -> None:
        self._node = node
        self._states_publisher = node.create_publisher(MultiDOFJointState, "balls/states", STATE_DEPTH)
        self._poses_publisher = node.create_publisher(PoseArray, "balls/poses", STATE_DEPTH)
        twists_depth = STATE_DEPTH * max(len(settings.scene), MOST_BALLS)
        self._twists_publisher = node.create_publisher(VelocityStamped, "balls/twists", twists_depth)
        self._markers_publisher = node.create_publisher(MarkerArray, "markers", STATE_DEPTH)
        self._table_publisher = node.create_publisher(MarkerArray, "table_markers", LATCHED)
        self._collisions_publisher = node.create_publisher(String, "collisions", EVENT_DEPTH)
        self._at_rest_publisher = node.create_publisher(Bool, "at_rest", LATCHED)
        self._shared: dict[str, Publisher] = {}  # by topic
        self._clock = Clock()
        self._events = EventQueue()
        self._at_rest: bool | None = None
        self._ticks = 0
        self._markers_due = 0.0
        self.use(self.prepare(settings))

    def prepare(self, settings: Settings) -> Forms:
        """Try all that may fail of publishing by these settings; `use` then makes the change.

        Raises:
            ValueError: as `Forms`; or a publisher cannot be made.
        """
        forms = Forms(settings)
        for topic, (kind, depth) in forms.shared.items():
            if topic not in self._shared:
                self._shared[topic] = self._node.create_publisher(kind, topic, depth)
        return forms

    def use(self, forms: Forms) -> None:
        """Publish by these forms, and the balls of their scene, from now on."""
        self._forms = forms
        self._twists_due = np.ones(len(forms.scene), dtype=bool)
        for topic in self._shared.keys() - forms.shared.keys():
            self._node.destroy_publisher(self._shared.pop(topic))

    def table(self, stamp: int) -> None:
        """The cloth and the rails, once for all; stamps are in ns here and below."""
        radius = self._forms.scene.physics.radius
        self._table_publisher.publish(markers.table_markers(self._forms.scene.table, radius, stamp, self._forms.frame))

    def erase(self) -> None:
        """Take all markers away: the next scene may have fewer."""
        for publisher in (self._markers_publisher, self._table_publisher):
            publisher.publish(markers.erasing())

    def jump(self) -> None:
        """The balls are not where they were before."""
        self._twists_due = np.ones(len(self._forms.scene), dtype=bool)
        self._forms.balls.restart()

    def events(self, events: Sequence[Event], stamps: Stamps) -> None:
        """What happened: it goes out with this state and, where it is much, the next ones."""
        if len(events) == 0:
            return
        if _heard(self._markers_publisher):
            self._forms.balls.note(events[-MOST_DRAWN:])
        if _heard(self._collisions_publisher):
            self._events.add(events, stamps, self._forms.scene.physics.radius)

    @property
    def dropped_events(self) -> int:
        """Events that were too many to wait, since the start."""
        return self._events.dropped

    def state(self, simulation: Simulation, stamp: int) -> None:
        """Where the balls are and how they move."""
        self._publish_events()
        if "/clock" in self._forms.shared:
            messages.set_stamp(self._clock.clock, stamp)
            self._shared["/clock"].publish(self._clock)
        look = Look(simulation)
        if _heard(self._states_publisher):
            message = self._forms.states.at(look.positions, look.velocities, look.spins, stamp, look.orientations)
            self._states_publisher.publish(message)
        if _heard(self._poses_publisher):
            self._poses_publisher.publish(self._forms.poses.at(look.positions, stamp, look.orientations))
        frames = self._forms.frames
        if frames is not None and _heard(self._shared["/tf"]):
            positions, orientations = _floats(look)
            self._shared["/tf"].publish(frames.at(positions, stamp, orientations))
        if _heard(self._twists_publisher):
            self._publish_twists(simulation.at_rest, look, stamp)
        self.at_rest(simulation)
        self._ticks += 1

    def happenings(self, simulation: Simulation) -> None:
        """Events that wait, and rest, where no state is due."""
        self._publish_events()
        self.at_rest(simulation)

    def draw(self, simulation: Simulation, stamp: int) -> None:
        """Markers, if they are due at this tick."""
        self._markers_due += self._forms.markers_a_tick
        if self._markers_due < 1.0:
            return
        self._markers_due -= 1.0
        if _heard(self._markers_publisher):
            positions, orientations = _floats(Look(simulation))
            self._markers_publisher.publish(self._forms.balls.update(positions, stamp, orientations))
        else:
            self._forms.balls.restart()

    def at_rest(self, simulation: Simulation) -> None:
        """Whether all balls rest, where that is new. It comes after the events of the way there."""
        at_rest = simulation.at_rest and not len(self._events)
        if at_rest != self._at_rest:
            self._at_rest = at_rest
            self._at_rest_publisher.publish(Bool(data=at_rest))

    def _publish_events(self) -> None:
        if len(self._events):
            self._collisions_publisher.publish(String(data=json.dumps(self._events.take())))

    def _publish_twists(self, at_rest: bool, look: Look, stamp: int) -> None:
        # Every tick of a ball that moves, once when it has come to rest, and then when it is its turn.
        due = self._twists_due | (self._forms.turns == self._ticks % self._forms.round)
        if at_rest and not due.any():
            return
        motion = np.concatenate((look.velocities, look.spins[:, :2]), axis=1)
        moving = np.abs(motion).max(axis=1) > 0.0
        for index in np.flatnonzero(due | moving).tolist():
            message = self._forms.twists[index].at(look.velocities[index], look.spins[index], stamp)
            self._twists_publisher.publish(message)
        self._twists_due = moving


def _heard(publisher: Publisher) -> bool:
    return bool(publisher.get_subscription_count() > 0)


def _floats(look: Look) -> tuple[list[list[float]], list[list[float]] | None]:
    # Positions and orientations as Python floats: other kinds of floats are garbage in a message.
    return look.positions.tolist(), None if look.orientations is None else look.orientations.tolist()
