# SPDX-License-Identifier: Apache-2.0
"""Frames of the balls, as an independent reader reads them. Where tf2_msgs must be there, a stand-in is."""

from __future__ import annotations

import importlib.util
import sys
import types
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import rclpy
from conftest import Site
from geometry_msgs.msg import Transform, Vector3
from sensor_msgs.msg import MultiDOFJointState

from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.transforms import TF_TYPE, BallFrames, tf_message_type

try:
    from rosbags.typesys import Stores, get_typestore
except ImportError:
    needs_reader = pytest.mark.skip(reason="rosbags is not installed")
else:
    needs_reader = pytest.mark.skipif(False, reason="")
    TYPES = get_typestore(Stores.ROS2_JAZZY)


class TFMessage:
    """Its class alone is looked at."""


def frames_of(message: bytes) -> list[Any]:
    return list(TYPES.deserialize_cdr(message, TF_TYPE).transforms)


class Publisher:
    """Keeps where the balls are when a message goes out."""

    def __init__(self) -> None:
        self.subscribers = 1
        self.sent: list[dict[str, tuple[float, ...]]] = []

    def get_subscription_count(self) -> int:
        return self.subscribers

    def publish(self, message: bytes) -> None:
        moves = {frame.child_frame_id: frame.transform.translation for frame in frames_of(message)}
        self.sent.append({name: (move.x, move.y, move.z) for name, move in moves.items()})


@pytest.fixture
def tf2_msgs(monkeypatch: pytest.MonkeyPatch) -> None:
    package, module = types.ModuleType("tf2_msgs"), types.ModuleType("tf2_msgs.msg")
    module.TFMessage = TFMessage
    monkeypatch.setitem(sys.modules, "tf2_msgs", package)
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", module)


@pytest.fixture
def no_tf2_msgs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "tf2_msgs", None)
    monkeypatch.setitem(sys.modules, "tf2_msgs.msg", None)


@needs_reader
@pytest.mark.parametrize("names", [("left/cue", "left/1"), ("cue", "12"), ("", "schwarze Kugel"), ("kö",)])
def test_a_frame_lies_at_its_ball_in_the_frame_of_the_table(names: tuple[str, ...]) -> None:
    frames = BallFrames(names, 0.03, "hall")
    positions = np.array([[0.5, 0.6], [1.5, 1.6]])[: len(names)]
    turns = np.array([[0.6, 0.0, 0.0, 0.8], [0.0, 0.6, 0.8, 0.0]])[: len(names)]
    for orientations in (None, turns):
        found = frames_of(frames.at(positions, 2_000_000_005, orientations))
        assert [frame.child_frame_id for frame in found] == [*names]
        for index, frame in enumerate(found):
            assert frame.header.frame_id == "hall"
            assert (frame.header.stamp.sec, frame.header.stamp.nanosec) == (2, 5)
            move, turn = frame.transform.translation, frame.transform.rotation
            assert (move.x, move.y, move.z) == (*positions[index], 0.03)
            upright = (0.0, 0.0, 0.0, 1.0)
            assert (turn.x, turn.y, turn.z, turn.w) == (upright if orientations is None else tuple(turns[index]))


@needs_reader
def test_a_table_without_balls_has_no_frames() -> None:
    assert frames_of(BallFrames((), 0.03, "hall").at(np.empty((0, 2)), 0)) == []


def test_without_tf2_msgs_a_change_is_refused_and_says_what_is_missing(table: TableNode, no_tf2_msgs: None) -> None:
    result = table.set_parameters_atomically([rclpy.Parameter("publish_tf", value=True)])
    assert not result.successful
    assert "'publish_tf' needs the ROS package tf2_msgs" in result.reason
    assert "\n" not in result.reason
    assert table.get_parameter("publish_tf").value is False
    with pytest.raises(ValueError, match="tf2_msgs"):
        tf_message_type()


@pytest.mark.skipif(importlib.util.find_spec("tf2_msgs") is not None, reason="tf2_msgs is installed")
def test_without_tf2_msgs_a_table_that_should_publish_frames_goes_on_without(site: Site) -> None:
    table = site.table("publish_tf:=true")
    client = site.client()
    assert table.stderr.count("'publish_tf' needs the ROS package tf2_msgs") == 1
    assert client.get_parameters("publish_tf") == [False]
    assert client.node.count_publishers("/tf") == 0


@pytest.fixture
def publisher(monkeypatch: pytest.MonkeyPatch, tf2_msgs: None) -> Publisher:
    """Of /tf, of the tables that are made."""
    publisher = Publisher()
    create = TableNode.create_publisher

    def create_publisher(self: TableNode, kind: type, topic: str, *options: object, **more: object) -> object:
        return publisher if topic == "/tf" else create(self, kind, topic, *options, **more)

    monkeypatch.setattr(TableNode, "create_publisher", create_publisher)
    monkeypatch.setattr(TableNode, "destroy_publisher", lambda *_: True)
    return publisher


@needs_reader
def test_frames_go_out_every_tick_while_somebody_listens(
    make_node: Callable[..., TableNode], publisher: Publisher
) -> None:
    node = make_node("scene:=head_on", "publish_tf:=true")
    node.start()
    node.advance(0.25)
    assert len(publisher.sent) == 1
    radius = node.simulation.start_scene.physics.radius
    assert np.array(list(publisher.sent[0].values())) == pytest.approx(
        np.column_stack((node.simulation.positions, [radius, radius]))
    )
    publisher.subscribers = 0
    node.advance(0.25)
    assert len(publisher.sent) == 1
    node.simulation.run()
    publisher.subscribers = 1
    assert node.set_parameters_atomically([rclpy.Parameter("publish_tf", value=False)]).successful
    node.advance(0.25)
    assert len(publisher.sent) == 1
    assert node.set_parameters_atomically([rclpy.Parameter("publish_tf", value=True)]).successful
    node.advance(0.25)
    assert len(publisher.sent) == 2


@needs_reader
def test_a_ball_off_the_table_has_no_frame(make_node: Callable[..., TableNode], publisher: Publisher) -> None:
    node = make_node("publish_tf:=true", "frame_prefix:=left/")
    node.start()
    radius = node.simulation.start_scene.physics.radius
    node._on_set_balls(
        MultiDOFJointState(
            joint_names=["9", "cue"],
            transforms=[Transform(translation=Vector3(x=x, y=0.5)) for x in (1.5, 0.5)],
        )
    )
    node.advance(0.01)
    assert publisher.sent[-1] == {"left/cue": (0.5, 0.5, radius), "left/9": (1.5, 0.5, radius)}
    node.reset()
    node.advance(0.01)
    assert [*publisher.sent[-1]] == ["left/" + name for name in node.simulation.start_scene.names]
