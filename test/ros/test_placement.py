# SPDX-License-Identifier: Apache-2.0
import math
import re

import numpy as np
import pytest
from conftest import Site
from geometry_msgs.msg import Pose, PoseArray, Transform
from process import positions
from sensor_msgs.msg import MultiDOFJointState

import billiards_sim as bs
from billiards_sim.ros.placement import named_balls, placed_balls
from billiards_sim.ros.separation import TOUCHING
from billiards_sim.ros.wrench import wrench_from_shot

RADIUS = bs.Physics().radius
TABLE = bs.Table()
LOW = np.array([TABLE.x_min, TABLE.y_min]) + RADIUS
TOLERANCE = 0.002


def poses(points: object, frame: str = "table") -> PoseArray:
    message = PoseArray()
    message.header.frame_id = frame
    for point in np.asarray(points, dtype=float).tolist():
        pose = Pose()
        pose.position.x, pose.position.y, pose.position.z = (*point, 0.0)[:3]
        message.poses.append(pose)
    return message


def placed(message: PoseArray, scene: bs.Scene, tolerance: float) -> np.ndarray:
    places = placed_balls(message, scene, tolerance, "table")
    assert tuple(places) == scene.names
    return np.array([*places.values()])


PAIR = bs.Scene([[0.5, 0.5], [1.0, 0.5]])
APART = [[0.7, 0.4], [1.3, 0.8]]


@pytest.mark.parametrize("frame", ["", "table"])
def test_balls_that_are_free_are_placed_to_the_bit(frame: str) -> None:
    assert np.array_equal(placed(poses(APART, frame), PAIR, TOLERANCE), APART)
    assert np.array_equal(placed(poses(APART), PAIR, 0.0), APART)


BAD = {
    "frame": (poses(APART, "camera"), "frame_id must be 'table' or empty, got 'camera'"),
    "too few": (poses(APART[:1]), "one pose a ball, 2 in the order of balls/poses ('cue' first); got 1"),
    "too many": (poses([*APART, [1.0, 1.0]]), "got 3"),
    "none": (PoseArray(), "got 0"),
    "nan": (poses([APART[0], [math.nan, 0.5]]), "the position of ball '1' must be finite, got (nan, 0.5, 0.0) m"),
    "height": (poses([[0.7, 0.4, math.inf], [1.3, 0.8, 0.0]]), "ball 'cue' must be finite"),
    "outside": (
        poses([APART[0], [5.0, 0.5]]),
        "ball '1' reaches 2.63777 m into a rail, placement_tolerance is 0.002 m",
    ),
    "huge": (poses([APART[0], [1e308, -1e308]]), "ball '1' reaches"),
    "rail": (poses([APART[0], [LOW[0] - 0.0021, 0.5]]), "ball '1' reaches 0.0021 m into a rail"),
    "overlap": (poses([[1.0, 0.5], [1.0 + 2 * RADIUS - 0.0021, 0.5]]), "balls 'cue' and '1' overlap by 0.0021 m"),
    "same": (poses([[1.0, 0.5], [1.0, 0.5]]), "overlap by 0.05715 m, placement_tolerance is 0.002 m"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_placement_is_refused_with_figure_and_bound(case: str) -> None:
    message, reason = BAD[case]
    with pytest.raises(ValueError, match=re.escape(reason)):
        placed(message, PAIR, TOLERANCE)


def test_two_balls_that_overlap_part_evenly_until_they_touch() -> None:
    way = 2.0 * RADIUS - 0.001
    found = placed(poses([[1.0, 0.5], [1.0 + 0.6 * way, 0.5 + 0.8 * way]]), PAIR, TOLERANCE)
    assert found[0] == pytest.approx([1.0 - 0.6 * 0.0005, 0.5 - 0.8 * 0.0005], abs=1e-9)
    assert math.dist(*found) == pytest.approx(2.0 * RADIUS, abs=1e-9)


def test_a_ball_in_a_rail_comes_out_and_pushes_its_neighbour() -> None:
    start = [[LOW[0] - 0.001, 0.5], [LOW[0] - 0.001 + 2.0 * RADIUS, 0.5]]
    found = placed(poses(start), PAIR, TOLERANCE)
    assert found == pytest.approx(np.array([[LOW[0], 0.5], [LOW[0] + 2.0 * RADIUS, 0.5]]), abs=1e-9)


def test_a_noisy_rack_becomes_a_scene() -> None:
    rack = bs.scenes.rack(0.0)
    noise = np.random.default_rng(1).uniform(-0.0007, 0.0007, rack.positions.shape)
    bs.Scene(placed(poses(rack.positions + noise), rack, TOLERANCE))  # which checks overlaps and rails


def test_what_a_camera_saw_becomes_the_table(site: Site) -> None:
    site.table("scene:=rack", "real_time_factor:=5.0")
    client = site.client()
    scene = bs.scenes.rack()
    seen = np.array([(0.3 + 0.2 * column, 0.3 + 0.2 * row) for row in range(4) for column in range(4)])
    seen[1] = seen[0] + (2.0 * RADIUS - 0.0015, 0.0)
    short = poses(seen[:3])
    short.header.stamp.sec, short.header.stamp.nanosec = 12, 34
    refused = client.place(short)
    assert (refused["accepted"], refused["request"]) == (False, {"sec": 12, "nanosec": 34})
    assert "got 3" in refused["reason"]
    verdict = client.place(poses(seen))
    assert (verdict["accepted"], verdict["reason"]) == (True, "")
    expected = [tuple(row) for row in placed(poses(seen), scene, TOLERANCE).tolist()]
    client.spin_until(lambda: np.allclose(positions(client.poses[-1]), expected, rtol=0.0, atol=1e-15))
    before = len(client.markers)
    client.spin_until(lambda: len(client.markers) > before + 2)
    assert "trails" not in {marker.ns for message in client.markers for marker in message.markers}

    assert client.shoot(wrench_from_shot((0.0, 40.0, 0.0), (0.0, 0.0)))["accepted"]
    moving = client.place(poses(scene.positions))
    assert moving["accepted"] is False
    assert re.fullmatch(r"every ball must rest before a placement: ball '\w+' moves at [\d.]+ m/s", moving["reason"])
    assert moving["time"] >= verdict["time"] > 0.0
    client.spin_until(lambda: [one["kind"] for one in client.collisions][:2] == ["shot", "ball_ball"])
    assert client.collisions[1]["balls"] == ["cue", "4"]  # the next one above it in the grid

    assert client.reset().success
    client.spin_until(lambda: positions(client.poses[-1])[0] == tuple(scene.positions[0].tolist()))


def states(named: dict[str, tuple[float, ...]], frame: str = "table") -> MultiDOFJointState:
    message = MultiDOFJointState(joint_names=list(named))
    message.header.frame_id = frame
    for point in named.values():
        transform = Transform()
        move = transform.translation
        move.x, move.y, move.z = (*map(float, point), 0.0)[:3]
        message.transforms.append(transform)
    return message


TRIO = bs.Scene([[0.5, 0.5], [1.0, 0.5], [1.5, 0.5]])


def test_balls_that_are_named_lie_there_in_the_order_of_the_scene() -> None:
    places = named_balls(states({"2": (0.7, 0.4), "cue": (1.3, 0.8)}), TRIO, TOLERANCE, "table")
    assert {name: tuple(place) for name, place in places.items()} == {"cue": (1.3, 0.8), "2": (0.7, 0.4)}
    assert list(places) == ["cue", "2"]
    assert named_balls(states({}), TRIO, TOLERANCE, "table") == {}


def test_named_balls_are_separated_as_all_are() -> None:
    squeezed = {"1": (1.0, 0.5), "2": (1.0 + 2.0 * RADIUS - 0.001, 0.5)}
    places = named_balls(states(squeezed), TRIO, TOLERANCE, "table")
    assert places["2"][0] - places["1"][0] == pytest.approx(2.0 * RADIUS, abs=1e-9)
    with pytest.raises(ValueError, match="balls '1' and '2' overlap by 0.001 m, placement_tolerance is 0.0005 m"):
        named_balls(states(squeezed), TRIO, 0.0005, "table")


TWICE = states({"1": (0.7, 0.4), "2": (1.3, 0.8)})
TWICE.joint_names[1] = "1"
SHORT = states({"1": (0.7, 0.4), "2": (1.3, 0.8)})
SHORT.transforms.pop()
BAD_NAMES = {
    "frame": (states({"1": (0.7, 0.4)}, "camera"), "frame_id must be 'table' or empty, got 'camera'"),
    "unknown": (states({"9": (0.7, 0.4)}), "no ball is named '9'; the balls are cue, 1, 2"),
    "twice": (TWICE, "ball '1' is named twice"),
    "too few": (SHORT, "set_balls takes one transform a name, got 2 names and 1 transforms"),
    "nan": (states({"2": (math.nan, 0.4)}), "the position of ball '2' must be finite, got (nan, 0.4, 0.0) m"),
    "rail": (states({"1": (0.7, 0.4), "2": (LOW[0] - 0.0021, 0.4)}), "ball '2' reaches 0.0021 m into a rail"),
}


@pytest.mark.parametrize("case", BAD_NAMES)
def test_a_bad_message_of_names_is_refused_with_figure_and_bound(case: str) -> None:
    message, reason = BAD_NAMES[case]
    with pytest.raises(ValueError, match=re.escape(reason)):
        named_balls(message, TRIO, TOLERANCE, "table")


def test_a_camera_that_misses_balls_takes_them_off_the_table(site: Site) -> None:
    site.table("scene:=rack", "real_time_factor:=5.0")
    client = site.client()
    start = bs.scenes.rack()
    seen = {"3": (0.3, 0.3), "cue": (1.0, 0.6), "9": (1.5, 0.6)}
    verdict = client.set_balls(states({**seen, "Z": (1.0, 1.0)}))
    assert (verdict["accepted"], verdict["reason"][:24]) == (False, "no ball is named 'Z'; th")
    assert client.fresh_state().joint_names == list(start.names)
    message = states(seen)
    message.header.stamp.sec, message.header.stamp.nanosec = 12, 34
    verdict = client.set_balls(message)
    assert (verdict["accepted"], verdict["reason"]) == (True, "")
    assert verdict["request"] == {"sec": 12, "nanosec": 34}
    shown = client.fresh_state()
    assert shown.joint_names == ["cue", "3", "9"]
    for name, one in zip(shown.joint_names, shown.transforms):
        assert (one.translation.x, one.translation.y) == pytest.approx(seen[name], abs=1e-15)
    heights = [pose.position.z for pose in client.fresh_poses()[-1].poses]
    assert [start.names[index] for index, z in enumerate(heights) if z > 0.0] == ["cue", "3", "9"]
    before = len(client.markers)
    client.spin_until(lambda: len(client.markers) > before + 2)
    balls = {one.id for one in client.markers[-1].markers if one.ns in ("balls", "stripes")}
    assert balls == {start.names.index(name) for name in seen}

    # What is off the table is not hit, and what the table says may be said to it.
    assert client.set_balls(shown)["accepted"]
    foreseen = client.preview(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))
    assert foreseen["names"] == ["cue", "3", "9"]
    assert client.shoot(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))["accepted"]
    moving = client.set_balls(states(seen))
    assert "every ball must rest before a placement" in moving["reason"]
    client.spin_until(lambda: client.at_rest[-1] and len(client.collisions) >= len(foreseen["events"]))
    assert {ball for event in client.collisions for ball in event["balls"]} == {"cue", "9"}

    assert client.set_balls(states({"9": (1.5, 0.6)}))["accepted"]
    for ask in (client.shoot, client.preview):
        verdict = ask(wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0)))
        assert (verdict["accepted"], verdict["reason"]) == (False, "ball 'cue' is not in play")
    answer = client.place(client.fresh_poses()[-1])  # those under the table have no place on it
    assert (answer["accepted"], answer["reason"][:12]) == (False, "ball 'cue' r")
    assert client.fresh_state().joint_names == ["9"]
    assert client.set_parameters_atomically(**{"physics.mass": 0.17}).successful
    assert client.fresh_state().joint_names == ["9"]
    assert client.reset().success
    assert client.fresh_state().joint_names == list(start.names)


def test_what_was_separated_may_be_placed_again_without_tolerance() -> None:
    touching = [[0.5, 0.5], [0.5 + 2.0 * RADIUS - 0.5 * TOUCHING, 0.5]]
    scene = bs.Scene(APART)
    assert np.abs(placed(poses(touching), scene, 0.0) - touching).max() == 0.0
