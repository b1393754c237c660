# SPDX-License-Identifier: Apache-2.0
"""A ball that spins where it lies, ever less: the table does not rest yet, and everyone sees why."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rclpy
from geometry_msgs.msg import PoseArray, VelocityStamped
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import MultiDOFJointState
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

import billiards_sim as bs
from billiards_sim.ros import messages
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot

SPIN = 3.0
"""rad/s, of the ball 9 at the start; the cue ball has none."""

DECELERATION = bs.Physics.pool().spin_deceleration
MS = 1_000_000


class Ears:
    """A publisher with a subscriber, which keeps what goes out."""

    def __init__(self, kind: type) -> None:
        self._kind = kind
        self.heard: list = []

    def get_subscription_count(self) -> int:
        return 1

    def publish(self, message: object) -> None:
        plain = deserialize_message(message, self._kind) if isinstance(message, bytes) else message
        if isinstance(plain, MarkerArray):  # updated in place
            self.heard.append([(one.ns, one.pose.orientation.z) for one in plain.markers])
        else:
            self.heard.append(plain)


@pytest.fixture
def wall(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The node's clock, ns, moved by hand."""
    wall = [1_700_000_000_000 * MS]
    monkeypatch.setattr(TableNode, "_now", lambda _: wall[0])
    return wall


@pytest.fixture
def spinning(make_node: Callable[..., TableNode], tmp_path: Path, wall: list[int]) -> TableNode:
    """A table whose ball 9 spins."""
    path = tmp_path / "spinning.yaml"
    spins = [[0.0, 0.0, 0.0], [0.0, 0.0, SPIN]]
    physics = bs.Physics.pool()
    bs.save_scene(bs.Scene([[0.5, 0.5], [1.0, 0.6]], None, spins, names=("cue", "9"), physics=physics), path)
    node = make_node(f"scene:={path}", "track_orientation:=true", "marker_rate:=100.0")
    return node


def listen(node: TableNode, name: str, kind: type) -> Ears:
    ears = Ears(kind)
    setattr(node._publisher, f"_{name}_publisher", ears)
    return ears


def tick(node: TableNode, wall: list[int]) -> None:
    wall[0] += 10 * MS
    node._on_beat()


def test_a_table_rests_when_its_last_spin_has_ended(spinning: TableNode, wall: list[int]) -> None:
    rests = listen(spinning, "at_rest", Bool)
    spinning.start()
    ticks = 0
    while not spinning.simulation.at_rest:
        assert [one.data for one in rests.heard] == [False]
        tick(spinning, wall)
        ticks += 1
    assert [one.data for one in rests.heard] == [False, True]
    assert ticks == int(np.ceil(SPIN / DECELERATION / 0.01))


def test_states_and_twists_tell_every_tick_how_a_ball_spins(spinning: TableNode, wall: list[int]) -> None:
    states, twists = listen(spinning, "states", MultiDOFJointState), listen(spinning, "twists", VelocityStamped)
    spinning.start()
    tick(spinning, wall)
    twists.heard.clear()
    for number in range(2, 20):
        tick(spinning, wall)
        assert states.heard[-1].twist[1].angular.z == pytest.approx(SPIN - 0.01 * DECELERATION * number, abs=1e-12)
    ours = [one.velocity.angular.z for one in twists.heard if one.body_frame_id == "9"]
    assert ours == [one.twist[1].angular.z for one in states.heard[1:]]
    while not spinning.simulation.at_rest:
        tick(spinning, wall)
    assert states.heard[-1].twist[1].angular.z == 0.0
    assert twists.heard[-1].velocity.angular.z == 0.0
    heard = len(twists.heard)
    for _ in range(50):
        tick(spinning, wall)
    assert len(twists.heard) <= heard + 2  # when it is their turn


def test_a_ball_that_spins_turns_in_poses_and_pictures(spinning: TableNode, wall: list[int]) -> None:
    poses, drawn = listen(spinning, "poses", PoseArray), listen(spinning, "markers", MarkerArray)
    spinning.start()
    for number in range(1, 60):
        tick(spinning, wall)
        age = min(0.01 * number, SPIN / DECELERATION)
        angle = (SPIN - 0.5 * DECELERATION * age) * age
        assert poses.heard[-1].poses[1].orientation.z == pytest.approx(np.sin(0.5 * angle), abs=1e-12)
        balls = [turn for ns, turn in drawn.heard[-1] if ns == "balls"]
        assert balls == [0.0, poses.heard[-1].poses[1].orientation.z]


def test_stamps_count_simulated_time_until_the_spin_has_ended(spinning: TableNode, wall: list[int]) -> None:
    states = listen(spinning, "states", MultiDOFJointState)
    spinning.start()
    while not spinning.simulation.at_rest:
        wall[0] += 3 * MS  # the table is slower than the clock
        tick(spinning, wall)
    stamps = [messages.stamp_of(one) for one in states.heard]
    times = np.array([sec * 1_000_000_000 + nanosec for sec, nanosec in stamps])
    assert np.abs(np.diff(times[:-1]) - 10 * MS).max() <= 1
    assert times[-1] == wall[0] > times[-2] + 50 * MS


def test_what_must_wait_for_rest_says_which_ball_spins(spinning: TableNode, wall: list[int]) -> None:
    spinning.start()
    answers = spinning._shot_result_publisher = Ears(String)
    tick(spinning, wall)
    spinning._on_cue_shot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))
    refused = json.loads(answers.heard[-1].data)
    figure = f"{SPIN - 0.01 * DECELERATION:.6g}"
    assert refused["reason"] == f"every ball must rest before a shot: ball '9' spins at {figure} rad/s"
    while not spinning.simulation.at_rest:
        tick(spinning, wall)
    spinning._on_cue_shot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))
    assert json.loads(answers.heard[-1].data)["accepted"]


def test_a_spin_that_begins_to_fall_falls_from_where_it_is(make_node: Callable[..., TableNode], tmp_path: Path) -> None:
    path = tmp_path / "for_ever.yaml"
    scene = bs.Scene([[0.5, 0.5]], None, [[0.0, 0.0, SPIN]], track_orientation=True)
    bs.save_scene(scene, path)
    node = make_node(f"scene:={path}")
    node.start()
    node.advance(100.0)
    assert node.simulation.at_rest
    assert node.set_parameters_atomically([rclpy.Parameter("physics.preset", value="pool")]).successful
    assert (node.simulation.time, node.simulation.at_rest) == (100.0, False)
    assert node.simulation.angular_velocities[0, 2] == SPIN
    node.advance(0.1)
    assert node.simulation.angular_velocities[0, 2] == pytest.approx(SPIN - 0.1 * DECELERATION, abs=1e-12)
    poses = listen(node, "poses", PoseArray)
    node.advance(1.0)
    angle = 100.0 * SPIN + 0.5 * SPIN * SPIN / DECELERATION
    assert abs(poses.heard[-1].poses[0].orientation.z) == pytest.approx(abs(np.sin(0.5 * angle)), abs=1e-9)
