# SPDX-License-Identifier: Apache-2.0
import math
import re

import numpy as np
import pytest
from conftest import Site
from geometry_msgs.msg import Pose, PoseArray
from process import positions

import billiards_sim as bs
from billiards_sim.ros.placement import placed_positions
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


PAIR = bs.Scene([[0.5, 0.5], [1.0, 0.5]])
APART = [[0.7, 0.4], [1.3, 0.8]]


@pytest.mark.parametrize("frame", ["", "table"])
def test_balls_that_are_free_are_placed_to_the_bit(frame: str) -> None:
    assert np.array_equal(placed_positions(poses(APART, frame), PAIR, TOLERANCE, "table"), APART)
    assert np.array_equal(placed_positions(poses(APART), PAIR, 0.0, "table"), APART)


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
        placed_positions(message, PAIR, TOLERANCE, "table")


def test_two_balls_that_overlap_part_evenly_until_they_touch() -> None:
    way = 2.0 * RADIUS - 0.001
    placed = placed_positions(poses([[1.0, 0.5], [1.0 + 0.6 * way, 0.5 + 0.8 * way]]), PAIR, TOLERANCE, "table")
    assert placed[0] == pytest.approx([1.0 - 0.6 * 0.0005, 0.5 - 0.8 * 0.0005], abs=1e-9)
    assert math.dist(*placed) == pytest.approx(2.0 * RADIUS, abs=1e-9)


def test_a_ball_in_a_rail_comes_out_and_pushes_its_neighbour() -> None:
    start = [[LOW[0] - 0.001, 0.5], [LOW[0] - 0.001 + 2.0 * RADIUS, 0.5]]
    placed = placed_positions(poses(start), PAIR, TOLERANCE, "table")
    assert placed == pytest.approx(np.array([[LOW[0], 0.5], [LOW[0] + 2.0 * RADIUS, 0.5]]), abs=1e-9)


def test_a_noisy_rack_becomes_a_scene() -> None:
    rack = bs.scenes.eight_ball(0.0)
    noise = np.random.default_rng(1).uniform(-0.0007, 0.0007, rack.positions.shape)
    bs.Scene(
        placed_positions(poses(rack.positions + noise), rack, TOLERANCE, "table")
    )  # which checks overlaps and rails


def test_what_a_camera_saw_becomes_the_table(site: Site) -> None:
    site.table("scene:=eight_ball", "real_time_factor:=5.0")
    client = site.client()
    scene = bs.scenes.eight_ball()
    seen = np.array([(0.3 + 0.2 * column, 0.3 + 0.2 * row) for row in range(4) for column in range(4)])
    seen[1] = seen[0] + (2.0 * RADIUS - 0.0015, 0.0)
    refused = client.place(poses(seen[:3]))
    assert refused["accepted"] is False
    assert "got 3" in refused["reason"]
    verdict = client.place(poses(seen))
    assert (verdict["accepted"], verdict["reason"]) == (True, "")
    expected = [tuple(row) for row in placed_positions(poses(seen), scene, TOLERANCE, "table").tolist()]
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


def test_what_was_separated_may_be_placed_again_without_tolerance() -> None:
    touching = [[0.5, 0.5], [0.5 + 2.0 * RADIUS - 0.5 * TOUCHING, 0.5]]
    scene = bs.Scene(APART)
    assert np.abs(placed_positions(poses(touching), scene, 0.0, "table") - touching).max() == 0.0
