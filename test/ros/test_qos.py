# SPDX-License-Identifier: Apache-2.0
"""`qos_overrides.*`: parameters that change the quality of service of each publisher and subscription."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
import rclpy
from conftest import Site
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, ReliabilityPolicy
from rclpy.subscription import Subscription

from billiards_sim.ros import qos
from billiards_sim.ros.table_node import TableNode

OF_EVERY_NODE = ("/parameter_events", "/rosout")


def started(make_node: Callable[..., TableNode], *given: str) -> TableNode:
    node = make_node(*given)
    node.start()
    return node


def ends(node: TableNode) -> Iterator[tuple[str, Publisher | Subscription]]:
    """Each end with its kind, but those that every node has."""
    for kind, found in (("publisher", node.publishers), ("subscription", node.subscriptions)):
        yield from ((kind, end) for end in found if end.topic_name not in OF_EVERY_NODE)


def test_every_end_can_be_made_best_effort(make_node: Callable[..., TableNode]) -> None:
    plain = started(make_node, "publish_clock:=true")
    names = [f"qos_overrides.{end.topic_name}.{kind}" for kind, end in ends(plain)]
    assert {end.qos_profile.reliability for _, end in ends(plain)} == {ReliabilityPolicy.RELIABLE}
    plain.destroy_node()
    rclpy.try_shutdown()
    assert len(names) >= 15
    given = [f"{name}.reliability:=best_effort" for name in names] + [f"{name}.depth:=3" for name in names]
    node = started(make_node, "publish_clock:=true", *given)
    for _, end in ends(node):
        assert (end.qos_profile.reliability, end.qos_profile.depth) == (ReliabilityPolicy.BEST_EFFORT, 3), (
            end.topic_name
        )
        info = node.get_publishers_info_by_topic if isinstance(end, Publisher) else node.get_subscriptions_info_by_topic
        assert {one.qos_profile.reliability for one in info(end.topic_name)} == {ReliabilityPolicy.BEST_EFFORT}
    assert {node.describe_parameter(one.partition(":=")[0]).read_only for one in given} == {True}
    assert qos.LATCHED.reliability == ReliabilityPolicy.RELIABLE  # what all share is as it was


def test_the_other_policies_are_heard_too(make_node: Callable[..., TableNode]) -> None:
    prefix = "qos_overrides./balls/states.publisher"
    node = started(make_node, f"{prefix}.durability:=transient_local", f"{prefix}.history:=keep_all")
    (profile,) = [end.qos_profile for _, end in ends(node) if end.topic_name == "/balls/states"]
    assert (profile.durability, profile.history) == (DurabilityPolicy.TRANSIENT_LOCAL, HistoryPolicy.KEEP_ALL)


def test_what_is_not_overridden_is_no_parameter(table: TableNode) -> None:
    assert table.get_parameters_by_prefix("qos_overrides") == {}


def test_a_publisher_that_comes_and_goes_keeps_its_override(make_node: Callable[..., TableNode]) -> None:
    node = started(make_node, "qos_overrides./clock.publisher.depth:=7")
    for _ in range(2):
        for on in (True, False):
            assert node.set_parameters_atomically([rclpy.Parameter("publish_clock", value=on)]).successful
            depths = [end.qos_profile.depth for _, end in ends(node) if end.topic_name == "/clock"]
            assert depths == [7] * on


def test_an_override_of_nothing_is_told(make_node: Callable[..., TableNode], capfd: pytest.CaptureFixture[str]) -> None:
    started(
        make_node,
        "qos_overrides./colisions.publisher.depth:=5",
        "qos_overrides./collisions.publisher.reliabilty:=best_effort",
        "qos_overrides./collisions.publisher.depth:=5",
    )
    log = capfd.readouterr().err
    assert log.count("names no topic or policy of this node") == 2
    assert "'qos_overrides./colisions.publisher.depth'" in log
    assert "reliabilty" in log


@pytest.mark.parametrize(
    "given",
    [
        "qos_overrides./collisions.publisher.reliability:=beste",
        "qos_overrides./collisions.publisher.depth:=many",
        "qos_overrides./collisions.publisher.depth:=-1",
        "qos_overrides./collisions.publisher.depth:=2147483648",
        "qos_overrides./collisions.publisher.lifespan:=-1",
        "qos_overrides./cue_shot.subscription.durability:=forever",
    ],
)
def test_a_value_that_no_policy_has_is_one_line_and_code_2(site: Site, given: str) -> None:
    table = site.process("table", "--ros-args", "-p", given)
    assert table.wait() == 2
    (line,) = [line for line in table.stderr.splitlines() if line.startswith("table: ")]
    assert line.startswith(f"table: parameters {given.rpartition('.')[0]}.*: ")
    assert "Traceback" not in table.stderr
    assert "rcutils" not in table.stderr
