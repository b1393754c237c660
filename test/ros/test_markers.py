# SPDX-License-Identifier: Apache-2.0
import itertools
import math

import numpy as np
import pytest
from geometry_msgs.msg import Pose
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

import billiards_sim as bs
from billiards_sim.colours import UNNUMBERED, WHITE, ball_colour
from billiards_sim.ros import markers

SECOND = 1_000_000_000


def new(*names: str, rate: float = 30.0) -> markers.BallMarkers:
    return markers.BallMarkers(names, 0.03, rate, "table")


def of(message: MarkerArray, namespace: str) -> list[Marker]:
    return [marker for marker in message.markers if marker.ns == namespace]


def line(marker: Marker) -> list[tuple[float, float]]:
    return [(point.x, point.y) for point in marker.points]


def axis(pose: Pose) -> np.ndarray:
    """Where the z axis of a pose points: the last column of its rotation."""
    q = pose.orientation
    return np.array([2 * (q.x * q.z + q.y * q.w), 2 * (q.y * q.z - q.x * q.w), 1 - 2 * (q.x * q.x + q.y * q.y)])


def test_balls_are_spheres_of_their_own_size_where_they_are() -> None:
    balls = new("cue", "8")
    kept = list(balls.update([[0.1, 0.1], [0.2, 0.2]], SECOND).markers)
    again = of(balls.update([[0.5, 0.6], [0.7, 0.8]], 1_500_000_000), "balls")
    assert all(one is other for one, other in zip(again, kept, strict=True))
    for marker, (index, x, y) in zip(kept, ((0, 0.5, 0.6), (1, 0.7, 0.8))):
        assert (marker.header.frame_id, marker.ns, marker.id) == ("table", "balls", index)
        assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (1, 500_000_000)
        assert (marker.type, marker.action) == (Marker.SPHERE, Marker.ADD)
        assert (marker.pose.position.x, marker.pose.position.y, marker.pose.position.z) == (x, y, 0.03)
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == (0.06, 0.06, 0.06)
        assert marker.color.a == 1.0


def test_a_striped_ball_is_white_with_a_level_band_of_its_colour() -> None:
    message = new("8", "9", "16", "15").update([[0.1, 0.1], [0.2, 0.3], [0.3, 0.3], [0.4, 0.5]], 0)
    assert [marker.id for marker in of(message, "stripes")] == [1, 3]
    for stripe, name in zip(of(message, "stripes"), ("9", "15")):
        ball = of(message, "balls")[stripe.id]
        assert (ball.color.r, ball.color.g, ball.color.b) == WHITE
        assert (stripe.color.r, stripe.color.g, stripe.color.b) == ball_colour(name)
        assert stripe.type == Marker.CYLINDER
        assert stripe.pose.position == ball.pose.position
        assert abs(axis(stripe.pose)[2]) < 1e-12  # else it is no band from above
        assert stripe.scale.x == stripe.scale.y > ball.scale.x > stripe.scale.z > 0.0
    assert of(message, "balls")[0].color.r == pytest.approx(ball_colour("8")[0])


def test_a_tracked_ball_turns_with_its_stripe_and_is_level_again_without() -> None:
    balls = new("cue", "9")
    level = axis(of(balls.update([[0.1, 0.1], [0.2, 0.2]], 0), "stripes")[0].pose)
    half = math.sqrt(0.5)
    turns = {
        (half, 0.0, 0.0, half): (0.0, 0.0, 1.0),  # a quarter turn about x takes y to z
        (0.0, half, 0.0, half): (0.0, 1.0, 0.0),
        (0.0, 0.0, half, half): (-1.0, 0.0, 0.0),
        (0.5, 0.5, 0.5, 0.5): (0.0, 0.0, 1.0),  # x to y to z to x
    }
    for turn, y_axis in turns.items():
        message = balls.update([[0.1, 0.1], [0.2, 0.2]], 1, [[0.0, 0.0, 0.0, 1.0], list(turn)])
        ball, stripe = of(message, "balls")[1], of(message, "stripes")[0]
        q = ball.pose.orientation
        assert (q.x, q.y, q.z, q.w) == turn
        assert abs(axis(stripe.pose) @ y_axis) == pytest.approx(1.0, abs=1e-12)
    message = balls.update([[0.1, 0.1], [0.2, 0.2]], 2)
    assert axis(of(message, "stripes")[0].pose) == pytest.approx(level, abs=1e-12)
    assert of(message, "balls")[1].pose.orientation.w == 1.0


def roll(balls: markers.BallMarkers, count: int, begin: int = 0) -> MarkerArray:
    """The last of some messages, in each of which the first ball is 0.01 m further and the second where it was."""
    for step in range(begin, begin + count):
        message = balls.update([[0.01 * step, 0.5], [0.9, 0.9]], step)
    return message


def test_the_trail_of_a_ball_that_moves_fades_from_the_ball_backwards() -> None:
    balls = new("cue", "1")
    assert of(roll(balls, 1), "trails") == []
    (trail,) = of(roll(balls, 4, begin=1), "trails")
    assert (trail.id, trail.type, trail.action) == (0, Marker.LINE_STRIP, Marker.ADD)
    assert line(trail) == [(0.01 * step, 0.5) for step in (4, 3, 2, 1, 0)]
    assert {point.z for point in trail.points} == {0.03}
    assert 0.0 < trail.scale.x < 0.06
    opacities = [colour.a for colour in trail.colors]
    assert len(opacities) == len(trail.points)
    assert opacities == sorted(opacities, reverse=True)
    # RViz blends a whole line as its last point asks for.
    assert 1.0 > opacities[0] > opacities[-1] > 0.0


def test_a_trail_goes_back_for_the_same_time_with_few_points_that_are_used_again() -> None:
    balls = new("cue", "1")
    (trail,) = of(roll(balls, 100), "trails")
    points = {id(point) for point in trail.points}
    (trail,) = of(roll(balls, 55, begin=100), "trails")
    assert line(trail) == [(0.01 * step, 0.5) for step in range(154, 134, -1)]
    assert {id(point) for point in trail.points} == points
    assert trail.colors[-1].a < 0.05
    assert 1.0 / 30.0 < trail.lifetime.sec + trail.lifetime.nanosec / SECOND < 2.0
    for rate, most in ((10.0, 7), (1000.0, 20)):
        (trail,) = of(roll(new("cue", "1", rate=rate), 100), "trails")
        assert len(trail.points) == most
    assert of(roll(new("cue", "1", rate=1.0), 100), "trails") == []


def test_the_trail_of_a_ball_that_rests_runs_out_and_is_taken_away_once() -> None:
    balls = new("cue", "1")
    roll(balls, 5)
    rest = [balls.update([[0.04, 0.5], [0.9, 0.9]], step) for step in range(5, 8)]
    assert line(of(rest[-1], "trails")[0]) == [(0.04, 0.5), (0.03, 0.5)]
    (gone,) = of(balls.update([[0.04, 0.5], [0.9, 0.9]], 8), "trails")
    assert (gone.id, gone.action) == (0, Marker.DELETE)
    assert of(balls.update([[0.04, 0.5], [0.9, 0.9]], 9), "trails") == []
    (trail,) = of(balls.update([[0.05, 0.5], [0.9, 0.9]], 10), "trails")
    assert (trail.action, line(trail)) == (Marker.ADD, [(0.05, 0.5), (0.04, 0.5)])


def test_trails_stay_while_time_stands_still() -> None:
    balls = new("cue", "1")
    roll(balls, 5)
    for _ in range(3):
        (trail,) = of(balls.update([[0.04, 0.5], [0.9, 0.9]], 4), "trails")
        assert len(trail.points) == 5


@pytest.mark.parametrize("stamp", [4, 5])
def test_trails_start_anew_where_balls_are_put(stamp: int) -> None:
    balls = new("cue", "1")
    roll(balls, 5)
    balls.restart()
    (gone,) = of(balls.update([[2.0, 0.5], [0.1, 0.1]], stamp), "trails")
    assert (gone.id, gone.action) == (0, Marker.DELETE)
    (trail,) = of(balls.update([[2.01, 0.5], [0.1, 0.1]], 6), "trails")
    assert line(trail) == [(2.01, 0.5), (2.0, 0.5)]


def test_contacts_flash_for_a_while_and_do_not_erase_the_ones_before() -> None:
    balls = new("cue", "1")
    still = [[0.1, 0.1], [0.2, 0.2]]
    ids = set()
    alive = math.ceil(markers.FLASH_LIFETIME * 1000.0)  # messages at the highest marker rate
    for step in range(alive):
        balls.flash([(0.3, 0.01 * step), np.array([0.5, 0.625], dtype=np.float32)])
        (flash,) = of(balls.update(still, step), "contacts")
        assert (flash.type, flash.action) == (Marker.SPHERE_LIST, Marker.ADD)
        assert line(flash) == [(0.3, 0.01 * step), (0.5, 0.625)]
        assert flash.lifetime.sec + flash.lifetime.nanosec / SECOND == markers.FLASH_LIFETIME
        assert min(flash.scale.x, flash.scale.y, flash.scale.z, flash.color.a) > 0.0
        ids.add(flash.id)
    assert len(ids) == alive
    assert of(balls.update(still, alive), "contacts") == []
    balls.flash((0.001 * place, 0.0) for place in range(1000))
    (flash,) = of(balls.update(still, alive + 1), "contacts")
    assert line(flash) == [(0.001 * place, 0.0) for place in range(1000 - markers.MOST_FLASHES, 1000)]
    balls.flash([(0.3, 0.3)])
    balls.restart()
    assert of(balls.update(still, alive + 2), "contacts") == []


def test_contacts_are_those_of_balls_with_balls_and_rails() -> None:
    simulation = bs.Simulation(bs.scenes.head_on())
    events = list(simulation.run())
    assert {event.kind for event in events} > {"ball_ball"}
    hits = [event for event in events if event.kind in ("ball_ball", "ball_rail")]
    assert markers.contact_points(events) == [event.point for event in hits]


def test_what_is_sent_of_a_break_arrives_as_it_is() -> None:
    scene = bs.scenes.eight_ball()
    simulation = bs.Simulation(scene)
    simulation.strike((125.0, 6.0, 0.0), (0.004, -0.002))
    balls = markers.BallMarkers(scene.names, scene.physics.radius, 30.0, "table")
    for step in range(20):
        balls.flash(markers.contact_points(simulation.advance(0.03)))
        message = balls.update(simulation.positions.tolist(), step)
        arrived = deserialize_message(serialize_message(message), MarkerArray)
        for one, other in zip(arrived.markers, message.markers, strict=True):
            assert (one.ns, one.id, one.pose, one.scale, one.points) == (
                *(other.ns, other.id, other.pose, other.scale, other.points),
            )
            assert [colour.a for colour in one.colors] == pytest.approx([colour.a for colour in other.colors])
        assert len({(marker.ns, marker.id) for marker in message.markers}) == len(message.markers)
    assert {marker.ns for marker in message.markers} >= {"balls", "stripes", "trails"}


def test_colours_tell_the_balls_of_a_group_apart() -> None:
    colours = [ball_colour(str(number)) for number in range(1, 9)]
    assert len({*colours, ball_colour("cue")}) == 9
    assert ball_colour("9") == ball_colour("1")
    assert ball_colour("red") == ball_colour("16") == UNNUMBERED


def sides(marker: Marker) -> list[tuple[float, float]]:
    at, scale = marker.pose.position, marker.scale
    return [(c - s / 2, c + s / 2) for c, s in ((at.x, scale.x), (at.y, scale.y), (at.z, scale.z))]


def test_rails_frame_the_playing_area_and_do_not_overlap() -> None:
    table = bs.Table()
    message = markers.table_markers(table, 0.03, 0, "table")
    cloth, *rails = message.markers
    assert len({(marker.ns, marker.id) for marker in message.markers}) == 5
    assert abs(sides(cloth)[2][1]) < 1e-12
    noses = (table.x_min, table.x_max, table.y_min, table.y_max)
    found = (sides(rails[0])[0][1], sides(rails[1])[0][0], sides(rails[2])[1][1], sides(rails[3])[1][0])
    assert max(abs(nose - one) for nose, one in zip(noses, found)) < 1e-12
    for one, other in itertools.combinations(rails, 2):
        shared = [min(a[1], b[1]) - max(a[0], b[0]) for a, b in zip(sides(one), sides(other))]
        assert min(shared) < 1e-12
    area = sum(marker.scale.x * marker.scale.y for marker in rails)
    assert abs(area - (cloth.scale.x * cloth.scale.y - table.length * table.width)) < 1e-12


def test_rails_without_thickness_are_not_drawn() -> None:
    message = markers.table_markers(bs.Table(rail_thickness=0.0), 0.03, 0, "table")
    assert [marker.ns for marker in message.markers] == ["cloth"]
