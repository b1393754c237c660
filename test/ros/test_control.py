# SPDX-License-Identifier: Apache-2.0
"""Parameters, pause, step and the clock over DDS, with the table in a process of its own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from conftest import Site
from process import DEPTH, NOTHING_LOST, Client, positions, stamp_ns
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import Marker

import billiards_sim as bs
from billiards_sim.ros.wrench import wrench_from_shot

SHOT = wrench_from_shot((80.0, 0.0, 0.0), (0.0, 0.0))


@pytest.fixture(scope="module")
def player(shared_site: Site) -> Client:
    shared_site.table("scene:=rack", *NOTHING_LOST)
    return shared_site.client()


def test_parameters_change_from_another_process(player: Client) -> None:
    assert [one.reason for one in player.set_parameters(update_rate=50)] == [""]
    assert player.shoot(SHOT)["accepted"]
    assert set(np.diff(player.stamps(6)[1:])) <= {19_999_999, 20_000_000, 20_000_001}
    player.reset()
    changes = {"physics.mass": 0.17, "table.length": 2.54, "marker_rate": -1.0, "physics.mas": 1.0}
    results = player.set_parameters(**changes)
    assert [one.successful for one in results] == [True, False, False, False]
    assert all(one.reason for one in results[1:])
    result = player.set_parameters_atomically(**{"physics.mass": 0.18, "physics.cue_contact_time": 0})
    assert result.successful is False
    assert "physics.cue_contact_time out of range Min: 1e-06, Max: 1000000.0, value: 0.0" in result.reason
    assert player.get_parameters("physics.mass", "update_rate") == [0.17, 50.0]
    assert [one.successful for one in player.set_parameters(**{"physics.mass": 0.16, "update_rate": 100})] == [True] * 2


def test_a_paused_table_stands_still_and_goes_step_by_step(player: Client) -> None:
    player.reset()
    refused = player.step()
    assert refused.success is False
    assert "not paused" in refused.message
    assert player.pause(True).success
    shot = player.shoot(SHOT)
    assert shot["accepted"]
    start = player.fresh_poses()
    assert stamp_ns(player.fresh_poses(5)[-1].header.stamp) == stamp_ns(start[0].header.stamp)
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.advance(shot["time"])
    simulation.strike((80.0, 0.0, 0.0))
    for _ in range(3):
        assert player.step().success
        simulation.advance(0.01)
    began = stamp_ns(start[0].header.stamp)
    stepped = player.next_poses(after=began + 20_000_002)[0]
    assert stamp_ns(stepped.header.stamp) - began == pytest.approx(30_000_000, abs=2)
    assert positions(stepped)[0][0] == pytest.approx(simulation.positions[0, 0], abs=1e-12)
    assert positions(stepped)[0][0] > positions(start[0])[0][0] + 0.1

    player.reset()
    assert player.step().success  # a reset does not end the pause
    assert player.pause(False).success
    player.next_poses(after=stamp_ns(stepped.header.stamp) + 50_000_000)


def test_a_new_scene_comes_with_the_reset_and_leaves_nothing_of_the_old(site: Site, tmp_path: Path) -> None:
    path = tmp_path / "two.yaml"
    wide = bs.Table(length=2.54, width=1.27)
    bs.save_scene(bs.Scene([[0.5, 0.5], [2.3, 1.2]], names=("cue", "red"), table=wide), path)
    site.table("scene:=rack")
    client = site.client()
    client.spin_until(lambda: client.markers)
    refused = client.set_parameters(scene=str(tmp_path / "three.yaml"))[0]
    assert "is neither a file nor one of" in refused.reason
    assert client.set_parameters(scene=str(path))[0].successful
    assert len(client.fresh_poses(5)[-1].poses) == 16

    assert client.reset().message == f"2 balls back at the start of scene {path}"
    client.spin_until(lambda: positions(client.poses[-1]) == [(0.5, 0.5), (2.3, 1.2)])
    assert client.get_parameters("table.length", "table.width", "scene") == [2.54, 1.27, str(path)]
    client.spin_until(lambda: client.twists[-1].body_frame_id == "red" and len(client.markers[-1].markers) == 2)
    for drawn in (client.markers, client.table_markers, client.drawings):
        assert [one.action for message in drawn for one in message.markers].count(Marker.DELETEALL) == 1
    cloth = client.table_markers[-1].markers[0]
    assert max(point.x for point in cloth.points) == pytest.approx(2.54 + 2 * wide.rail_thickness)
    assert client.shoot(SHOT)["accepted"]


@pytest.mark.parametrize("sim_time", ["false", "true"])
def test_a_node_on_sim_time_follows_the_table(site: Site, sim_time: str) -> None:
    # With sim time the table listens to its own clock; it must not wait for it.
    site.table("scene:=rack", "publish_clock:=true", "real_time_factor:=2.0", f"use_sim_time:={sim_time}")
    client = site.client()
    times: list[int] = []
    client.node.create_subscription(Clock, "/clock", lambda message: times.append(stamp_ns(message.clock)), DEPTH)
    client.spin_until(lambda: len(times) >= 100)
    ticks = np.diff(times) / 20e6  # of which a queue of 1 may lose some
    assert np.abs(ticks - np.round(ticks)).max() <= 1e-7
    assert round(min(ticks)) == 1
    client.spin_until(lambda: {stamp_ns(message.header.stamp) for message in client.poses} & set(times))
    client.set_own_parameters(use_sim_time=True)
    shown: set[int] = set()

    def follows() -> set[int]:  # the clock has the latest reading, which may come to `times` later
        shown.add(client.node.get_clock().now().nanoseconds)
        return shown & set(times)

    client.spin_until(follows)


def test_the_clock_can_be_turned_on_and_off_at_rest(site: Site) -> None:
    site.table("scene:=rack")
    client = site.client()
    assert client.node.count_publishers("/clock") == 0
    assert client.set_parameters(publish_clock=True)[0].successful
    client.spin_until(lambda: client.node.count_publishers("/clock") == 1)
    assert client.set_parameters(publish_clock=False)[0].successful
    client.spin_until(lambda: client.node.count_publishers("/clock") == 0)


@pytest.mark.parametrize(("name", "foot_spot"), [("pool_9ft", (2.032, 0.762)), ("pool_8ft", (1.8796, 0.7112))])
def test_a_pool_table_stands_in_a_namespace_with_its_rack_on_the_foot_spot(
    site: Site, name: str, foot_spot: tuple
) -> None:
    path = str(Path(__file__).parents[2] / "config" / f"{name}.yaml")
    table = site.process("table", "--ros-args", "--params-file", path, "-r", "__ns:=/hall")
    table.wait_for("ready: ")
    client = site.client(namespace="hall")
    assert positions(client.poses[-1])[1] == pytest.approx(foot_spot, abs=1e-12)
    assert client.shoot(SHOT)["accepted"]


@pytest.mark.parametrize("name", ["snooker_12ft", "carom_10ft"])
def test_a_table_of_another_game_takes_shots_up_to_its_miscue_limit(site: Site, name: str) -> None:
    path = str(Path(__file__).parents[2] / "config" / f"{name}.yaml")
    site.process("table", "--ros-args", "--params-file", path, "-p", "scene:=rack").wait_for("ready: ")
    client = site.client()
    assert client.get_parameters("physics.preset") == [name.partition("_")[0]]
    (radius,) = client.get_parameters("physics.radius")
    assert isinstance(radius, float)
    refused = client.shoot(wrench_from_shot((200.0, 0.0, 0.0), (0.6 * radius, 0.0)))
    assert "the miscue limit is 0.5 radii, " in refused["reason"]
    assert client.shoot(wrench_from_shot((200.0, 0.0, 0.0), (0.4 * radius, 0.0)))["accepted"]
    client.reset()
    assert client.shoot(wrench_from_shot((200.0, 0.0, -50.0), (0.4 * radius, 0.0)))["accepted"]


def test_two_tables_in_namespaces_do_not_hear_each_other(site: Site) -> None:
    site.table("scene:=rack", remap="__ns:=/left")
    site.table("scene:=rack", remap="__ns:=/right")
    left, right = site.client(namespace="left"), site.client(namespace="right")
    assert left.set_parameters(**{"physics.mass": 0.2})[0].successful
    assert right.get_parameters("physics.mass") == [0.16]
    assert left.shoot(SHOT)["accepted"]
    left.spin_until(lambda: any(one["kind"] == "ball_ball" for one in left.collisions))
    first = right.next_poses(5)[-1]
    assert positions(first) == [tuple(row) for row in bs.scenes.rack().positions.tolist()]
    assert (right.results, right.collisions, right.at_rest) == ([], [], [True])
    assert right.shoot(SHOT)["accepted"]  # nor does the ball that moves there matter here
    right.spin_until(lambda: right.collisions and len(right.at_rest) > 1)
    assert len(left.results) == 1
    assert left.reset().success
    left.spin_until(lambda: left.at_rest[-1] is True)
    right.spin_until(lambda: right.at_rest[1:])
    assert right.at_rest[1] is False
    assert positions(right.next_poses()[0]) != positions(first)


def turned(message) -> list[tuple[float, float, float, float]]:
    return [(p.orientation.x, p.orientation.y, p.orientation.z, p.orientation.w) for p in message.poses]


def test_poses_carry_orientation_where_a_parameter_asks(site: Site) -> None:
    site.table("scene:=head_on", "track_orientation:=true", "real_time_factor:=20.0")
    client = site.client()
    client.spin_until(lambda: client.at_rest[-1])
    client.poses.clear()
    client.spin_until(lambda: client.poses)
    orientations = turned(client.poses[0])
    assert all(abs(sum(part * part for part in one) - 1.0) < 1e-12 for one in orientations)
    assert all(abs(one[3]) < 0.999 for one in orientations)
    assert client.set_parameters(track_orientation=False)[0].successful
    client.spin_until(lambda: turned(client.poses[-1]) == [(0.0, 0.0, 0.0, 1.0)] * 2)
