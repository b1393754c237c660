# SPDX-License-Identifier: Apache-2.0
"""What is on the table, to whoever listens."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
from geometry_msgs.msg import PoseArray, VelocityStamped
from numpy.typing import NDArray
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

from billiards_sim.engine.events import Event
from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros import markers, messages
from billiards_sim.ros.event_queue import EventQueue
from billiards_sim.ros.look import Look
from billiards_sim.ros.messages import Stamps
from billiards_sim.ros.parameters import Settings
from billiards_sim.ros.qos import EVENT_DEPTH, LATCHED, MOST_BALLS, STATE_DEPTH, TF_DEPTH
from billiards_sim.ros.transforms import BallFrames, tf_message_type

MOST_DRAWN = 200
"""Of the last events of a tick: more than eyes tell apart, and some ms of work where there are thousands."""

TWIST_PERIOD = 1.0
"""s between two twists of a ball that rests: whoever missed one knows it soon."""


class Publisher(Protocol):
    """Of a topic: rclpy's, or what takes the messages down."""

    def publish(self, message: Any) -> None:
        """Send a message, or the bytes of a serialized one."""

    def get_subscription_count(self) -> int:
        """How many listen."""


class Publishers(Protocol):
    """Makes publishers, as a node does."""

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: QoSProfile | int) -> Publisher:
        """One whose profile is that, or the default one of that depth."""

    def destroy_publisher(self, publisher: Any) -> bool:
        """Whether it was there."""


class Forms:
    """What goes out of one scene under one set of settings: messages to be filled in, and what they need.

    Args:
        settings: to publish by.
        tf_type: gives the type of /tf, if frames are asked for.

    Raises:
        ValueError: `tf_type` has none.
    """

    def __init__(self, settings: Settings, tf_type: Callable[[], Any]) -> None:
        scene, radius = settings.scene, settings.scene.physics.radius
        self.scene = scene
        self.frame = frame = settings.frame_id
        self._bodies = [settings.frame_prefix + name for name in scene.names]
        self._has_frames = settings.publish_tf
        self.poses = messages.Poses(len(scene), radius, frame)
        self.twists = [messages.BallTwist(body, frame) for body in self._bodies]
        # Balls that rest take turns: at one tick they would overrun a short queue.
        self.round = max(round(TWIST_PERIOD * settings.update_rate), 1)  # ticks
        self.turns = np.arange(len(scene)) * self.round // len(scene)
        self.markers_a_tick = min(settings.marker_rate / settings.update_rate, 1.0)
        self.balls = markers.BallMarkers(scene.names, radius, self.markers_a_tick * settings.update_rate, frame)
        self._name(np.ones(len(scene), dtype=bool))
        # Only a table that is told to publishes on topics that all nodes share: one time for all has one source.
        self.shared: dict[str, tuple[Any, int]] = {}  # type and depth by topic
        if settings.publish_clock:
            self.shared["/clock"] = Clock, 1
        if settings.publish_tf:
            self.shared["/tf"] = tf_type(), TF_DEPTH

    def show(self, in_play: NDArray[np.bool_]) -> None:
        """Let the messages that name their balls have those in play, (N,)."""
        if not np.array_equal(in_play, self.in_play):
            self._name(in_play)

    def _name(self, in_play: NDArray[np.bool_]) -> None:
        radius = self.scene.physics.radius
        indices = np.flatnonzero(in_play)
        self.in_play = in_play
        self.rows: slice | NDArray[np.intp] = slice(None) if in_play.all() else indices
        self.states = messages.States([self.scene.names[index] for index in indices], radius, self.frame)
        bodies = [self._bodies[index] for index in indices]
        self.frames = BallFrames(bodies, radius, self.frame) if self._has_frames else None


class StatePublisher:
    """Publishes states, markers, events, rest, and where asked the clock and frames; to nobody, nothing.

    Args:
        node: whose topics they are.
        settings: to publish by.
        tf_type: gives the type of /tf where it is asked for, or raises a `ValueError`.

    Raises:
        ValueError: as `prepare`.
    """

    def __init__(self, node: Publishers, settings: Settings, tf_type: Callable[[], Any] = tf_message_type) -> None:
        self._node = node
        self._tf_type = tf_type
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
        self._turned: NDArray[np.float64] | None = None
        self._look: Look | None = None  # of the last tick
        self._stated: Look | None = None  # what `balls/states` shows
        self._posed: Look | None = None  # what `balls/poses` shows
        self.use(self.prepare(settings))

    def prepare(self, settings: Settings) -> Forms:
        """Try all that may fail of publishing by these settings; `use` then makes the change.

        Raises:
            ValueError: as `Forms`; or a publisher cannot be made.
        """
        forms = Forms(settings, self._tf_type)
        for topic, (kind, depth) in forms.shared.items():
            if topic not in self._shared:
                self._shared[topic] = self._node.create_publisher(kind, topic, depth)
        return forms

    def use(self, forms: Forms) -> None:
        """Publish by these forms, and the balls of their scene, from now on."""
        self._forms = forms
        self._look = None
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

    def jump(self, turned: NDArray[np.float64] | None = None) -> None:
        """The balls are not where they were before, or another simulation plays them.

        Args:
            turned: (N, 4) how they are turned now, from `orientations`; None for upright.
        """
        self._turned = turned
        self._look = None
        self._twists_due = np.ones(len(self._forms.scene), dtype=bool)
        self._forms.balls.restart()

    def events(self, events: Sequence[Event], stamps: Stamps) -> None:
        """What happened: it goes out with this state and, where it is much, the next ones."""
        if len(events) == 0:
            return
        self._look = None
        if _heard(self._markers_publisher):
            self._forms.balls.note(events[-MOST_DRAWN:])
        if _heard(self._collisions_publisher):
            self._events.add(events, stamps, self._forms.scene.physics.radius)

    @property
    def waiting_events(self) -> int:
        """Events that have not gone out yet."""
        return len(self._events)

    @property
    def dropped_events(self) -> int:
        """Events that were too many to wait, since the start."""
        return self._events.dropped

    def orientations(self, simulation: Simulation) -> NDArray[np.float64] | None:
        """(N, 4) how the balls are turned since the start of their scene; None where that is not tracked."""
        return Look(simulation, False, self._turned).orientations

    def state(self, simulation: Simulation, at_rest: bool, stamp: int) -> None:
        """Where the balls are and how they move; `at_rest` is the simulation's."""
        self._publish_events()
        if "/clock" in self._forms.shared:
            messages.set_stamp(self._clock.clock, stamp)
            self._shared["/clock"].publish(self._clock)
        if self._look is None or not (at_rest and self._look.still):
            self._look = Look(simulation, at_rest, self._turned)
        look = self._look
        self._forms.show(look.in_play)
        if _heard(self._states_publisher):
            if self._stated is not look:
                rows, turned = self._forms.rows, look.orientations
                moves = look.positions[rows], look.velocities[rows], look.spins[rows]
                self._forms.states.show(*moves, None if turned is None else turned[rows])
                self._stated = look
            self._states_publisher.publish(self._forms.states.stamped(stamp))
        if _heard(self._poses_publisher):
            if self._posed is not look:
                self._forms.poses.show(look.positions, look.in_play, look.orientations)
                self._posed = look
            self._poses_publisher.publish(self._forms.poses.stamped(stamp))
        frames = self._forms.frames
        if frames is not None and _heard(self._shared["/tf"]):
            rows, turned = self._forms.rows, look.orientations
            message = frames.at(look.positions[rows], stamp, None if turned is None else turned[rows])
            self._shared["/tf"].publish(message)
        if _heard(self._twists_publisher):
            self._publish_twists(look, stamp)
        self._publish_rest(at_rest)
        self._ticks += 1

    def happenings(self, simulation: Simulation) -> None:
        """Events that wait, and rest, where no state is due."""
        self._publish_events()
        self.at_rest(simulation)

    def draw(self, stamp: int) -> None:
        """Markers of the last state, if they are due at this tick."""
        self._markers_due += self._forms.markers_a_tick
        if self._markers_due < 1.0:
            return
        self._markers_due -= 1.0
        if _heard(self._markers_publisher) and self._look is not None:
            turned = self._look.orientations  # as Python floats: other kinds are garbage in a message
            orientations = None if turned is None else turned.tolist()
            positions, in_play = self._look.positions.tolist(), self._look.in_play.tolist()
            message = self._forms.balls.update(positions, stamp, orientations, in_play)
            self._markers_publisher.publish(message)
        else:
            self._forms.balls.restart()

    def at_rest(self, simulation: Simulation) -> None:
        """Whether all balls rest, where that is new. It comes after the events of the way there."""
        self._publish_rest(simulation.at_rest)

    def _publish_rest(self, at_rest: bool) -> None:
        told = at_rest and not len(self._events)
        if told != self._at_rest:
            self._at_rest = told
            self._at_rest_publisher.publish(Bool(data=told))

    def _publish_events(self) -> None:
        if len(self._events):
            self._collisions_publisher.publish(String(data=json.dumps(self._events.take())))

    def _publish_twists(self, look: Look, stamp: int) -> None:
        # Every tick of a ball that moves or spins ever less, once when it has come to rest, and then in its turn.
        due = look.in_play & (self._twists_due | (self._forms.turns == self._ticks % self._forms.round))
        if look.at_rest and not due.any():
            return
        changing = look.spins if self._forms.scene.physics.spin_friction > 0.0 else look.spins[:, :2]
        motion = np.concatenate((look.velocities, changing), axis=1)
        moving = np.abs(motion).max(axis=1) > 0.0
        for index in np.flatnonzero(due | moving).tolist():
            message = self._forms.twists[index].at(look.velocities[index], look.spins[index], stamp)
            self._twists_publisher.publish(message)
        self._twists_due = moving


def _heard(publisher: Publisher) -> bool:
    return bool(publisher.get_subscription_count() > 0)
