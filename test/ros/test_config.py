# SPDX-License-Identifier: Apache-2.0
"""The RViz configuration against what RViz reads and what the node publishes."""

import copy
from collections.abc import Iterator
from pathlib import Path

import pytest
import rclpy
import rviz_schema
import yaml
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

import billiards_sim as bs
from billiards_sim.engine.scene import Shot
from billiards_sim.ros import markers
from billiards_sim.ros.parameters import DEFAULT_FRAME
from billiards_sim.ros.preview import predict
from billiards_sim.ros.table_node import TableNode

FILE = yaml.safe_load((Path(__file__).parents[2] / "config" / "table.rviz").read_text())
RVIZ = FILE["Visualization Manager"]
DISPLAYS = {display["Name"]: display for display in RVIZ["Displays"]}
TYPES = {"MarkerArray": "visualization_msgs/msg/MarkerArray", "PoseArray": "geometry_msgs/msg/PoseArray"}


def test_rviz_knows_every_name_and_every_value_of_the_file() -> None:
    assert rviz_schema.mistakes(FILE) == []


MANAGER = "Visualization Manager"
BROKEN = {
    "a display's property": (MANAGER, "Displays", 1, "Namespace"),
    "a property of its topic": (MANAGER, "Displays", 1, "Topic", "Dpeth"),
    "a policy": (MANAGER, "Displays", 0, "Topic", "Durability Policy"),
    "a type": (MANAGER, "Displays", 0, "Topic", "Depth"),
    "a class": (MANAGER, "Displays", 2, "Class"),
    "a tool": (MANAGER, "Tools", 0, "Class"),
    "a property of a tool": (MANAGER, "Tools", 4, "Line Color"),
    "the view": (MANAGER, "Views", "Current", "Zoom"),
    "a colour": (MANAGER, "Global Options", "Background Color"),
    "a panel": ("Panels", 0, "Help height"),
    "a value with parts": (MANAGER, "Displays", 1, "Namespaces"),
}


@pytest.mark.parametrize("path", BROKEN.values(), ids=BROKEN.keys())
def test_a_misspelt_name_or_value_is_found(path: tuple[str | int, ...]) -> None:
    settings = copy.deepcopy(FILE)
    inner = settings
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = "Transient local"
    (mistake,) = rviz_schema.mistakes(settings)
    assert str(path[-1]) in mistake or "no class" in mistake


def test_what_rviz_reads_only_together_or_needs_is_asked_for() -> None:
    settings = copy.deepcopy(FILE)
    del settings["Panels"][0]["Tree Height"]
    del settings["Window Geometry"]["Hide Left Dock"]
    assert rviz_schema.mistakes(settings) == [
        "/Panels/0: only together: Help Height, Tree Height",
        "/Window Geometry: needs Hide Left Dock",
    ]


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
    assert RVIZ["Global Options"]["Fixed Frame"] == DEFAULT_FRAME
    simulation = bs.Simulation(bs.Scene([[0.5, 0.5], [1.0, 0.5]], names=("cue", "9")))
    shot = Shot((30.0, 0.0, 0.0))
    preview = markers.preview_markers(predict(simulation, shot), 0, DEFAULT_FRAME)
    balls = markers.BallMarkers(simulation.start_scene.names, 0.03, 30.0, DEFAULT_FRAME)
    balls.update(simulation.positions.tolist(), 0)
    simulation.strike(shot.force)
    balls.note(simulation.advance(1.0))
    sent = {
        "Table": markers.table_markers(bs.Table.pool_9ft(), 0.03, 0, DEFAULT_FRAME),
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
    assert (view["X"], view["Y"]) == pytest.approx(bs.Table.pool_9ft().centre, abs=1e-9)
