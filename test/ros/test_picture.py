# SPDX-License-Identifier: Apache-2.0
"""What the picture of RViz shows, pixel by pixel."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

pytest.importorskip("matplotlib")
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import imread

import billiards_sim as bs
from billiards_sim.colours import CLOTH, WHITE, WOOD, ball_colour
from billiards_sim.ros import markers
from billiards_sim.ros.tools import picture
from billiards_sim.ros.tools.rendering import View, draw

SETTINGS = yaml.safe_load((Path(__file__).parents[2] / "config" / "table.rviz").read_text())["Visualization Manager"]
GREY = (0.25, 0.25, 0.25)
VIEW = View(centre=(2.0, 1.0), scale=100.0, size=(60, 40), background=GREY, frame="table")


def drawn(*shown: Marker) -> np.ndarray:
    """(height, width, 3) red green blue, from 0 to 1."""
    figure = Figure(figsize=(0.6, 0.4), dpi=100, facecolor=GREY)
    canvas = FigureCanvasAgg(figure)
    draw(figure.add_axes((0.0, 0.0, 1.0, 1.0)), shown, VIEW)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3] / 255


def marker(shape: int, at: tuple[float, float, float], size: float = 0.1, **changes: Any) -> Marker:
    found = Marker(ns="n", type=shape, **changes)
    found.header.frame_id = "table"
    found.pose.position.x, found.pose.position.y, found.pose.position.z = at
    found.scale.x = found.scale.y = found.scale.z = size
    return found


def red(opacity: float = 1.0) -> ColorRGBA:
    return ColorRGBA(r=1.0, a=opacity)


BLUE = ColorRGBA(b=1.0, a=1.0)


def pixel(picture: np.ndarray, x: float, y: float) -> np.ndarray:
    """The colour at a point of the table, m."""
    column = (x - VIEW.centre[0]) * VIEW.scale + 0.5 * VIEW.size[0]
    row = 0.5 * VIEW.size[1] - (y - VIEW.centre[1]) * VIEW.scale
    return picture[int(row), int(column)]


def assert_colour(found: np.ndarray, red: float, green: float, blue: float) -> None:
    assert found == pytest.approx(np.array((red, green, blue)), abs=0.01)


def test_a_box_covers_its_area_to_scale_and_nothing_else() -> None:
    box = marker(Marker.CUBE, (2.05, 1.1, 0.0), color=red())
    box.scale.x, box.scale.y = 0.2, 0.1
    picture = drawn(box)
    assert picture.shape == (40, 60, 3)
    rows, columns = np.nonzero(picture[..., 0] > 0.5)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == pytest.approx((25, 44, 5, 14), abs=1)
    assert_colour(picture[0, 0], *GREY)


def test_a_turned_box_is_drawn_turned() -> None:
    box = marker(Marker.CUBE, (2.0, 1.0, 0.0), color=red())
    box.scale.x, box.scale.y = 0.3, 0.1
    box.pose.orientation.z = box.pose.orientation.w = 0.5**0.5
    picture = drawn(box)
    assert_colour(pixel(picture, 2.0, 1.12), 1.0, 0.0, 0.0)
    assert_colour(pixel(picture, 2.12, 1.0), *GREY)


def test_a_ball_is_round_with_a_darker_edge() -> None:
    picture = drawn(marker(Marker.SPHERE, (2.0, 1.0, 0.1), 0.2, color=red()))
    assert_colour(pixel(picture, 2.0, 1.0), 1.0, 0.0, 0.0)
    assert_colour(pixel(picture, 2.08, 1.08), *GREY)
    outline = 0.5 * 100 / 72  # pixels: half of a line of 1 point
    assert (picture[..., 1] < 0.2).sum() == pytest.approx(np.pi * (10.0 + outline) ** 2, rel=0.1)
    assert 0.6 <= pixel(picture, 2.095, 1.0)[0] < 0.9


def test_the_higher_one_hides_the_lower_one_whatever_comes_first() -> None:
    low, high = marker(Marker.CUBE, (2.0, 1.0, 0.0), color=red()), marker(Marker.CUBE, (2.0, 1.0, 0.5), color=BLUE)
    for order in ([low, high], [high, low]):
        assert_colour(pixel(drawn(*order), 2.0, 1.0), 0.0, 0.0, 1.0)


def test_what_is_translucent_is_blended_over_what_is_below() -> None:
    low, high = marker(Marker.CUBE, (2.0, 1.0, 0.0), color=BLUE), marker(Marker.CUBE, (2.0, 1.0, 0.5), color=red(0.25))
    for order in ([low, high], [high, low]):
        assert_colour(pixel(drawn(*order), 2.0, 1.0), 0.25, 0.0, 0.75)


def test_a_line_has_its_width_and_the_colours_of_its_points() -> None:
    line = marker(Marker.LINE_STRIP, (0.0, 0.0, 0.0), 0.06)
    line.points = [Point(x=1.9, y=1.0), Point(x=2.0, y=1.0), Point(x=2.1, y=1.0)]
    line.colors = [red(0.9), red(0.5), red(0.1)]
    picture = drawn(line)
    for x, opacity in ((1.95, 0.7), (2.05, 0.3)):
        assert pixel(picture, x, 1.0)[0] == pytest.approx(0.25 + 0.75 * opacity, abs=0.03)
    assert pixel(picture, 1.95, 1.02)[0] > 0.5
    assert_colour(pixel(picture, 1.95, 1.04), *GREY)
    line.colors, line.color = [], red()
    assert_colour(pixel(drawn(line), 2.0, 1.0), 1.0, 0.0, 0.0)


def test_a_list_of_lines_has_gaps() -> None:
    line = marker(Marker.LINE_LIST, (0.0, 0.0, 0.0), 0.06, color=red())
    line.points = [Point(x=1.8, y=1.0), Point(x=1.9, y=1.0), Point(x=2.1, y=1.0), Point(x=2.2, y=1.0)]
    picture = drawn(line)
    for x, colour in ((1.85, (1.0, 0.0, 0.0)), (2.0, GREY), (2.15, (1.0, 0.0, 0.0))):
        assert_colour(pixel(picture, x, 1.0), *colour)


def test_level_triangles_are_filled_and_upright_ones_are_not_seen() -> None:
    mesh = marker(Marker.TRIANGLE_LIST, (0.0, 0.0, 0.0), 1.0, color=red())
    square = [(1.9, 0.9), (2.1, 0.9), (2.1, 1.1), (1.9, 1.1)]
    mesh.points = [Point(x=square[i][0], y=square[i][1], z=0.1) for i in (0, 1, 2, 0, 2, 3)]
    mesh.points += [Point(x=1.8, y=0.9, z=0.0), Point(x=1.8, y=1.1, z=0.0), Point(x=1.8, y=1.0, z=0.5)]
    below = marker(Marker.CUBE, (2.0, 1.0, 0.0), color=BLUE)
    picture = drawn(mesh, below)
    for x, y in ((1.92, 1.08), (2.08, 0.92), (2.0, 1.0), (2.05, 1.05)):
        assert_colour(pixel(picture, x, y), 1.0, 0.0, 0.0)
    for x, y in ((2.15, 1.0), (1.8, 1.0), (2.0, 1.15)):
        assert_colour(pixel(picture, x, y), *GREY)


def test_every_point_of_a_list_is_a_ball() -> None:
    spheres = marker(Marker.SPHERE_LIST, (0.0, 0.0, 0.0), color=red())
    spheres.points = [Point(x=1.9, y=1.0), Point(x=2.1, y=1.1)]
    picture = drawn(spheres)
    assert_colour(pixel(picture, 1.9, 1.0), 1.0, 0.0, 0.0)
    assert_colour(pixel(picture, 2.1, 1.1), 1.0, 0.0, 0.0)
    assert_colour(pixel(picture, 2.0, 1.0), *GREY)


def test_a_stripe_is_a_band_from_above_and_turns_with_its_ball() -> None:
    balls = markers.BallMarkers(("9",), 0.1, 30.0, "table")
    half = 0.5**0.5
    bands = {
        (0.0, 0.0, 0.0, 1.0): ((0.0, 0.0), (0.06, 0.0), (0.0, 0.08)),
        (0.0, 0.0, half, half): ((0.0, 0.0), (0.0, 0.06), (0.08, 0.0)),
    }
    for turn, (*coloured, white) in bands.items():
        picture = drawn(*balls.update([[2.0, 1.0]], 0, [list(turn)]).markers)
        for x, y in coloured:
            assert_colour(pixel(picture, 2.0 + x, 1.0 + y), *ball_colour("9"))
        assert_colour(pixel(picture, 2.0 + white[0], 1.0 + white[1]), *WHITE)


@pytest.mark.parametrize("shape", [Marker.CUBE, Marker.CYLINDER])
def test_what_is_inclined_is_an_error(shape: int) -> None:
    inclined = marker(shape, (2.0, 1.0, 0.0))
    inclined.pose.orientation.x, inclined.pose.orientation.w = 0.6, 0.8
    with pytest.raises(ValueError, match="marker n/0 is inclined, which is not drawn here"):
        drawn(inclined)


@pytest.mark.parametrize("shape", [Marker.ARROW, Marker.POINTS, Marker.TEXT_VIEW_FACING, Marker.MESH_RESOURCE])
def test_a_type_that_is_not_drawn_is_an_error(shape: int) -> None:
    with pytest.raises(ValueError, match=f"marker n/0 is of type {shape}, which is not drawn here"):
        drawn(marker(shape, (2.0, 1.0, 0.0)))


def test_a_marker_of_another_frame_is_an_error() -> None:
    lost = marker(Marker.CUBE, (2.0, 1.0, 0.0))
    lost.header.frame_id = "map"
    with pytest.raises(ValueError, match="marker n/0 is in frame 'map', not 'table'"):
        drawn(lost)


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
    assert (view.scale, view.size, view.frame) == (612.0, (400, 200), "table")
    assert view.centre == pytest.approx(bs.Table.pool_9ft().centre, abs=1e-9)
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
