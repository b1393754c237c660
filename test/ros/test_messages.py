# SPDX-License-Identifier: Apache-2.0
import json
from collections.abc import Sequence

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseArray, Quaternion, Transform, Twist, Vector3, VelocityStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import MultiDOFJointState

import billiards_sim as bs
from billiards_sim.ros import messages

EPOCH = 1_700_000_000_123_456_789


def test_stamps_follow_simulated_time_to_the_nanosecond() -> None:
    stamps = messages.Stamps(EPOCH)
    assert stamps.at(0.0) == EPOCH
    assert stamps.at(1.000000001) == EPOCH + 1_000_000_001


def test_stamps_count_from_the_time_that_has_one() -> None:
    stamps = messages.Stamps(EPOCH, 2.5)
    assert [stamps.at(2.5), stamps.at(2.75)] == [EPOCH, EPOCH + 250_000_000]


def test_no_stamp_is_beyond_the_last_that_a_message_can_have() -> None:
    assert messages.LAST_STAMP == (2**31 - 1) * 10**9 + 999_999_999  # int32 seconds
    stamps = messages.Stamps(messages.LAST_STAMP - 5)
    assert stamps.at(4e-9) == messages.LAST_STAMP - 1
    assert [stamps.at(time) for time in (5e-9, 6e-9, 1e12)] == [messages.LAST_STAMP] * 3
    states = messages.States(("cue",), 0.03, "table")
    stamp = deserialize_message(states.stamped(stamps.at(1.0)), MultiDOFJointState).header.stamp
    assert (stamp.sec, stamp.nanosec) == (2**31 - 1, 999_999_999)


def test_stamps_do_not_go_back_over_a_reset() -> None:
    stamps = messages.Stamps(EPOCH)
    before = stamps.at(5.25)
    after = stamps.restarted(5.25)
    assert after.at(0.0) == before
    assert after.at(0.01) == before + 10_000_000
    assert stamps.at(5.25) == before


def test_a_stamp_is_split_into_seconds_and_nanoseconds() -> None:
    message = Time()
    messages.set_stamp(message, EPOCH)
    assert (message.sec, message.nanosec) == (1_700_000_000, 123_456_789)


POSITIONS = np.array([[1.0, 2.0], [3.0, 4.0]])


def test_poses_are_what_rclpy_would_have_sent() -> None:
    poses = messages.Poses(3, 0.03, "table")
    poses.show(np.vstack((POSITIONS, np.full(2, np.nan))), np.array([True, False, False]))
    message = deserialize_message(poses.stamped(EPOCH), PoseArray)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    assert message.header.frame_id == "table"
    places = [(p.position.x, p.position.y, p.position.z) for p in message.poses]
    assert places == [(1.0, 2.0, 0.03), (3.0, 4.0, -0.03), (0.0, 0.0, -0.03)]  # on it, in a pocket, nowhere
    assert all(p.orientation == Quaternion(w=1.0) for p in message.poses)
    assert serialize_message(message) == poses.stamped(EPOCH)


def test_poses_carry_orientations_where_they_are_given() -> None:
    turns = np.array([[0.6, 0.0, 0.0, 0.8], [0.0, 0.6, 0.8, 0.0]])
    poses = messages.Poses(2, 0.03, "table")
    poses.show(POSITIONS, np.array([True, True]), turns)
    message = deserialize_message(poses.stamped(EPOCH), PoseArray)
    turned = [(p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w) for p in message.poses]
    assert turned == [(0.6, 0.0, 0.0, 0.8), (0.0, 0.6, 0.8, 0.0)]


def expected_states(names: Sequence[str], turned: bool) -> tuple[MultiDOFJointState, list[np.ndarray]]:
    """A message with other numbers in every place, and what `States` is told for it."""
    message = MultiDOFJointState(joint_names=list(names))
    message.header.frame_id = "table"
    message.header.stamp = Time(sec=1_700_000_000, nanosec=123_456_789)
    count = len(names)
    positions, velocities = np.arange(2.0 * count).reshape(count, 2), -np.arange(2.0 * count).reshape(count, 2)
    spins, turns = 0.1 + np.arange(3.0 * count).reshape(count, 3), np.tile([0.6, 0.0, 0.8, 0.0], (count, 1))
    for (x, y), (vx, vy), spin, (qx, qy, qz, qw) in zip(positions, velocities, spins, turns):
        turn = Quaternion(x=qx, y=qy, z=qz, w=qw) if turned else Quaternion()
        message.transforms.append(Transform(translation=Vector3(x=x, y=y, z=0.03), rotation=turn))
        twist = Twist(linear=Vector3(x=vx, y=vy), angular=Vector3(**dict(zip("xyz", spin))))
        message.twist.append(twist)
    return message, [positions, velocities, spins, turns]


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("names", [(), ("cue",), ("1", "22"), ("a long name of a ball", "", "x", "4")], ids=len)
def test_states_are_what_rclpy_would_have_sent(names: Sequence[str], turned: bool) -> None:
    expected, (positions, velocities, spins, turns) = expected_states(names, turned)
    states = messages.States(names, 0.03, "table")
    states.show(positions + 1.0, velocities, spins)
    states.show(positions, velocities, spins, turns if turned else None)
    sent = states.stamped(EPOCH)
    assert deserialize_message(sent, MultiDOFJointState) == expected
    assert len(sent) == len(serialize_message(expected))  # bytes that only align others may be any


@pytest.mark.parametrize("name", ["7", "cue", "a long name of a ball"])  # names move what comes behind them
def test_a_twist_names_its_ball_and_the_table(name: str) -> None:
    twist = messages.BallTwist(name, "table")
    message = deserialize_message(twist.at(np.array([1.0, -2.0]), np.array([3.0, 4.0, 5.0]), EPOCH), VelocityStamped)
    assert (message.body_frame_id, message.reference_frame_id, message.header.frame_id) == (name, "table", "table")
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1_700_000_000, 123_456_789)
    linear, angular = message.velocity.linear, message.velocity.angular
    assert (linear.x, linear.y, linear.z) == (1.0, -2.0, 0.0)
    assert (angular.x, angular.y, angular.z) == (3.0, 4.0, 5.0)


def test_a_message_that_was_taken_does_not_change_with_the_next() -> None:
    poses = messages.Poses(2, 0.03, "table")
    first = poses.stamped(EPOCH)
    kept = bytes(bytearray(first))
    poses.show(POSITIONS + 1.0, np.array([True, True]))
    poses.stamped(EPOCH + 1)
    assert first == kept


def test_an_event_for_json_says_everything_and_keeps_every_digit() -> None:
    event = bs.Event(
        time=1 / 3,
        kind="ball_rail",
        balls=("cue",),
        rail="x_max",
        point=(2.39, 0.1 + 0.2),
        normal=(-1.0, 0.0),
        approach_speed=2 / 3,
        impulse=1e-17,
    )
    read = json.loads(json.dumps(messages.collision_record(event, EPOCH, 0.03)))
    assert read == {
        "kind": "ball_rail",
        "time": 1 / 3,
        "stamp": {"sec": 1_700_000_000, "nanosec": 123_456_789},
        "balls": ["cue"],
        "rail": "x_max",
        "pocket": None,
        "point": [2.39, 0.1 + 0.2, 0.03],
        "normal": [-1.0, 0.0, 0.0],
        "approach_speed": 2 / 3,
        "impulse": 1e-17,
    }


@pytest.mark.parametrize(("accepted", "reason"), [(True, ""), (False, 'ball "cue" moves')])
def test_an_answer_names_the_request(accepted: bool, reason: str) -> None:
    assert messages.answer_record(reason, 0.1, (7, 8)) == {
        "version": 2,
        "accepted": accepted,
        "reason": reason,
        "time": 0.1,
        "request": {"sec": 7, "nanosec": 8},
    }
