import itertools

from visualization_msgs.msg import Marker

import billiards_sim as bs
from billiards_sim.colours import UNNUMBERED, ball_colour
from billiards_sim.ros import markers


def test_balls_are_spheres_of_their_own_size_where_they_are() -> None:
    message = markers.new_ball_markers(("cue", "8"), 0.03)
    kept = list(message.markers)
    markers.update_ball_markers(message, [[0.5, 0.6], [0.7, 0.8]], 1_500_000_000)
    assert all(one is other for one, other in zip(message.markers, kept))
    for marker, (index, x, y) in zip(kept, ((0, 0.5, 0.6), (1, 0.7, 0.8))):
        assert (marker.header.frame_id, marker.ns, marker.id) == ("table", "balls", index)
        assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (1, 500_000_000)
        assert (marker.type, marker.action) == (Marker.SPHERE, Marker.ADD)
        assert (marker.pose.position.x, marker.pose.position.y, marker.pose.position.z) == (x, y, 0.03)
        assert (marker.scale.x, marker.scale.y, marker.scale.z) == (0.06, 0.06, 0.06)
        assert marker.color.a == 1.0


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
    message = markers.table_markers(table, 0.03, 0)
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
    message = markers.table_markers(bs.Table(rail_thickness=0.0), 0.03, 0)
    assert [marker.ns for marker in message.markers] == ["cloth"]
