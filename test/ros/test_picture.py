"""What the picture of RViz shows, pixel by pixel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Point
from matplotlib.image import imread
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

import billiards_sim as bs
from billiards_sim.colours import CLOTH, WHITE, WOOD, ball_colour
from billiards_sim.ros import markers, picture
from billiards_sim.ros.rendering import AMBIENT, View, draw

SETTINGS = yaml.safe_load((Path(__file__).parents[2] / "config" / "table.rviz").read_text())["Visualization Manager"]
GREY = (0.25, 0.25, 0.25)
VIEW = View(centre=(2.0, 1.0), scale=100.0, angle=0.0, size=(60, 40), background=GREY, frame="table")


def marker(shape: int, at: tuple[float, float, float], size: float = 0.1, **changes: Any) -> Marker:
    found = Marker(ns="n", type=shape, **changes)
    found.header.frame_id = "table"
    found.pose.position.x, found.pose.position.y, found.pose.position.z = at
    found.scale.x = found.scale.y = found.scale.z = size
    return found


def red(opacity: float = 1.0) -> ColorRGBA:
    return ColorRGBA(r=1.0, a=opacity)


BLUE = ColorRGBA(b=1.0, a=1.0)


def pixel(drawn: np.ndarray, x: float, y: float, view: View = VIEW) -> list[float]:
    """The colour at a point of the table, m; for a view that is not turned."""
    column = (x - view.centre[0]) * view.scale + 0.5 * view.size[0]
    row = 0.5 * view.size[1] - (y - view.centre[1]) * view.scale
    colour: list[float] = drawn[int(row), int(column)].tolist()
    return colour


def test_a_box_covers_its_area_to_scale_and_nothing_else() -> None:
    box = marker(Marker.CUBE, (2.05, 1.1, 0.0), color=red())
    box.scale.x, box.scale.y = 0.2, 0.1
    drawn = draw([box], VIEW)
    assert drawn.shape == (40, 60, 3)
    covered = np.all(drawn == (1.0, 0.0, 0.0), axis=2)
    assert covered.sum() == 20 * 10
    rows, columns = np.nonzero(covered)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (25, 44, 5, 14)
    assert np.all(drawn[~covered] == GREY)


def test_a_turned_view_turns_what_is_seen_the_other_way() -> None:
    box = marker(Marker.CUBE, (2.2, 1.0, 0.0), color=red())
    turned = View(VIEW.centre, VIEW.scale, 0.5 * np.pi, VIEW.size, GREY, "table")
    rows, columns = np.nonzero(np.all(draw([box], turned) == (1.0, 0.0, 0.0), axis=2))
    assert (columns.mean(), rows.mean()) == (29.5, 37.0)  # from the right to below the middle, half out of the picture


def test_a_ball_is_round_and_darker_at_its_edge() -> None:
    drawn = draw([marker(Marker.SPHERE, (2.0, 1.0, 0.1), 0.2, color=red())], VIEW)
    assert pixel(drawn, 2.0, 1.0) == pytest.approx([1.0, 0.0, 0.0], abs=0.01)
    share = 0.8  # of the radius: the surface there is inclined by a sine of 0.8
    expected = AMBIENT + (1.0 - AMBIENT) * (1.0 - share**2) ** 0.5
    assert pixel(drawn, 2.08, 1.0) == pytest.approx([expected, 0.0, 0.0], abs=0.05)
    assert pixel(drawn, 2.08, 1.08) == list(GREY)
    covered = np.any(drawn != GREY, axis=2).sum()
    assert covered == pytest.approx(np.pi * 10.0**2, rel=0.1)


def test_the_higher_one_hides_the_lower_one_whatever_comes_first() -> None:
    low, high = marker(Marker.CUBE, (2.0, 1.0, 0.0), color=red()), marker(Marker.CUBE, (2.0, 1.0, 0.5), color=BLUE)
    for order in ([low, high], [high, low]):
        assert pixel(draw(order, VIEW), 2.0, 1.0) == [0.0, 0.0, 1.0]
    hidden = marker(Marker.CUBE, (2.0, 1.0, 0.0), color=red(0.5))
    assert pixel(draw([hidden, high], VIEW), 2.0, 1.0) == [0.0, 0.0, 1.0]


def test_what_is_translucent_is_blended_over_what_is_below() -> None:
    low, high = marker(Marker.CUBE, (2.0, 1.0, 0.0), color=BLUE), marker(Marker.CUBE, (2.0, 1.0, 0.5), color=red(0.25))
    for order in ([low, high], [high, low]):
        assert pixel(draw(order, VIEW), 2.0, 1.0) == pytest.approx([0.25, 0.0, 0.75])


def test_a_line_has_its_width_and_the_colours_of_its_points() -> None:
    line = marker(Marker.LINE_STRIP, (0.0, 0.0, 0.0), 0.04)
    line.points = [Point(x=1.9, y=1.0), Point(x=2.1, y=1.0), Point(x=2.1, y=1.1)]
    line.colors = [red(0.9), red(0.1), red(0.1)]
    drawn = draw([line], VIEW)
    for x, opacity in ((1.9, 0.9), (2.0, 0.5), (2.08, 0.18)):
        assert pixel(drawn, x, 1.0)[0] == pytest.approx(0.25 + 0.75 * opacity, abs=0.03)
    assert pixel(drawn, 2.1, 1.09)[0] == pytest.approx(0.325, abs=0.01)  # no darker where two pieces meet
    assert pixel(drawn, 2.1, 1.0)[0] == pytest.approx(0.325, abs=0.01)
    assert pixel(drawn, 2.0, 1.015) != list(GREY)
    assert pixel(drawn, 2.0, 1.025) == list(GREY)
    line.colors, line.color = [], red()
    assert pixel(draw([line], VIEW), 2.0, 1.0) == [1.0, 0.0, 0.0]


def test_every_point_of_a_list_is_a_ball() -> None:
    spheres = marker(Marker.SPHERE_LIST, (0.0, 0.0, 0.0), color=red())
    spheres.points = [Point(x=1.9, y=1.0), Point(x=2.1, y=1.1)]
    drawn = draw([spheres], VIEW)
    assert pixel(drawn, 1.9, 1.0)[0] > 0.9
    assert pixel(drawn, 2.1, 1.1)[0] > 0.9
    assert pixel(drawn, 2.0, 1.0) == list(GREY)


def test_a_stripe_is_a_band_from_above_and_turns_with_its_ball() -> None:
    balls = markers.BallMarkers(("9",), 0.1, 30.0)
    half = 0.5**0.5
    bands = {
        (0.0, 0.0, 0.0, 1.0): ((0.0, 0.0), (0.08, 0.0), (0.0, 0.08)),
        (0.0, 0.0, half, half): ((0.0, 0.0), (0.0, 0.08), (0.08, 0.0)),
        (half, 0.0, 0.0, half): ((0.0, 0.095), (0.095, 0.0), (0.0, 0.0)),  # seen from the pole: a ring
    }
    for turn, (*coloured, white) in bands.items():
        drawn = draw(balls.update([[2.0, 1.0]], 0, [list(turn)]).markers, VIEW)
        hues = [np.array(pixel(drawn, 2.0 + x, 1.0 + y)) for x, y in (*coloured, white)]
        for hue, expected in zip(hues, (ball_colour("9"), ball_colour("9"), WHITE)):
            assert hue / hue.max() == pytest.approx(np.array(expected) / max(expected), abs=0.02)


@pytest.mark.parametrize("shape", [Marker.ARROW, Marker.LINE_LIST, Marker.TEXT_VIEW_FACING, Marker.MESH_RESOURCE])
def test_a_type_that_is_not_drawn_is_an_error(shape: int) -> None:
    with pytest.raises(ValueError, match=f"marker n/0 is of type {shape}, which is not drawn here"):
        draw([marker(shape, (2.0, 1.0, 0.0))], VIEW)


def test_a_marker_of_another_frame_is_an_error() -> None:
    lost = marker(Marker.CUBE, (2.0, 1.0, 0.0))
    lost.header.frame_id = "map"
    with pytest.raises(ValueError, match="marker n/0 is in frame 'map', not 'table'"):
        draw([lost], VIEW)


def array(*found: tuple[str, int, int, float]) -> MarkerArray:
    message = MarkerArray()
    for namespace, index, action, lifetime in found:
        one = Marker(ns=namespace, id=index, action=action)
        one.lifetime.sec, one.lifetime.nanosec = int(lifetime), round(lifetime % 1.0 * 1e9)
        message.markers.append(one)
    return message


def test_a_display_keeps_what_rviz_keeps() -> None:
    display = picture.Display({"Enabled": True, "Namespaces": {"off": False, "on": True}})

    def shown(now: float) -> list[tuple[str, int]]:
        return [(one.ns, one.id) for one in display.shown(now)]

    display.take(array(("on", 1, Marker.ADD, 0.0), ("off", 1, Marker.ADD, 0.0), ("new", 1, Marker.ADD, 0.5)), 1.0)
    assert shown(1.4) == [("on", 1), ("new", 1)]
    assert shown(1.6) == [("on", 1)]
    display.take(array(("new", 1, Marker.ADD, 0.5), ("on", 1, Marker.DELETE, 0.0)), 1.7)
    assert shown(2.1) == [("new", 1)]
    display.take(array(("", 0, Marker.DELETEALL, 0.0), ("on", 2, Marker.ADD, 0.0)), 2.1)
    assert shown(2.1) == [("on", 2)]
    hidden = picture.Display({"Enabled": False})
    hidden.take(array(("on", 1, Marker.ADD, 0.0)), 0.0)
    assert hidden.shown(0.0) == []


def test_the_view_is_that_of_the_file() -> None:
    view = picture.read_view(SETTINGS, (200, 100), 2.0)
    assert (view.scale, view.size, view.frame) == (700.0, (400, 200), "table")
    assert view.centre == pytest.approx(bs.Table().centre, abs=1e-9)
    assert view.background == (40 / 255, 40 / 255, 44 / 255)
    other = {**SETTINGS, "Views": {"Current": {"Class": "rviz_default_plugins/Orbit"}}}
    with pytest.raises(ValueError, match="TopDownOrtho"):
        picture.read_view(other, (200, 100), 1.0)


def test_the_picture_shows_a_break_with_trails_and_flashes_and_a_preview(tmp_path: Path) -> None:
    path = tmp_path / "small.png"
    picture.write_picture(path, SETTINGS, zoom=0.4)
    pixels = imread(path)[..., :3]
    width, height = (round(0.4 * side) for side in picture.SIZE)
    assert pixels.shape == (2 * (height + picture.TITLE), width, 3)
    upper, lower = (half[picture.TITLE :] for half in np.split(pixels, 2))

    def pixels_near(view: np.ndarray, colour: tuple[float, float, float]) -> int:
        return int((np.abs(view - colour).max(axis=2) < 0.1).sum())

    for view in (upper, lower):
        assert pixels_near(view, CLOTH) > 0.4 * width * height
        assert pixels_near(view, WOOD) > 0.05 * width * height
        assert view[0, 0] == pytest.approx(np.array((40, 40, 44)) / 255, abs=0.01)
    assert pixels_near(upper, markers.FLASH) > 10
    assert pixels_near(lower, markers.FLASH) == 0
    without = {**SETTINGS, "Displays": [one for one in SETTINGS["Displays"] if one["Name"] != "Preview"]}
    picture.write_picture(path, without, zoom=0.4)
    again = imread(path)[..., :3]
    assert np.array_equal(np.split(again, 2)[0], np.split(pixels, 2)[0])
    changed = np.any(np.split(again, 2)[1] != np.split(pixels, 2)[1], axis=2).sum()
    assert changed > 100  # the lines and the translucent balls


def test_a_file_that_is_not_there_is_one_line_and_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert picture.main([str(tmp_path / "a.png"), "--rviz", str(tmp_path / "none.rviz")]) == 2
    assert capsys.readouterr().err.startswith("picture: ")
