# SPDX-License-Identifier: Apache-2.0
"""The documentation says what the program declares."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Site
from documents import blocks
from process import positions
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

import billiards_sim as bs
from billiards_sim.ros import parameters
from billiards_sim.ros.qos import MOST_BALLS, TF_DEPTH
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot

DOCUMENT = Path(__file__).parents[2] / "docs" / "ros.md"
PAGE = DOCUMENT.read_text(encoding="utf-8")


def rows() -> list[str]:
    rows = [f"| `scene` | `{parameters.DEFAULT_SCENE}` | | | {parameters.SCENE_HELP} |"]
    rows += [f"| `{name}` | {str(on).lower()} | | | {text} |" for name, (on, text) in parameters.SWITCHES.items()]
    rows += [
        f"| `{name}` | {default and f'`{default}`'} | | | {text} |"
        for name, (default, text) in parameters.TEXTS.items()
    ]
    rows += [
        f"| `{name}` |  | | | {parameters.PRESET_HELP.format(', '.join(presets))} |"
        for name, presets in parameters.GROUP_PRESETS.items()
    ]
    declared = [(name, default, quantity) for name, (default, quantity) in parameters.NUMBERS.items()]
    for group, owner in parameters.GROUPS.items():
        for name, value in parameters.group_values(group, owner()).items():
            declared.append((name, value, parameters.GROUP_QUANTITIES[name]))
    bounds = {name: parameters.bounds(name) for name in parameters.GROUP_QUANTITIES}
    return rows + [
        f"| `{name}` | {value:g} | {q.unit} | {bounds.get(name, q.bounds())} | {q.help} |"
        for name, value, q in declared
    ]


@pytest.mark.parametrize("row", rows())
def test_parameter_table_is_the_declarations(row: str) -> None:
    assert row in PAGE


def topic_rows() -> set[tuple[str, ...]]:
    """Direction, name, type and queue of each row of the table of topics."""
    rows = [line.strip("| ").split(" | ") for line in PAGE.splitlines() if line.startswith(("| in |", "| out |"))]
    return {(way, name.strip("`"), kind.strip("`"), queue) for way, name, kind, _, queue, _ in rows}


def type_name(kind: type) -> str:
    return f"{kind.__module__.partition('.')[0]}/{kind.__name__}"


def queue(topic: str, qos: QoSProfile) -> str:
    assert qos.reliability == ReliabilityPolicy.RELIABLE
    if qos.history == HistoryPolicy.KEEP_ALL:
        return "all"
    if topic == "balls/twists":
        return f"{qos.depth / MOST_BALLS:g} a ball"
    return f"{qos.depth}, latched" if qos.durability == DurabilityPolicy.TRANSIENT_LOCAL else f"{qos.depth}"


def test_the_table_of_topics_is_what_the_node_has(make_node: Callable[..., TableNode]) -> None:
    node = make_node("publish_clock:=true")
    node.start()
    found = set()
    for way, ends in (("in", node.subscriptions), ("out", node.publishers)):
        for end in ends:
            topic = end.topic_name if end.topic_name == "/clock" else end.topic_name.lstrip("/")
            if topic not in ("parameter_events", "rosout"):
                found.add((way, topic, type_name(end.msg_type), queue(topic, end.qos_profile)))
    assert topic_rows() == found | {("out", "/tf", "tf2_msgs/TFMessage", f"{TF_DEPTH}")}
    services = {one.srv_name.rpartition("/")[2]: type_name(one.srv_type) for one in node.services}
    for name in ("reset", "pause", "step"):
        assert f"| service | `~/{name}` | `{services[name]}` |" in PAGE


def recipe(name: str) -> list[str]:
    """Arguments that run the program of the page whose node has this name."""
    (program,) = [block for block in blocks(DOCUMENT, "python") if f'create_node("{name}")' in block]
    return ["-c", program]


def test_the_recipe_in_python_watches_a_shot(site: Site) -> None:
    site.table("real_time_factor:=5.0")
    watcher = site.process(*recipe("watcher"), command=[sys.executable])
    client = site.client()
    watcher.wait_for("watching\n")  # it hears the last of its topics, so it hears all
    assert client.shoot(wrench_from_shot((0.0, 5.0, 0.0), (0.0, 0.0)))["accepted"]
    assert watcher.wait() == 0, watcher.stderr
    _, *events, where = watcher.stdout.splitlines()
    client.spin_until(lambda: len(client.collisions) >= len(events))
    ours = [f"{one['time']:.4f} s {' '.join([one['kind'], *one['balls']])}" for one in client.collisions]
    assert events == ours[: len(events)]
    assert events[0].endswith(" s shot cue")
    lies = [float(word) for word in where.removeprefix("the cue ball lies at ").split()]
    assert lies == pytest.approx(positions(client.fresh_poses()[0])[0], abs=1e-3)  # its last tick may be on its way


def test_the_recipe_in_python_shoots(site: Site) -> None:
    site.table("real_time_factor:=20.0")
    client = site.client()
    player = site.process(*recipe("player"), command=[sys.executable])
    assert player.wait() == 0, player.stderr
    verdict, rest = player.stdout.splitlines()
    assert verdict.startswith("{'version': 2, 'accepted': True, 'reason': '', 'time': ")
    assert rest == "at rest"
    client.spin_until(lambda: len(client.collisions) > 0)
    (speed,) = re.findall(r"# N along x, for 1 ms: (\S+) m/s on a pool table$", PAGE, re.MULTILINE)
    (shot,) = [event for event in client.collisions if event["kind"] == "shot"]
    assert shot["impulse"] == pytest.approx(bs.Physics.pool().mass * float(speed), rel=1e-12)
