"""The RViz configuration against what the node publishes."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
import yaml
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

import billiards_sim as bs
from billiards_sim.engine.scene import Shot
from billiards_sim.ros import markers
from billiards_sim.ros.preview import predict
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import FRAME

RVIZ = yaml.safe_load((Path(__file__).parents[2] / "config" / "table.rviz").read_text())["Visualization Manager"]
DISPLAYS = {display["Name"]: display for display in RVIZ["Displays"]}
TYPES = {"MarkerArray": "visualization_msgs/msg/MarkerArray", "PoseArray": "geometry_msgs/msg/PoseArray"}


@pytest.fixture
def node() -> Iterator[TableNode]:
    rclpy.init()
    yield TableNode()
    rclpy.shutdown()


def test_every_display_fits_a_publisher_of_the_node(node: TableNode) -> None:
    shown = [display for display in DISPLAYS.values() if "Topic" in display]
    assert sorted(display["Topic"]["Value"] for display in shown) == [
        *("balls/poses", "markers", "preview", "table_markers"),
    ]
    for display in shown:
        topic = display["Topic"]
        (publisher,) = node.get_publishers_info_by_topic(topic["Value"])
        assert publisher.topic_type == TYPES[display["Class"].rpartition("/")[2]]
        latched = publisher.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL
        assert topic["Durability Policy"] == ("Transient Local" if latched else "Volatile")
        assert topic["Reliability Policy"] == "Reliable"
        assert publisher.qos_profile.reliability == ReliabilityPolicy.RELIABLE


def test_the_frame_and_the_namespaces_are_the_messages_own() -> None:
    assert RVIZ["Global Options"]["Fixed Frame"] == FRAME
    simulation = bs.Simulation(bs.Scene([[0.5, 0.5], [1.0, 0.5]], names=("cue", "9")))
    shot = Shot((30.0, 0.0, 0.0))
    preview = markers.preview_markers(predict(simulation, shot), simulation.scene.names, 0.03, 0)
    balls = markers.BallMarkers(simulation.scene.names, 0.03, 30.0)
    balls.update(simulation.positions.tolist(), 0)
    simulation.strike(shot.force)
    balls.flash(markers.contact_points(simulation.advance(1.0)))
    sent = {
        "Table": markers.table_markers(bs.Table(), 0.03, 0),
        "Balls": balls.update(simulation.positions.tolist(), 1),
        "Preview": preview,
    }
    for name, message in sent.items():
        assert set(DISPLAYS[name]["Namespaces"]) == {one.ns for one in message.markers if one.action == one.ADD}
        assert all(DISPLAYS[name]["Namespaces"].values())
        assert DISPLAYS[name]["Enabled"]


def test_the_view_looks_down_on_the_middle_of_the_table() -> None:
    view = RVIZ["Views"]["Current"]
    assert view["Class"] == "rviz_default_plugins/TopDownOrtho"
    assert (view["X"], view["Y"]) == pytest.approx(bs.Table().centre, abs=1e-9)
