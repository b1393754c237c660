"""What RViz draws: balls as spheres, the cloth and four rails as boxes."""

from __future__ import annotations

from collections.abc import Sequence

from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from billiards_sim.colours import CLOTH, WOOD, ball_colour
from billiards_sim.engine.table import Table
from billiards_sim.ros.messages import set_stamp
from billiards_sim.ros.preview import Preview
from billiards_sim.ros.wrench import FRAME

CLOTH_THICKNESS = 0.01
"""m, for the eye only."""

PATH_WIDTH = 0.004
"""m, of the lines of a preview."""

CONTACT_SIZE = 0.012
"""m, of the points of contact of a preview."""

CONTACT = (1.0, 0.3, 0.1)
"""Their colour, red green blue."""

PREVIEW_OPACITY = 0.4
"""Of the balls where a preview ends."""

RAIL_HEIGHT = 1.25
"""In ball radii above the cloth, for the eye only: the model's rails are vertical walls."""


def new_ball_markers(names: Sequence[str], radius: float) -> MarkerArray:
    """A sphere for each ball, id = its place in the scene, for `update_ball_markers` to place."""
    message = MarkerArray()
    for index, name in enumerate(names):
        marker = _marker("balls", index, Marker.SPHERE, ball_colour(name))
        marker.pose.position.z = float(radius)
        marker.scale.x = marker.scale.y = marker.scale.z = float(2.0 * radius)
        message.markers.append(marker)
    return message


def update_ball_markers(message: MarkerArray, positions: Sequence[Sequence[float]], stamp: int) -> None:
    """Args:
    positions: (N, 2) m, Python floats.
    stamp: ns.
    """
    for marker, (x, y) in zip(message.markers, positions):
        set_stamp(marker.header.stamp, stamp)
        marker.pose.position.x = x
        marker.pose.position.y = y


def table_markers(table: Table, radius: float, stamp: int) -> MarkerArray:
    """The cloth with its surface at z = 0, and the rails x_min, x_max, y_min, y_max around it."""
    outer_x = table.x_max + table.rail_thickness
    outer_y = table.y_max + table.rail_thickness
    height = RAIL_HEIGHT * radius
    boxes = [
        ("cloth", CLOTH, (0.0, outer_x), (0.0, outer_y), (-CLOTH_THICKNESS, 0.0)),
        ("rails", WOOD, (0.0, table.x_min), (0.0, outer_y), (0.0, height)),
        ("rails", WOOD, (table.x_max, outer_x), (0.0, outer_y), (0.0, height)),
        ("rails", WOOD, (table.x_min, table.x_max), (0.0, table.y_min), (0.0, height)),
        ("rails", WOOD, (table.x_min, table.x_max), (table.y_max, outer_y), (0.0, height)),
    ]
    message = MarkerArray()
    for index, (namespace, colour, *sides) in enumerate(boxes):
        if any(high <= low for low, high in sides):
            continue  # rails without thickness: RViz warns of a box without one
        marker = _marker(namespace, index, Marker.CUBE, colour)
        set_stamp(marker.header.stamp, stamp)
        for axis, (low, high) in zip("xyz", sides):
            setattr(marker.pose.position, axis, float(0.5 * (low + high)))
            setattr(marker.scale, axis, float(high - low))
        message.markers.append(marker)
    return message


def preview_markers(preview: Preview | None, names: Sequence[str], radius: float, stamp: int) -> MarkerArray:
    """What a shot would do, in place of the preview before.

    A line for each ball that moves (id = its place in the scene), the points of contact, and every ball, translucent,
    where it ends. Nothing where there is no preview.
    """
    message = erasing()
    if preview is None:
        return message
    for index, (name, path) in enumerate(zip(names, preview.paths)):
        if len(path) > 1:
            line = _marker("preview_paths", index, Marker.LINE_STRIP, ball_colour(name))
            line.scale.x = PATH_WIDTH
            line.points = [Point(x=x, y=y, z=radius) for x, y in path]
            message.markers.append(line)
        ball = _marker("preview_balls", index, Marker.SPHERE, ball_colour(name))
        ball.pose.position.x, ball.pose.position.y = path[-1]
        ball.pose.position.z = radius
        ball.scale.x = ball.scale.y = ball.scale.z = 2.0 * radius
        ball.color.a = PREVIEW_OPACITY
        message.markers.append(ball)
    hits = [event.point for event in preview.events if event.kind in ("ball_ball", "ball_rail")]
    if hits:
        contacts = _marker("preview_contacts", 0, Marker.SPHERE_LIST, CONTACT)
        contacts.scale.x = contacts.scale.y = contacts.scale.z = CONTACT_SIZE
        contacts.points = [Point(x=x, y=y, z=radius) for x, y in hits]
        message.markers.append(contacts)
    for marker in message.markers:
        set_stamp(marker.header.stamp, stamp)
    return message


def erasing() -> MarkerArray:
    """Takes everything off a marker topic: a new scene may have fewer balls."""
    message = MarkerArray()
    message.markers.append(_marker("", 0, Marker.SPHERE, CLOTH))
    message.markers[0].action = Marker.DELETEALL
    return message


def _marker(namespace: str, index: int, shape: int, colour: tuple[float, float, float]) -> Marker:
    marker = Marker()
    marker.header.frame_id = FRAME
    marker.ns = namespace
    marker.id = index
    marker.type = shape
    marker.action = Marker.ADD
    marker.pose.orientation.w = 1.0
    red, green, blue = colour
    marker.color = ColorRGBA(r=red, g=green, b=blue, a=1.0)
    return marker
