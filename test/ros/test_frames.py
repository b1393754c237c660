# SPDX-License-Identifier: Apache-2.0
"""`frame_id` and `frame_prefix`: two tables in one tree of frames."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import rclpy
from conftest import Site
from process import Client

from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot


@pytest.fixture
def client(site: Site) -> Client:
    site.table("scene:=head_on", "frame_id:=left/table", "frame_prefix:=left/", "real_time_factor:=20.0")
    return site.client()


def test_every_message_of_a_table_is_in_its_own_frame(client: Client) -> None:
    client.spin_until(lambda: client.at_rest[-1] and client.markers and client.states and client.twists)
    shot = wrench_from_shot((20.0, 0.0, 0.0), (0.0, 0.0))
    assert client.preview(shot)["accepted"]
    client.spin_until(lambda: client.drawings)
    drawn = [one for message in (*client.markers, *client.table_markers, *client.drawings) for one in message.markers]
    assert {one.header.frame_id for one in drawn if one.action != one.DELETEALL} == {"left/table"}
    stamped = (*client.poses, *client.states, *client.twists)
    assert {one.header.frame_id for one in stamped} == {"left/table"}
    assert {one.reference_frame_id for one in client.twists} == {"left/table"}
    assert {one.body_frame_id for one in client.twists} == {"left/1", "left/cue"}
    assert client.states[-1].joint_names == ["cue", "1"]  # names of balls, not of frames


def test_orders_are_taken_in_the_own_frame_and_in_none(client: Client) -> None:
    client.spin_until(lambda: client.at_rest[-1])
    placement = client.poses[-1]
    assert placement.header.frame_id == "left/table"
    assert client.place(placement)["accepted"]
    shot = wrench_from_shot((1.0, 0.0, 0.0), (0.0, 0.0))
    assert shot.header.frame_id == ""
    shot.header.frame_id = placement.header.frame_id = "table"
    reason = "frame_id must be 'left/table' or empty, got 'table'"
    assert [client.shoot(shot)["reason"], client.place(placement)["reason"]] == [reason, reason]
    shot.header.frame_id = "left/table"
    assert client.shoot(shot)["accepted"]


def test_a_change_of_the_frame_moves_the_table_too(site: Site) -> None:
    site.table()
    client = site.client()
    assert client.set_parameters(frame_id="hall")[0].successful
    client.spin_until(lambda: client.table_markers[-1].markers[0].header.frame_id == "hall")
    client.spin_until(lambda: client.poses[-1].header.frame_id == "hall")
    client.spin_until(lambda: client.markers and client.markers[-1].markers[0].header.frame_id == "hall")


def test_a_bad_frame_is_refused_while_the_table_runs(make_node: Callable[..., TableNode]) -> None:
    node = make_node()
    node.start()
    result = node.set_parameters_atomically([rclpy.Parameter("frame_id", value="/hall")])
    assert not result.successful
    assert "without '/' in front, got '/hall'" in result.reason
    assert node.get_parameter("frame_id").value == "table"
