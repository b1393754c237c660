# SPDX-License-Identifier: Apache-2.0
"""Bags: read back by an independent reader, whose types are made of the bag's own definitions alone, and compared with
the engine, message by message."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import WrenchStamped
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message, serialize_message

import billiards_sim as bs
from billiards_sim.ros.markers import table_markers
from billiards_sim.ros.messages import collision_record
from billiards_sim.ros.state_publisher import StatePublisher
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.transforms import TF_TYPE
from billiards_sim.study import simulate

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

from mcap.reader import make_reader  # noqa: E402
from rosbags.interfaces import QosDurability, QosHistory, QosReliability  # noqa: E402
from rosbags.rosbag2 import Reader  # noqa: E402
from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: E402

from billiards_sim.ros import bag as bag_module  # noqa: E402
from billiards_sim.ros.bag import FILE  # noqa: E402

SCENE = """
table: pool_9ft
physics: pool
track_orientation: true
balls:
  - {name: cue, position: [1.399, 0.362]}
  - {name: "9", position: [1.397, 0.762]}
  - {name: black ball, position: [1.697, 0.862]}
  - {name: "2", in_play: false}
"""
"""Straight at a side pocket."""

SHOT = ("--speed", "3", "--angle", "1.5677963rad", "--up", "-0.3")


def nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def vector(one: Any) -> tuple[float, ...]:
    return tuple(float(getattr(one, axis)) for axis in ("x", "y", "z", "w") if hasattr(one, axis))


@dataclass
class Content:
    """Of a bag, by topic: (time in ns, message)."""

    path: Path

    def __post_init__(self) -> None:
        with Reader(self.path) as reader:
            self.connections = {one.topic: one for one in reader.connections}
            self.span = reader.start_time, reader.duration
            self.types = get_typestore(Stores.EMPTY)
            for one in self.connections.values():
                self.types.register(get_types_from_msg(one.msgdef.data, one.msgtype))
            self.topics: dict[str, list[tuple[int, Any]]] = {topic: [] for topic in self.connections}
            for one, time, raw in reader.messages():
                self.topics[one.topic].append((time, self.types.deserialize_cdr(raw, one.msgtype)))

    @cached_property
    def events(self) -> list[dict[str, Any]]:
        return [event for _, message in self.topics["/collisions"] for event in json.loads(message.data)["events"]]


@dataclass
class Played:
    """A run of `simulate`: its bag, and the same run of the engine, which goes on to the end of the bag."""

    bag: Content
    run: bs.Run
    times: NDArray[np.float64]
    """(T,) s, of the ticks."""

    def at(self, values: NDArray[np.float64], start: NDArray[np.float64]) -> NDArray[np.float64]:
        # The first tick is before the shot.
        return np.concatenate((start[np.newaxis], values[1:]))

    @cached_property
    def in_play(self) -> NDArray[np.bool_]:
        """(T, N)."""
        there = np.tile(self.run.scene.in_play, (len(self.times), 1))
        for event in self.run.events:
            if event.kind == "pocketed":
                there[self.times >= event.time, self.run.scene.names.index(event.balls[0])] = False
        return there

    @cached_property
    def positions(self) -> NDArray[np.float64]:
        return self.at(self.run.positions(self.times), self.run.scene.positions)

    @cached_property
    def velocities(self) -> NDArray[np.float64]:
        return self.at(self.run.velocities(self.times), self.run.scene.velocities)

    @cached_property
    def spins(self) -> NDArray[np.float64]:
        return self.at(self.run.angular_velocities(self.times), self.run.scene.angular_velocities)

    @cached_property
    def orientations(self) -> NDArray[np.float64]:
        return self.at(self.run.orientations(self.times), np.tile([0.0, 0.0, 0.0, 1.0], (len(self.run.scene), 1)))

    def tick(self, time: int) -> int:
        """Of a message, from its time."""
        found = np.flatnonzero(np.round(self.times * 1e9) == time)
        assert len(found) == 1
        return int(found[0])


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Played:
    directory = tmp_path_factory.mktemp("bags")
    file, path = directory / "scene.yaml", directory / "run"
    file.write_text(SCENE)
    assert simulate.main([str(file), *SHOT, "--bag", str(path)]) == 0
    assert sorted(os.listdir(directory)) == ["run", "scene.yaml"]
    assert sorted(os.listdir(path)) == ["metadata.yaml", FILE]
    content = Content(path)
    times = 0.01 * np.arange(len(content.topics["/balls/states"]))
    simulation = bs.Simulation(bs.load_scene(file))
    simulation.shoot(3.0, 1.5677963, up=-0.3)
    return Played(content, bs.record(simulation, until=times[-1]), times)


def test_states_are_the_engines_to_the_bit_at_every_tick(played: Played) -> None:
    assert {event.kind for event in played.run.events} >= {"pocketed", "ball_ball", "ball_rail", "rest"}
    names = np.array(played.run.scene.names)
    for tick, (time, message) in enumerate(played.bag.topics["/balls/states"]):
        rows = played.in_play[tick]
        assert nanoseconds(message.header.stamp) == time == round(played.times[tick] * 1e9)
        assert message.header.frame_id == "table"
        assert message.joint_names == names[rows].tolist()
        places = [vector(one.translation) for one in message.transforms]
        radius = played.run.scene.physics.radius
        assert places == [(x, y, radius) for x, y in played.positions[tick, rows].tolist()]
        turns = np.array([vector(one.rotation) for one in message.transforms])
        assert turns == pytest.approx(played.orientations[tick, rows], abs=1e-12)
        moves = [vector(one.linear) for one in message.twist]
        assert moves == [(vx, vy, 0.0) for vx, vy in played.velocities[tick, rows].tolist()]
        assert [vector(one.angular) for one in message.twist] == [*map(tuple, played.spins[tick, rows].tolist())]
        assert len(message.wrench) == 0


def test_poses_and_frames_are_those_of_the_states(played: Played) -> None:
    radius, names = played.run.scene.physics.radius, played.run.scene.names
    for topic in ("/balls/poses", "/tf"):
        assert len(played.bag.topics[topic]) == len(played.times)
    for tick, (time, message) in enumerate(played.bag.topics["/balls/poses"]):
        assert nanoseconds(message.header.stamp) == time == round(played.times[tick] * 1e9)
        assert len(message.poses) == len(names)
        for ball, pose in enumerate(message.poses):
            place = vector(pose.position)
            if played.in_play[tick, ball]:
                assert place == (*played.positions[tick, ball], radius)
            else:
                assert place[2] < 0.0
    for tick, (time, message) in enumerate(played.bag.topics["/tf"]):
        assert time == round(played.times[tick] * 1e9)
        there = np.flatnonzero(played.in_play[tick])
        assert [one.child_frame_id for one in message.transforms] == [names[ball] for ball in there]
        for ball, one in zip(there, message.transforms):
            assert (one.header.frame_id, nanoseconds(one.header.stamp)) == ("table", time)
            assert vector(one.transform.translation) == (*played.positions[tick, ball], radius)
            assert vector(one.transform.rotation) == pytest.approx(played.orientations[tick, ball], abs=1e-12)


def test_twists_tell_of_each_ball_that_moves_at_every_tick(played: Played) -> None:
    told = set()
    for time, message in played.bag.topics["/balls/twists"]:
        tick = played.tick(time)
        ball = played.run.scene.names.index(message.body_frame_id)
        assert nanoseconds(message.header.stamp) == time
        assert message.header.frame_id == message.reference_frame_id == "table"
        assert vector(message.velocity.linear) == (*played.velocities[tick, ball], 0.0)
        assert vector(message.velocity.angular) == tuple(played.spins[tick, ball])
        told.add((tick, ball))
    speeds = np.abs(np.concatenate((played.velocities, played.spins), axis=2)).max(axis=2)
    moving = {*zip(*np.nonzero((speeds > 0.0) & played.in_play))}
    assert len(moving) > 300
    assert moving <= told
    at_rest = told - moving
    assert 0 < len(at_rest) <= len(played.run.scene) * (played.times[-1] + 2.0)
    assert all(played.in_play[tick, ball] for tick, ball in at_rest)


def test_collisions_are_the_engines_events(played: Played) -> None:
    radius = played.run.scene.physics.radius
    expected = [collision_record(event, round(event.time * 1e9), radius) for event in played.run.events]
    assert played.bag.events == json.loads(json.dumps(expected))
    before = -1
    for number, (time, message) in enumerate(played.bag.topics["/collisions"]):
        content = json.loads(message.data)
        assert content["sequence"] == number + 1
        stamps = [event["stamp"]["sec"] * 10**9 + event["stamp"]["nanosec"] for event in content["events"]]
        assert all(before < stamp <= time for stamp in stamps)
        before = time if time > 0 else -1


def test_rest_is_told_at_the_start_after_the_shot_and_once_at_the_end(played: Played) -> None:
    rest = played.run.events[-1].time
    first = played.times[np.searchsorted(played.times, rest)]
    told = [(time, message.data) for time, message in played.bag.topics["/at_rest"]]
    assert told == [(0, True), (0, False), (round(first * 1e9), True)]


def test_the_shot_is_there_and_taken(played: Played) -> None:
    ((time, asked),) = played.bag.topics["/cue_shot"]
    assert time == 0
    assert asked.header.frame_id == "table"
    aim = bs.Simulation(played.run.scene)
    aim.shoot(3.0, 1.5677963, up=-0.3)
    # The impulse of the cue is the force for as long as it touches: the ball has it as momentum.
    physics = played.run.scene.physics
    force = np.array(vector(asked.wrench.force)[:2])
    assert force * physics.cue_contact_time == pytest.approx(physics.mass * aim.velocities[0])
    ((time, answer),) = played.bag.topics["/shot_result"]
    assert time == 0
    assert json.loads(answer.data)["accepted"] is True


def test_markers_show_the_balls_and_flash_at_every_contact(played: Played) -> None:
    names = played.run.scene.names
    shown, flashes = [], []
    for time, message in played.bag.topics["/markers"]:
        tick = played.tick(time)
        shown.append(tick)
        balls = {one.id: one for one in message.markers if one.ns == "balls" and one.action == 0}
        assert [names[ball] for ball in balls] == ["cue", "9", "black ball"]  # 9 in the pocket, too
        for ball, one in balls.items():
            assert nanoseconds(one.header.stamp) == time
            assert one.header.frame_id == "table"
            place = vector(one.pose.position)
            if played.in_play[tick, ball]:
                assert place == (*played.positions[tick, ball], played.run.scene.physics.radius)
            else:
                assert place[2] < 0.0
        flashes += [vector(point)[:2] for one in message.markers if one.ns == "contacts" for point in one.points]
    assert np.diff(shown).max() <= 4  # 30 Hz
    assert shown[-1] >= np.searchsorted(played.times, played.run.events[-1].time)
    assert flashes == [event.point for event in played.run.events if event.kind in ("ball_ball", "ball_rail")]
    ((time, table),) = played.bag.topics["/table_markers"]
    assert time == 0
    expected = table_markers(played.run.scene.table, played.run.scene.physics.radius, 0, "table")
    known = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(
        serialize_message(expected), "visualization_msgs/msg/MarkerArray"
    )
    assert repr(table) == repr(known)


def leaves(content: Any) -> Iterator[Any]:
    """Of a message: its texts and numbers, and the lengths of its lists."""
    if is_dataclass(content):
        content = [getattr(content, field.name) for field in fields(content)]
    if isinstance(content, (list, tuple, np.ndarray)):
        yield len(content)
        for one in content:
            yield from leaves(one)
    else:
        yield content


def test_a_node_that_plays_the_shot_publishes_the_same(
    played: Played, make_node: Callable[..., TableNode], monkeypatch: pytest.MonkeyPatch
) -> None:
    said: dict[str, list[bytes]] = {}

    class Heard:
        def __init__(self, topic: str) -> None:
            self.messages = said.setdefault("/" + topic.lstrip("/"), [])

        def publish(self, message: Any) -> None:
            self.messages.append(message if isinstance(message, bytes) else serialize_message(message))

        def get_subscription_count(self) -> int:
            return 1

    # The table's time is that of the stamps only where it is the clock of others, too.
    node = make_node(f"scene:={played.bag.path.parent / 'scene.yaml'}", "publish_clock:=true")
    monkeypatch.setattr(node, "_now", lambda: 0)
    monkeypatch.setattr(node, "create_publisher", lambda kind, topic, profile: Heard(topic))
    settings = replace(node.settings, publish_tf=True)  # which the node would refuse where tf2_msgs is not installed
    node._publisher = StatePublisher(node, settings, tf_type=lambda: TF_TYPE)
    node._shot_result_publisher = Heard("shot_result")
    node.start()
    node._on_tick(0.0)
    ((_, shot),) = played.bag.topics["/cue_shot"]
    raw = bytes(played.bag.types.serialize_cdr(shot, shot.__msgtype__))
    node._on_cue_shot(deserialize_message(raw, WrenchStamped))
    for time in played.times[1:]:
        node._on_tick(time - node.simulation.time)
    assert len(said.pop("/clock")) == len(played.times)
    assert {*said} == {*played.bag.topics} - {"/cue_shot"}
    for topic, messages in said.items():
        kind = played.bag.connections[topic].msgtype
        found = [*leaves([message for _, message in played.bag.topics[topic]])]
        expected = [*leaves([played.bag.types.deserialize_cdr(message, kind) for message in messages])]
        assert [type(one) for one in found] == [type(one) for one in expected], topic
        # Times of ticks differ in the last bit: those of the node add up.
        inexact = [index for index, one in enumerate(expected) if isinstance(one, float)]
        np.testing.assert_allclose([found[i] for i in inexact], [expected[i] for i in inexact], rtol=0, atol=1e-11)
        assert [one for one in found if not isinstance(one, float)] == [
            one for one in expected if not isinstance(one, float)
        ], topic


def test_types_and_policies_are_those_of_the_nodes_publishers(
    played: Played, make_node: Callable[..., TableNode]
) -> None:
    node = make_node("scene:=head_on")
    published = {one.topic_name: one for one in node.publishers}
    compared = 0
    for topic, connection in played.bag.connections.items():
        (offered,) = connection.ext.offered_qos_profiles
        assert connection.ext.serialization_format == "cdr"
        assert offered.history == QosHistory.KEEP_LAST
        assert offered.reliability == QosReliability.RELIABLE
        latched = topic in ("/table_markers", "/at_rest")
        assert offered.durability == (QosDurability.TRANSIENT_LOCAL if latched else QosDurability.VOLATILE)
        if topic in published:
            kind, profile = published[topic].msg_type, published[topic].qos_profile
            assert connection.msgtype == f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
            assert offered.depth == profile.depth
            assert offered.history.value == profile.history.value
            assert offered.durability.value == profile.durability.value
            assert offered.reliability.value == profile.reliability.value
            compared += 1
    assert compared == 8
    assert {topic for topic in played.bag.connections if topic not in published} == {"/tf", "/cue_shot"}


def test_definitions_have_the_hashes_of_their_types(played: Played) -> None:
    jazzy = get_typestore(Stores.ROS2_JAZZY)
    for connection in played.bag.connections.values():
        digest = played.bag.types.hash_rihs01(connection.msgtype)  # of the definition in the file
        assert connection.digest == digest == jazzy.hash_rihs01(connection.msgtype)


def test_the_file_is_an_indexed_mcap_of_the_ros2_profile(played: Played) -> None:
    with (played.bag.path / FILE).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary is not None
        assert summary.chunk_indexes
        assert {chunk.compression for chunk in summary.chunk_indexes} == {"zstd"}
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
        assert sorted(schema.name for schema in summary.schemas.values()) == sorted(
            {connection.msgtype for connection in played.bag.connections.values()}
        )
        for channel in summary.channels.values():
            connection = played.bag.connections[channel.topic]
            (offered,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
            assert QosDurability[offered["durability"].upper()] == connection.ext.offered_qos_profiles[0].durability
            assert channel.metadata["topic_type_hash"] == connection.digest
        counts = {
            summary.channels[channel].topic: count
            for channel, count in summary.statistics.channel_message_counts.items()
        }
        assert counts == {topic: len(messages) for topic, messages in played.bag.topics.items()}
        (note,) = [one for one in reader.iter_metadata() if one.name == "rosbag2"]
    text = (played.bag.path / "metadata.yaml").read_text()
    body = "".join(line.removeprefix("  ") for line in text.splitlines(keepends=True)[1:])
    assert note.metadata["serialized_metadata"] == body
    assert played.bag.span == (0, round(played.times[-1] * 1e9) + 1)
    assert {topic: one.msgcount for topic, one in played.bag.connections.items()} == counts


def test_rate_and_until_say_when_ticks_come(tmp_path: Path) -> None:
    path = tmp_path / "bag"
    assert simulate.main(["head_on", "--until", "0.5", "--rate", "30", "--bag", str(path)]) == 0
    times = [*(1 / 30 * np.arange(15)), 0.5]
    run = bs.record(bs.Simulation(bs.scenes.head_on()), until=0.5)
    found = Content(path).topics["/balls/states"]
    assert [time for time, _ in found] == [round(time * 1e9) for time in times]
    places = [[vector(one.translation)[:2] for one in message.transforms] for _, message in found]
    assert np.array_equal(places, run.positions(times))


def test_what_a_last_tick_cannot_carry_follows_it(tmp_path: Path) -> None:
    file, path = tmp_path / "scene.yaml", tmp_path / "bag"
    scene = bs.scenes.random_balls(40)
    bs.save_scene(scene, file)
    assert simulate.main([str(file), "--rate", "0.1", "--until", "10", "--bag", str(path)]) == 0
    content = Content(path)
    events = bs.Simulation(scene).run()
    assert len(events) > 200
    assert [event["time"] for event in content.events] == [event.time for event in events]
    assert [message.data for _, message in content.topics["/at_rest"]] == [False, True]


def test_a_scene_that_only_moves_has_no_shot_on_record(tmp_path: Path) -> None:
    assert simulate.main(["head_on", "--until", "0.1", "--bag", str(tmp_path / "bag")]) == 0
    assert not {"/cue_shot", "/shot_result"} & {*Content(tmp_path / "bag").connections}


def test_a_shot_at_another_ball_is_played_and_is_not_on_record_as_one_at_the_cue_ball(tmp_path: Path) -> None:
    file, path = tmp_path / "scene.yaml", tmp_path / "bag"
    file.write_text(SCENE + "shot: {ball: black ball, force: [40, 0, 0]}\n")
    assert simulate.main([str(file), "--until", "0.1", "--bag", str(path)]) == 0
    content = Content(path)
    assert not {"/cue_shot", "/shot_result"} & {*content.connections}
    assert content.events[0]["balls"] == ["black ball"]


def test_two_bags_of_a_run_say_the_same(tmp_path: Path) -> None:
    said = []
    for path in (tmp_path / "one", tmp_path / "other"):
        assert simulate.main(["rack", *SHOT, "--until", "0.2", "--bag", str(path)]) == 0
        said.append(repr(Content(path).topics))
    assert said[0] == said[1]


REFUSED = {
    "full": (("head_on", "--bag", "{tmp}/full"), "--bag: '{tmp}/full' exists already"),
    "file": (("head_on", "--bag", "{tmp}/full/file"), "--bag: '{tmp}/full/file' exists already"),
    "empty": (("head_on", "--bag", "{tmp}/full/empty"), "--bag: '{tmp}/full/empty' exists already"),
    "nowhere": (("head_on", "--bag", "{tmp}/nowhere/bag"), "--bag: cannot write", "no directory '{tmp}/nowhere'"),
    "twice": (("head_on", "--json", "{tmp}/out", "--bag", "{tmp}/out"), "--bag: '{tmp}/out' is written by another"),
    "solver": (("head_on", "--solver", "time_step", "--bag", "{tmp}/bag"), "--bag", "--solver time_step"),
    "slow": (("head_on", "--rate", "0", "--bag", "{tmp}/bag"), "--rate must be a number >= 0.1, <= 1000 (Hz), got 0"),
    "fast": (("head_on", "--rate", "1001", "--bag", "{tmp}/bag"), "--rate must be", "got 1001"),
    "nan": (("head_on", "--rate", "nan", "--bag", "{tmp}/bag"), "--rate must be", "got nan"),
    "long": (("head_on", "--until", "1e9", "--bag", "{tmp}/bag"), "--until 1e+09", "times", "at most 1000000"),
    "frame": (("{tmp}/full/frame.yaml", "--bag", "{tmp}/bag"), "--bag: the table and a ball cannot both"),
}


@pytest.mark.parametrize("case", REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_a_bag_is_one_line_and_leaves_all_as_it_was(
    case: tuple[Any, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments, *words = case
    (tmp_path / "full" / "empty").mkdir(parents=True)
    (tmp_path / "full" / "file").write_text("mine")
    (tmp_path / "full" / "frame.yaml").write_text("balls: [{name: table, position: [1, 0.5], velocity: [1, 0]}]")
    assert simulate.main([argument.replace("{tmp}", str(tmp_path)) for argument in arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    for word in words:
        assert word.replace("{tmp}", str(tmp_path)) in error
    assert os.listdir(tmp_path) == ["full"]
    assert sorted(os.listdir(tmp_path / "full")) == ["empty", "file", "frame.yaml"]
    assert os.listdir(tmp_path / "full" / "empty") == []


@pytest.mark.parametrize(
    "reason, code, said",
    [(KeyboardInterrupt(), 1, "stopped"), (OSError(28, "No space left on device"), 2, "No space left on device")],
)
def test_what_fails_or_is_interrupted_leaves_no_bag(
    reason: BaseException,
    code: int,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = []

    def fail(*_: Any) -> None:
        found.extend(os.listdir(tmp_path))
        raise reason

    monkeypatch.setattr(bag_module.Bag, "finish", fail)
    assert simulate.main(["head_on", "--until", "0.1", "--bag", str(tmp_path / "bag")]) == code
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert len(found) == 1
    assert os.listdir(tmp_path) == []


def test_a_directory_that_fills_meanwhile_is_left_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bag"
    finish = bag_module.Bag.finish

    def meanwhile(self: Any) -> str:
        path.mkdir()
        (path / "file").write_text("mine")
        return finish(self)

    monkeypatch.setattr(bag_module.Bag, "finish", meanwhile)
    assert simulate.main(["head_on", "--until", "0.1", "--bag", str(path)]) == 2
    assert "Directory not empty" in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["bag"]
    assert (path / "file").read_text() == "mine"


@pytest.mark.parametrize("module", ["mcap", "rclpy", "geometry_msgs"])
def test_what_is_not_installed_is_named_before_anything_is_computed(
    module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [*sys.modules]:
        if name.partition(".")[0] == module or name.startswith("billiards_sim.ros."):
            monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.setattr(simulate, "record", lambda *_: pytest.fail("computed"))
    assert simulate.main(["head_on", "--bag", str(tmp_path / "bag")]) == 2
    error = capsys.readouterr().err
    assert error.startswith("simulate: --bag needs the ROS 2 messages and mcap")
    assert module in error
    assert "pip install 'billiards_sim[ros]'" in error
    assert error.count("\n") == 1
    assert os.listdir(tmp_path) == []


def test_a_type_without_a_definition_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "some_msgs"
    package.mkdir()
    (package / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    with (tmp_path / "file").open("wb") as file:
        for name in ("some_msgs/msg/Thing", "no_such_msgs/msg/Thing"):
            with pytest.raises(ValueError, match=name):
                bag_module.Bag(file).create_publisher(name, "topic", 1)
    shutil.rmtree(package)
