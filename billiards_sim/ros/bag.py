# SPDX-License-Identifier: Apache-2.0
"""What the node would publish during a run, as a bag: a directory that `ros2 bag` and its like read (rosbag2 with MCAP
storage). No node runs for it, and nothing goes over a network."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

import yaml
from geometry_msgs.msg import WrenchStamped
from mcap.writer import CompressionType, Writer
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.engine.simulation import Simulation
from billiards_sim.ros.answers import answer
from billiards_sim.ros.definitions import definition_of, type_name
from billiards_sim.ros.messages import Stamps
from billiards_sim.ros.parameters import NUMBERS, read_settings
from billiards_sim.ros.qos import ANSWER_DEPTH, SHOT_DEPTH, own
from billiards_sim.ros.state_publisher import StatePublisher
from billiards_sim.ros.transforms import TF_TYPE
from billiards_sim.ros.wrench import CUE_BALL, wrench_from_shot

RATE = NUMBERS["update_rate"]
"""Ticks a second: the default, and what it may be."""

FILE = "run_0.mcap"

VERSION = 9
"""Of metadata.yaml: that of ROS 2 Jazzy, which first names policies in words."""

FORMAT = "cdr"
"""In which ROS 2 serializes messages."""

FOREVER = {"sec": 9_223_372_036, "nsec": 854_775_807}
"""What the middleware makes of a deadline, a lifespan or a lease that is not set."""


class Bag:
    """A bag that is being written: makes publishers, as a node does, whose messages go into a file.

    Args:
        file: of MCAP, to be written to.

    Attributes:
        now: ns, when messages are published; it does not go back.
    """

    def __init__(self, file: IO[bytes]) -> None:
        self.now = 0
        self._writer = Writer(file, compression=CompressionType.ZSTD)
        self._writer.start("ros2")
        self._schemas: dict[str, int] = {}
        self._topics: list[Topic] = []

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: QoSProfile | int) -> Topic:
        """Of a message class, or of a type by its name; the topic's name is that of a node without a namespace.

        Raises:
            ValueError: the type has no definition.
        """
        defined = definition_of(msg_type if isinstance(msg_type, str) else type_name(msg_type))
        if defined.name not in self._schemas:
            self._schemas[defined.name] = self._writer.register_schema(defined.name, "ros2msg", defined.text.encode())
        name, profiles = "/" + topic.lstrip("/"), [_policies(own(qos_profile))]
        notes = {"offered_qos_profiles": _yaml(profiles), "topic_type_hash": defined.digest}
        channel = self._writer.register_channel(name, FORMAT, self._schemas[defined.name], notes)
        described = {
            "name": name,
            "type": defined.name,
            "serialization_format": FORMAT,
            "offered_qos_profiles": profiles,
            "type_description_hash": defined.digest,
        }
        self._topics.append(Topic(self, channel, described))
        return self._topics[-1]

    def destroy_publisher(self, publisher: Any) -> bool:
        """What is in a file stays there."""
        return False

    def write(self, channel: int, message: bytes) -> None:
        """A serialized message, now."""
        self._writer.add_message(channel, self.now, message, self.now)

    def finish(self) -> str:
        """End the file; returns what metadata.yaml says."""
        count = sum(topic.count for topic in self._topics)
        times = {"duration": {"nanoseconds": self.now}, "starting_time": {"nanoseconds_since_epoch": 0}}
        about = {
            "version": VERSION,
            "storage_identifier": "mcap",
            **times,
            "message_count": count,
            "topics_with_message_count": [
                {"topic_metadata": topic.described, "message_count": topic.count} for topic in self._topics
            ],
            "compression_format": "",
            "compression_mode": "",
            "relative_file_paths": [FILE],
            "files": [{"path": FILE, **times, "message_count": count}],
            "custom_data": {},
            "ros_distro": os.environ.get("ROS_DISTRO", ""),
        }
        self._writer.add_metadata("rosbag2", {"serialized_metadata": _yaml(about)})
        self._writer.finish()
        return _yaml({"rosbag2_bagfile_information": about})


class Topic:
    """A topic of a bag, as a publisher.

    Attributes:
        described: as in metadata.yaml.
        count: messages so far.
    """

    def __init__(self, bag: Bag, channel: int, described: dict[str, Any]) -> None:
        self.described = described
        self.count = 0
        self._bag = bag
        self._channel = channel

    def publish(self, message: Any) -> None:
        """Take a message down, or the bytes of a serialized one."""
        self._bag.write(self._channel, message if isinstance(message, bytes) else serialize_message(message))
        self.count += 1

    def get_subscription_count(self) -> int:
        """The file listens."""
        return 1


def last_tick(rest: float, rate: float) -> float:
    """The time, s, of the tick by which all that comes to rest at a time, s, has been told of and drawn.

    Args:
        rate: ticks a second, Hz.
    """
    marker_rate, _ = NUMBERS["marker_rate"]
    return (math.ceil(rest * rate) + math.ceil(rate / marker_rate)) / rate


def write_bag(directory: Path, scene: Scene, times: Sequence[float], rate: float) -> int:
    """Play a scene, with its shot if it has one, and write down what a node with default parameters would publish.

    Stamps count simulated time from 0. The state at the first time is that before the shot. The bits of the states and
    events are those of the engine, whatever the ticks.

    Args:
        directory: an empty one.
        times: of the ticks, s; the first is 0.
        rate: ticks a second, Hz.

    Returns:
        How many events were dropped: more than the node lets wait.

    Raises:
        ValueError: the rate is out of bounds; a ball's frame is the table's; a type has no definition.
        OSError: it cannot be written.
    """
    # A scene of no name, or else the one that has it would be played.
    settings = read_settings({"scene": "", "update_rate": rate, "publish_tf": True}, scene)
    with (directory / FILE).open("wb") as file:
        bag = Bag(file)
        publisher = StatePublisher(bag, settings, tf_type=lambda: TF_TYPE)
        simulation, stamps = Simulation(settings.scene), Stamps(bag.now)
        publisher.table(bag.now)
        for time in times:
            publisher.events(simulation.run(until=time), stamps)
            bag.now = stamps.at(time)
            publisher.state(simulation, simulation.at_rest, bag.now)
            publisher.draw(bag.now)
            if time == times[0] and scene.shot is not None:
                _shoot(bag, publisher, simulation, scene.shot, settings.frame_id)
        while publisher.waiting_events:
            publisher.happenings(simulation)
        about = bag.finish()
    (directory / "metadata.yaml").write_text(about, encoding="utf-8")
    return publisher.dropped_events


def _shoot(bag: Bag, publisher: StatePublisher, simulation: Simulation, shot: Shot, frame: str) -> None:
    # As somebody's message asks for it, which can mean one ball alone.
    simulation.strike(shot.force, shot.offset, shot.ball)
    if shot.ball == CUE_BALL:
        asked = wrench_from_shot(shot.force, shot.offset)
        asked.header.frame_id = frame
        bag.create_publisher(WrenchStamped, "cue_shot", SHOT_DEPTH).publish(asked)
        answer(bag.create_publisher(String, "shot_result", ANSWER_DEPTH), asked, simulation.time)
    publisher.at_rest(simulation)


def _policies(profile: QoSProfile) -> dict[str, Any]:
    return {
        "history": profile.history.short_key,
        "depth": profile.depth,
        "reliability": profile.reliability.short_key,
        "durability": profile.durability.short_key,
        "deadline": FOREVER,
        "lifespan": FOREVER,
        "liveliness": "automatic",
        "liveliness_lease_duration": FOREVER,
        "avoid_ros_namespace_conventions": False,
    }


class _Dumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True


def _yaml(content: Any) -> str:
    return yaml.dump(content, Dumper=_Dumper, sort_keys=False)
