# SPDX-License-Identifier: Apache-2.0
import copy
import math
from collections.abc import Sequence

import numpy as np
import pytest
from geometry_msgs.msg import Pose
from rclpy.serialization import deserialize_message, serialize_message
from visualization_msgs.msg import Marker, MarkerArray

import billiards_sim as bs
from billiards_sim.colours import CLOTH, NAMED, UNNUMBERED, WHITE, ball_colour
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


def test_a_trail_goes_back_for_the_same_time_with_few_points() -> None:
    (trail,) = of(roll(new("cue", "1"), 155), "trails")
    assert line(trail) == [(0.01 * step, 0.5) for step in range(154, 134, -1)]
    assert trail.colors[-1].a < 0.05
    assert 1.0 / 30.0 < trail.lifetime.sec + trail.lifetime.nanosec / SECOND < 2.0
    for rate, most in ((10.0, 7), (1000.0, 20)):
        (trail,) = of(roll(new("cue", "1", rate=rate), 100), "trails")
        assert len(trail.points) == most
    assert of(roll(new("cue", "1", rate=1.0), 100), "trails") == []


def test_the_trail_of_a_ball_that_rests_runs_out_and_is_taken_away_once() -> None:
    balls = new("cue", "1")
    roll(balls, 5)
    rest = [of(copy.deepcopy(balls.update([[0.04, 0.5], [0.9, 0.9]], step)), "trails") for step in range(5, 25)]
    # Message 3 brought (0.03, 0.5): 19 messages later, at 22, it is the last that is left.
    assert line(rest[22 - 5][0]) == [(0.04, 0.5), (0.03, 0.5)]
    opacities = [trails[0].colors[1].a for trails in rest[: 23 - 5]]
    assert opacities == sorted(opacities, reverse=True)
    (gone,) = rest[23 - 5]
    assert (gone.id, gone.action) == (0, Marker.DELETE)
    assert rest[24 - 5] == []
    (trail,) = of(balls.update([[0.05, 0.5], [0.9, 0.9]], 25), "trails")
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


def contact(x: float, y: float, kind: str = "ball_rail", normal: tuple[float, float] = (-1.0, 0.0)) -> bs.Event:
    """Of the ball "cue" with a rail, or with the ball "1", at a point."""
    balls = ("cue", "1") if kind == "ball_ball" else ("cue",)
    return bs.Event(0.0, kind, balls, "x_max" if kind == "ball_rail" else None, (x, y), normal, 1.0, 1.0)


def test_a_ball_that_leaves_the_table_is_taken_away_once_and_may_come_back() -> None:
    balls = new("cue", "9")
    places = [[0.1, 0.1], [0.2, 0.2]]
    for step in range(3):
        places = [[x + 0.1, y] for x, y in places]
        balls.update(places, step)
    gone = [
        copy.copy(marker) for marker in balls.update([places[0], [math.nan, math.nan]], 3, None, [True, False]).markers
    ]
    assert [(one.ns, one.id) for one in gone if one.action == Marker.DELETE] == [
        ("balls", 1),
        ("stripes", 1),
        ("trails", 1),
    ]
    assert all(math.isfinite(one.pose.position.x) for one in gone)
    assert [(one.ns, one.id) for one in gone if one.action == Marker.ADD] == [("balls", 0), ("trails", 0)]
    later = balls.update([places[0], [math.nan, math.nan]], 4, None, [True, False]).markers
    assert {(one.ns, one.id) for one in later} == {("balls", 0), ("trails", 0)}
    back = balls.update([places[0], [0.7, 0.7]], 5, None, [True, True]).markers
    assert [(one.ns, one.id, one.action) for one in back if one.id == 1] == [("balls", 1, 0), ("stripes", 1, 0)]
    assert (back[1].pose.position.x, back[1].pose.position.y) == (0.7, 0.7)


def test_contacts_flash_for_a_while_and_do_not_erase_the_ones_before() -> None:
    balls = new("cue", "1")
    still = [[0.1, 0.1], [0.2, 0.2]]
    ids = set()
    alive = math.ceil(markers.FLASH_LIFETIME * 1000.0)  # messages at the highest marker rate
    for step in range(alive):
        balls.note([contact(0.3, 0.01 * step), contact(9.0, 9.0, "rolling"), contact(0.5, 0.625, "ball_ball")])
        (flash,) = of(balls.update(still, step), "contacts")
        assert (flash.type, flash.action) == (Marker.SPHERE_LIST, Marker.ADD)
        assert line(flash) == [(0.3, 0.01 * step), (0.5, 0.625)]
        assert flash.lifetime.sec + flash.lifetime.nanosec / SECOND == markers.FLASH_LIFETIME
        assert min(flash.scale.x, flash.scale.y, flash.scale.z, flash.color.a) > 0.0
        ids.add(flash.id)
    assert len(ids) == alive
    assert of(balls.update(still, alive), "contacts") == []
    balls.note(contact(0.001 * place, 0.0) for place in range(1000))
    (flash,) = of(balls.update(still, alive + 1), "contacts")
    assert line(flash) == [(0.001 * place, 0.0) for place in range(1000 - markers.MOST_FLASHES, 1000)]
    balls.note([contact(0.3, 0.3)])
    balls.restart()
    assert of(balls.update(still, alive + 2), "contacts") == []


def test_a_trail_turns_where_the_ball_hit_something() -> None:
    balls = new("cue", "1")
    balls.update([[0.90, 0.5], [0.4, 0.5]], 0)
    # The cue ball meets the rail at x = 1, then ball "1" below it: the centres are a radius of 0.03 m from the points.
    balls.note([contact(1.0, 0.57), contact(0.94, 0.6, "ball_ball", normal=(0.6, 0.8)), contact(0.9, 0.9, "rest")])
    first, second = of(balls.update([[0.93, 0.65], [0.41, 0.5]], 1), "trails")
    assert np.array(line(first)) == pytest.approx(np.array([(0.93, 0.65), (0.958, 0.624), (0.97, 0.57), (0.90, 0.5)]))
    assert np.array(line(second)) == pytest.approx(np.array([(0.41, 0.5), (0.922, 0.576), (0.4, 0.5)]))
    opacities = [colour.a for colour in first.colors]
    assert opacities[0] == opacities[1] == opacities[2] > opacities[3]  # the same message brought them


def test_a_trail_of_a_break_lies_on_the_path_of_its_ball() -> None:
    scene = bs.scenes.rack()
    simulation = bs.Simulation(scene)
    simulation.strike((125.0, 6.0, 0.0), (0.004, -0.002))
    run = bs.record(simulation, until=0.6)
    playing = bs.Simulation(scene)
    playing.strike((125.0, 6.0, 0.0), (0.004, -0.002))
    balls = markers.BallMarkers(scene.names, scene.physics.radius, 10.0, "table")
    for step in range(6):
        balls.note(playing.advance(0.1))
        message = balls.update(playing.positions.tolist(), step)
    trails = {trail.id: np.array(line(trail)) for trail in of(message, "trails")}
    hits = [event for event in run.events if event.kind == "ball_rail" and event.time > 0.1]
    assert len(hits) >= 3
    for event in hits:
        # Without a point at the cushion the trail would pass it by centimetres.
        (name,) = event.balls
        centre = np.array(event.point) + scene.physics.radius * np.array(event.normal)
        apart = np.linalg.norm(trails[scene.names.index(name)] - centre, axis=1)
        assert apart.min() <= 1e-12


def test_micro_contacts_make_no_corners_and_many_are_bounded() -> None:
    balls = new("cue", "1")
    balls.update([[0.5, 0.5], [0.9, 0.9]], 0)
    balls.note(contact(0.53 + 1e-6 * number, 0.5) for number in range(500))
    (trail,) = of(balls.update([[0.4, 0.5], [0.9, 0.9]], 1), "trails")
    assert line(trail) == [(0.4, 0.5), (0.5, 0.5)]
    balls.note(contact(0.53 + 0.1 * (number % 2), 0.5) for number in range(500))
    (trail,) = of(balls.update([[0.3, 0.5], [0.9, 0.9]], 2), "trails")
    assert len(trail.points) <= markers.MOST_CORNERS + markers.TRAIL_POINTS


def dashes_of(*path: tuple[float, float]) -> np.ndarray:
    """(D, 2, 2) ends of each dash of a preview's line."""
    return np.array(markers._dashes(path)).reshape(-1, 2, 2)


def test_dashes_lie_on_the_line_and_cover_their_share_of_it() -> None:
    found = dashes_of((0.0, 0.0), (0.31, 0.0), (0.31, 0.0), (0.31, 0.4))
    assert np.all((found[..., 1] == 0.0) | (found[..., 0] == 0.31))
    along = found.sum(axis=2)  # 0.71 m of a line: 0.31 m along x, then 0.4 m along y
    period = markers.DASH + markers.GAP
    expected = [(number * period, min(number * period + markers.DASH, 0.71)) for number in range(15)]
    expected[6:7] = [(0.30, 0.31), (0.31, 0.33)]  # around the corner
    assert along == pytest.approx(np.array(expected), abs=1e-12)


def test_the_dashes_of_a_long_line_are_bounded() -> None:
    found = dashes_of((0.0, 0.0), (5e7, 0.0), (0.0, 1.0))
    assert markers.MOST_DASHES <= len(found) <= markers.MOST_DASHES + 2


def test_a_line_of_no_length_has_no_dashes() -> None:
    assert len(dashes_of((1.0, 1.0), (1.0, 1.0))) == 0


def test_what_is_sent_of_a_break_arrives_as_it_is() -> None:
    scene = bs.scenes.rack()
    simulation = bs.Simulation(scene)
    simulation.strike((125.0, 6.0, 0.0), (0.004, -0.002))
    balls = markers.BallMarkers(scene.names, scene.physics.radius, 30.0, "table")
    for step in range(20):
        balls.note(simulation.advance(0.03))
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
    assert ball_colour("16") == ball_colour("rosso") == UNNUMBERED


def test_the_balls_of_snooker_and_carom_billiards_have_their_colours() -> None:
    assert len({ball_colour(name) for name in bs.scenes.snooker().names}) == 8
    assert len({ball_colour(name) for name in bs.scenes.three_cushion().names}) == 3
    assert ball_colour("red") == ball_colour("red15") == NAMED["red"]
    for scene in (bs.scenes.snooker(), bs.scenes.three_cushion()):
        assert UNNUMBERED not in {ball_colour(name) for name in scene.names}
        message = markers.BallMarkers(scene.names, scene.physics.radius, 30.0, "table").update(
            scene.positions.tolist(), 0
        )
        assert {one.scale.x for one in message.markers} == {2.0 * scene.physics.radius}


def lab(colour: Sequence[float]) -> np.ndarray:
    """CIELAB of an sRGB colour (IEC 61966-2-1, white D65), in which distances are what eyes see."""
    rgb = np.asarray(colour)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = (np.array(to_xyz) @ linear) / np.sum(to_xyz, axis=1)
    root = np.where(xyz > (6 / 29) ** 3, np.cbrt(xyz), xyz / (3 * (6 / 29) ** 2) + 4 / 29)
    return np.array([116.0 * root[1] - 16.0, 500.0 * (root[0] - root[1]), 200.0 * (root[1] - root[2])])


@pytest.mark.parametrize("name", [*NAMED, *map(str, range(1, 16))])
def test_every_ball_stands_out_from_the_cloth(name: str) -> None:
    # 2.3 is just noticeable; the green ball on a green cloth had 15.
    assert np.linalg.norm(lab(ball_colour(name)) - lab(CLOTH)) > 40.0
    assert np.linalg.norm(lab(markers._line_colour(name)) - lab(CLOTH)) > 20.0


def level_triangles(marker: Marker) -> np.ndarray:
    """(T, 3, 3) m, those that are seen from above."""
    assert (marker.type, marker.scale.x, marker.scale.y, marker.scale.z) == (Marker.TRIANGLE_LIST, 1.0, 1.0, 1.0)
    corners = np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3, 3)
    return corners[np.ptp(corners[:, :, 2], axis=1) == 0.0]


def area(triangles: np.ndarray) -> np.ndarray:
    """(T,) m^2, positive where they are seen from above."""
    one, other = triangles[:, 1, :2] - triangles[:, 0, :2], triangles[:, 2, :2] - triangles[:, 0, :2]
    return 0.5 * (one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0])


def covers(triangles: np.ndarray, x: float, y: float) -> bool:
    one = triangles[:, :, :2] - (x, y)
    other = np.roll(one, -1, axis=1)
    return bool((one[..., 0] * other[..., 1] > one[..., 1] * other[..., 0]).all(axis=1).any())


def test_a_table_without_pockets_is_its_playing_area_framed_by_cushions_and_rails() -> None:
    table = bs.Table()
    meshes = {
        marker.ns: level_triangles(marker) for marker in markers.table_markers(table, 0.03, 0, "table").markers[:3]
    }
    assert list(meshes) == ["cloth", "cushions", "rails"]
    assert area(meshes["cloth"]).sum() == pytest.approx(table.length * table.width, rel=1e-12)
    assert meshes["cloth"][..., 2].max() == 0.0
    outer = (table.length + 2 * table.rail_thickness) * (table.width + 2 * table.rail_thickness)
    around = area(meshes["cushions"]).sum() + area(meshes["rails"]).sum()
    assert around == pytest.approx(outer - table.length * table.width, rel=1e-12)
    for mesh in meshes.values():
        assert area(mesh).min() > 0.0
    for name in ("cushions", "rails"):
        assert set(meshes[name][..., 2].ravel()) == {markers.RAIL_HEIGHT * 0.03}


@pytest.mark.parametrize("table", [bs.Table.pool_9ft(), bs.Table.pool_7ft(), bs.Table.snooker_12ft()])
def test_a_ball_in_a_pocket_is_seen_from_above_and_lies_over_the_bottom(table: bs.Table) -> None:
    message = markers.table_markers(table, 0.03, 0, "table")
    meshes = {marker.ns: level_triangles(marker) for marker in message.markers[:4]}
    assert meshes["pockets"][..., 2].max() < -2.0 * 0.03
    for mouth in table.mouths:
        at = (mouth.centre[0] + table.centre[0], mouth.centre[1] + table.centre[1])
        assert [name for name in meshes if covers(meshes[name], *at)] == ["pockets"]
    for x, y in (table.centre, table.foot_spot):  # beside them, since triangles meet there
        assert [name for name in meshes if covers(meshes[name], x + 1e-3, y + 2e-3)] == ["cloth"]


def test_a_snooker_table_has_a_baulk_line_and_a_d_and_others_have_no_lines() -> None:
    found = {marker.ns: marker for marker in markers.table_markers(bs.Table.snooker_12ft(), 0.026, 0, "table").markers}
    ends = np.array([[point.x, point.y] for point in found["lines"].points]).reshape(-1, 2, 2)
    lengths = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    assert lengths[0] == pytest.approx(1.778)
    assert lengths[1:].sum() == pytest.approx(math.pi * 0.292, rel=1e-3)
    assert len(found["spots"].points) == 6
    pool = markers.table_markers(bs.Table.pool_9ft(), 0.0286, 0, "table")
    assert [marker.ns for marker in pool.markers] == ["cloth", "cushions", "rails", "pockets", "spots", "sights"]


def test_rails_without_thickness_are_not_drawn() -> None:
    message = markers.table_markers(bs.Table(rail_thickness=0.0), 0.03, 0, "table")
    assert [marker.ns for marker in message.markers] == ["cloth", "spots"]


def test_what_is_sent_of_a_table_arrives_as_it_is() -> None:
    message = markers.table_markers(bs.Table.pool_9ft(), 0.03, 0, "table")
    arrived = deserialize_message(serialize_message(message), MarkerArray)
    for one, other in zip(arrived.markers, message.markers, strict=True):
        assert one.points == other.points
        assert len({(marker.ns, marker.id) for marker in message.markers}) == len(message.markers)


def test_a_pocketed_balls_marker_lies_in_its_pocket_and_one_off_the_table_goes() -> None:
    balls = markers.BallMarkers(("cue", "9", "2"), 0.03, 30.0, "table")
    balls.update([[1.0, 0.5], [1.2, 0.5], [1.4, 0.5]], 0)
    message = balls.update([[1.1, 0.5], [0.1, 0.1], [math.nan, math.nan]], 1, None, [True, False, False])
    found = {(one.ns, one.id): one for one in message.markers}
    ball, stripe = found["balls", 1], found["stripes", 1]
    for one in (ball, stripe):
        assert (one.action, one.pose.position.x, one.pose.position.y, one.pose.position.z) == (one.ADD, 0.1, 0.1, -0.03)
    assert ("trails", 1) not in found
    assert found["balls", 2].action == Marker.DELETE
    message = balls.update([[1.1, 0.5], [0.7, 0.6], [0.8, 0.6]], 2)
    found = {(one.ns, one.id): one for one in message.markers}
    for index, x in ((1, 0.7), (2, 0.8)):
        one = found["balls", index]
        assert (one.action, one.pose.position.x, one.pose.position.z) == (one.ADD, x, 0.03)
