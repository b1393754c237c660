# SPDX-License-Identifier: Apache-2.0
"""What goes out of a state: nothing is made anew of balls that rest, and their orientation outlives a simulation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseArray
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import MultiDOFJointState
from std_srvs.srv import Trigger

import billiards_sim as bs
from billiards_sim.quaternion import IDENTITY, product
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot

SHOT = wrench_from_shot((20.0, 3.0, 0.0), (0.0, 0.004))
"""Without side, so that no ball goes on spinning where it rests."""


class Ears:
    """A publisher with a subscriber, which keeps what goes out."""

    def __init__(self, kind: type) -> None:
        self._kind = kind
        self.heard: list[bytes] = []

    def get_subscription_count(self) -> int:
        return 1

    def publish(self, message: bytes) -> None:
        self.heard.append(message)

    @property
    def last(self) -> PoseArray | MultiDOFJointState:
        return deserialize_message(self.heard[-1], self._kind)


def listen(node: TableNode) -> tuple[Ears, Ears]:
    """To balls/states and balls/poses."""
    states, poses = Ears(MultiDOFJointState), Ears(PoseArray)
    node._publisher._states_publisher, node._publisher._poses_publisher = states, poses
    return states, poses


def places(states: Ears, poses: Ears) -> list[tuple[float, float]]:
    """Of the balls, which both topics have alike."""
    found = [(one.position.x, one.position.y) for one in poses.last.poses]
    assert [(one.translation.x, one.translation.y) for one in states.last.transforms] == found
    return found


def turns(states: Ears, poses: Ears) -> np.ndarray:
    """(N, 4) of the balls, which both topics have alike."""
    found = [one.orientation for one in poses.last.poses]
    assert [one.rotation for one in states.last.transforms] == found
    return np.array([(q.x, q.y, q.z, q.w) for q in found])


def play(node: TableNode) -> None:
    """A shot, to rest."""
    node._on_cue_shot(SHOT)
    assert not node.simulation.at_rest
    while not node.simulation.at_rest:
        node.advance(0.1)


def stamps(ears: Ears) -> list[tuple[int, int]]:
    found = (deserialize_message(data, ears._kind).header.stamp for data in ears.heard)
    return [(stamp.sec, stamp.nanosec) for stamp in found]


def test_balls_that_rest_are_looked_at_once_and_sent_every_tick(
    table: TableNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = []
    positions = bs.Simulation.positions.fget
    assert positions is not None
    monkeypatch.setattr(bs.Simulation, "positions", property(lambda one: looks.append(one) or positions(one)))
    states, poses = listen(table)
    for _ in range(5):
        table.advance(0.01)
    assert len(looks) == 1
    assert len(states.heard) == len(poses.heard) == 5
    assert len(set(stamps(states))) == 5


def test_what_happens_is_seen_in_the_next_message(table: TableNode) -> None:
    ears = listen(table)
    start = [tuple(row) for row in bs.scenes.rack().positions.tolist()]
    table.advance(0.01)
    assert places(*ears) == start
    play(table)
    lie = [tuple(row) for row in table.simulation.positions.tolist()]
    assert places(*ears) == lie != start
    table._on_cue_shot(wrench_from_shot((0.2, 0.0, 0.0), (0.0, 0.0)))
    table.advance(60.0)  # from rest to rest in one tick
    assert table.simulation.at_rest
    assert places(*ears) == [tuple(row) for row in table.simulation.positions.tolist()] != lie
    table.reset()
    table.advance(0.01)
    assert places(*ears) == start
    message = deserialize_message(ears[1].heard[-1], PoseArray)
    message.poses[0].position.x = 0.3
    table._on_place_balls(message)
    table.advance(0.01)
    assert places(*ears) == [tuple(row) for row in table.simulation.positions.tolist()] != start


def test_a_late_listener_sees_the_balls_as_they_rest(table: TableNode) -> None:
    play(table)
    table.advance(0.01)
    ears = listen(table)
    table.advance(0.01)
    assert places(*ears) == [tuple(row) for row in table.simulation.positions.tolist()]


def test_a_ball_that_spins_on_the_spot_is_looked_at_every_tick(make_node: Callable[..., TableNode], tmp_path) -> None:
    path = tmp_path / "top.yaml"
    scene = bs.Scene([[0.5, 0.5]], None, [[0.0, 0.0, 3.0]], names=("cue",), track_orientation=True)
    bs.save_scene(scene, path)
    node = make_node(f"scene:={path}", "track_orientation:=true")
    node.start()
    ears = listen(node)
    node.advance(0.1)
    node.advance(0.1)
    assert node.simulation.at_rest
    assert turns(*ears)[0] == pytest.approx([0.0, 0.0, np.sin(0.3), np.cos(0.3)], abs=1e-12)
    assert ears[0].last.twist[0].angular.z == pytest.approx(3.0, abs=0.1)


@pytest.fixture
def turning(make_node: Callable[..., TableNode]) -> TableNode:
    node = make_node("scene:=rack", "track_orientation:=true")
    node.start()
    return node


def change_mass(node: TableNode) -> None:
    mass = node.settings.scene.physics.mass + 0.01
    assert node.set_parameters_atomically([rclpy.Parameter("physics.mass", value=mass)]).successful


def change_rate(node: TableNode) -> None:
    rate = node.settings.update_rate + 1.0
    assert node.set_parameters_atomically([rclpy.Parameter("update_rate", value=rate)]).successful


def place_as_they_lie(node: TableNode) -> None:
    node.advance(0.0)
    message = deserialize_message(node._publisher._poses_publisher.heard[-1], PoseArray)
    node._on_place_balls(message)


@pytest.mark.parametrize("change", [change_mass, change_rate, place_as_they_lie])
def test_balls_stay_turned_as_they_are_over_a_change_and_go_on_from_there(
    turning: TableNode, change: Callable[[TableNode], None]
) -> None:
    ears = listen(turning)
    play(turning)
    turning.advance(0.01)
    before = turns(*ears)
    assert np.abs(before - IDENTITY).max() > 0.1
    for _ in range(2):  # nor does a second one add up
        change(turning)
        turning.advance(0.01)
        assert np.abs(turns(*ears) - before).max() <= 1e-15
        assert places(*ears) == [tuple(row) for row in turning.simulation.positions.tolist()]
    fresh = bs.Simulation(turning.simulation.scene())
    fresh.strike((1.0, 2.0, 0.0))
    fresh.run()
    turning._on_cue_shot(wrench_from_shot((1.0, 2.0, 0.0), (0.0, 0.0)))
    turning.advance(60.0)
    turning.advance(0.01)
    assert np.abs(turns(*ears) - product(fresh.orientations, before)).max() <= 1e-12


def test_a_reset_turns_the_balls_back(turning: TableNode) -> None:
    ears = listen(turning)
    play(turning)
    change_mass(turning)
    assert turning._on_reset(Trigger.Request(), Trigger.Response()).success
    turning.advance(0.01)
    assert turns(*ears).tolist() == [list(IDENTITY)] * 16


def test_tracking_that_is_turned_on_again_begins_upright(turning: TableNode) -> None:
    ears = listen(turning)
    play(turning)
    for on in (False, True):
        assert turning.set_parameters_atomically([rclpy.Parameter("track_orientation", value=on)]).successful
        turning.advance(0.01)
        assert turns(*ears).tolist() == [list(IDENTITY)] * 16
