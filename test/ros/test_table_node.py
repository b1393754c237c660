# SPDX-License-Identifier: Apache-2.0
"""The node over DDS: the table, and often `shoot`, in processes of their own."""

import math
import re
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from conftest import Site
from geometry_msgs.msg import WrenchStamped
from process import NOTHING_LOST, START_TIMEOUT, Client, positions, stamp_ns

import billiards_sim as bs
from billiards_sim.engine.record import Run
from billiards_sim.ros.markers import BallMarkers
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.wrench import wrench_from_shot

BREAK = ("--force", "125", "6", "--offset", "0.004", "-0.002")


def engine_break(start: float) -> tuple[bs.Simulation, Run]:
    """The engine's own run of BREAK, struck at a time, to rest."""
    simulation = bs.Simulation(bs.scenes.rack())
    simulation.advance(start)
    simulation.strike((125.0, 6.0, 0.0), (0.004, -0.002))
    return simulation, bs.record(simulation)


def test_a_shot_from_another_process_plays_out_as_in_the_engine(site: Site) -> None:
    site.table("scene:=rack", "update_rate:=20", *NOTHING_LOST)
    client = site.client()
    shoot = site.process("shoot", *BREAK)
    client.spin_until(lambda: client.results, START_TIMEOUT)  # not later: its queues are not endless
    assert client.results[0]["accepted"] is True
    simulation, run = engine_break(client.results[0]["time"])
    events = run.events

    client.spin_until(lambda: client.at_rest[-1] and len(client.collisions) >= len(events))
    stamps = [Time(**c["stamp"]) for c in client.collisions]
    assert client.sequence == list(range(1, 1 + len(client.sequence)))
    final = client.next_poses(10, after=stamp_ns(stamps[-1]))[-1]  # whatever might come twice had the time to
    assert client.at_rest == [True, False, True]
    assert len(client.results) == 1
    assert shoot.wait() == 0, shoot.stderr
    assert "accepted" in shoot.stdout

    assert [(c["kind"], c["balls"], c["rail"]) for c in client.collisions] == [
        (e.kind, list(e.balls), e.rail) for e in events
    ]
    for key in ("time", "approach_speed", "impulse"):
        assert [c[key] for c in client.collisions] == pytest.approx([getattr(e, key) for e in events], abs=1e-9)
    radius = simulation.start_scene.physics.radius
    assert np.allclose([c["point"] for c in client.collisions], [[*e.point, radius] for e in events], rtol=0, atol=1e-9)
    assert np.allclose([c["normal"] for c in client.collisions], [[*e.normal, 0.0] for e in events], rtol=0, atol=1e-9)
    assert np.abs(np.array(positions(final)) - simulation.positions).max() <= 1e-9
    assert all(pose.position.z == radius for pose in final.poses)

    # Stamps of collisions are those of their own exact times, on the scale of the poses.
    (epoch,) = {stamp_ns(stamp) - round(c["time"] * 1e9) for stamp, c in zip(stamps, client.collisions)}
    began, ended = stamp_ns(stamps[0]), stamp_ns(stamps[-1])
    rolling = [message for message in client.poses if began < stamp_ns(message.header.stamp) <= ended]
    times = np.array([stamp_ns(message.header.stamp) - epoch for message in rolling]) / 1e9
    wanted = run.positions(np.clip(times, run.start, run.end))
    assert len(rolling) > 50
    assert np.abs(np.array([positions(message) for message in rolling]) - wanted).max() <= 1e-7  # 10 ns at 8 m/s

    # The states of a tick are its poses, and the twists of the balls that move.
    poses = {stamp_ns(message.header.stamp): message for message in client.poses}
    states = {stamp_ns(message.header.stamp): message for message in client.states}
    both = poses.keys() & states.keys()
    assert len(both) > 50
    for stamp in both:
        places = [(one.translation.x, one.translation.y) for one in states[stamp].transforms]
        assert places == positions(poses[stamp])
    for twist in client.twists:
        if (stamp := stamp_ns(twist.header.stamp)) in states:
            ball = states[stamp].joint_names.index(twist.body_frame_id)
            assert states[stamp].twist[ball] == twist.velocity

    def resting() -> set[str]:
        last = {twist.body_frame_id: twist.velocity for twist in client.twists}
        return {name for name, v in last.items() if (v.linear.x, v.linear.y, v.angular.x, v.angular.y) == (0, 0, 0, 0)}

    client.spin_until(lambda: resting() == set(simulation.start_scene.names))
    assert max(math.hypot(t.velocity.linear.x, t.velocity.linear.y) for t in client.twists) > 5.0

    assert {marker.ns for message in client.markers for marker in message.markers} == {
        *("balls", "stripes", "trails", "contacts"),
    }
    client.spin_until(lambda: {marker.ns for marker in client.markers[-1].markers} == {"balls", "stripes"})
    assert client.markers[-1].markers[3].ns == "balls"
    assert client.markers[-1].markers[3].pose.position.x == pytest.approx(final.poses[3].position.x, abs=1e-9)


@pytest.fixture(scope="module")
def idle(shared_site: Site) -> Client:
    """A client at a table where no shot has been accepted."""
    shared_site.table("scene:=rack")
    return shared_site.client()


def wrench(force: tuple = (80, 0, 0), torque: tuple = (0, 0, 0), frame: str = "table") -> WrenchStamped:
    message = wrench_from_shot(force, (0.0, 0.0))
    message.header.frame_id = frame
    vector = message.wrench.torque
    vector.x, vector.y, vector.z = (float(value) for value in torque)
    return message


BAD_SHOTS = {
    "nan": (wrench(force=(math.nan, 0, 0)), "force must be finite"),
    "infinite": (wrench(torque=(0, math.inf, 0)), "torque must be finite"),
    "z": (wrench(force=(80, 0, 5)), "force z must be <= 0: a cue does not lift the ball; got 5 N"),
    "zero": (wrench(force=(0, 0, 0)), "zero"),
    "off the ball": (wrench(torque=(0, 0, 80 * 0.0287)), "0.0287 m from its centre, the radius is 0.028575 m"),
    "along": (wrench(torque=(0.5, 0, 0)), "torque along the force: it is 0.5 N m, allowed up to 0.0008 N m"),
    "frame": (wrench(frame="base_link"), "frame_id must be 'table' or empty, got 'base_link'"),
}


@pytest.mark.parametrize("case", BAD_SHOTS)
def test_a_bad_shot_is_refused_and_leaves_the_table_untouched(idle: Client, case: str) -> None:
    message, reason = BAD_SHOTS[case]
    message.header.stamp.sec, message.header.stamp.nanosec = 12, 34
    result = idle.shoot(message)
    assert (result["accepted"], result["request"]) == (False, {"sec": 12, "nanosec": 34})
    assert reason in result["reason"]
    assert positions(idle.next_poses()[0]) == [tuple(row) for row in bs.scenes.rack().positions.tolist()]
    assert idle.at_rest == [True]
    assert idle.collisions == []


def test_twists_of_resting_balls_come_once_a_second(idle: Client) -> None:
    names = list(bs.scenes.rack().names)
    idle.fresh_poses()
    before = len(idle.twists)

    def told() -> dict[str, list[int]]:
        """When each ball was told of, ns."""
        return {
            name: [stamp_ns(one.header.stamp) for one in idle.twists[before:] if one.body_frame_id == name]
            for name in names
        }

    idle.spin_until(lambda: min(map(len, told().values())) >= 4)
    last = max(stamp for stamps in told().values() for stamp in stamps[:4])
    idle.spin_until(lambda: stamp_ns(idle.poses[-1].header.stamp) >= last)
    ticks = {stamp_ns(message.header.stamp) for message in idle.poses}
    for _, first, _, third, *_ in told().values():  # a new client hears of all at once before that
        assert third - first > 1_500_000_000  # 2 s, but for what a tick may be late or early
        assert sum(first < tick <= third for tick in ticks) <= 200  # at 100 Hz; some may not have been heard


def test_states_name_every_ball_and_say_where_it_is(idle: Client) -> None:
    idle.spin_until(lambda: idle.states)
    message, scene = idle.states[-1], bs.scenes.rack()
    assert message.joint_names == list(scene.names)
    found = [(one.translation.x, one.translation.y, one.translation.z) for one in message.transforms]
    assert found == [(x, y, scene.physics.radius) for x, y in scene.positions.tolist()]
    assert message.header.frame_id == "table"
    assert [len(message.twist), len(message.wrench)] == [16, 0]


def test_markers_of_the_table_come_once(idle: Client) -> None:
    idle.next_poses(20)
    (message,) = idle.table_markers
    assert [marker.ns for marker in message.markers] == ["cloth", "cushions", "rails", "spots", "sights"]


def test_a_late_client_gets_rest_twists_and_table_markers(idle: Client, shared_site: Site) -> None:
    late = shared_site.client()
    late.spin_until(lambda: len(late.twists) >= 16)
    assert late.at_rest == [True]
    assert len(late.table_markers) == 1
    late.close()


def longest_piece_of_a_trail(client: Client) -> float:
    """Between two of its points, m; 0 where there is no trail."""
    trails = [marker.points for message in client.markers for marker in message.markers if marker.ns == "trails"]
    pieces = [math.hypot(one.x - other.x, one.y - other.y) for points in trails for one, other in pairwise(points)]
    return max(pieces, default=0.0)


def test_reset_brings_the_scene_back_while_balls_move(site: Site) -> None:
    start = [tuple(row) for row in bs.scenes.rack().positions.tolist()]
    site.table("scene:=rack")
    client = site.client()
    assert client.shoot(wrench())["accepted"]
    client.spin_until(lambda: any(c["kind"] == "ball_ball" for c in client.collisions))

    refused = client.shoot(wrench())
    assert refused["accepted"] is False
    assert re.search(r"every ball must rest before a shot: ball '\w+' moves at [\d.]+ m/s", refused["reason"])

    response = client.reset()
    assert response.success
    client.spin_until(lambda: client.at_rest == [True, False, True])
    before = len(client.markers)
    client.spin_until(lambda: len(client.markers) > before + 2)
    assert 0.0 < longest_piece_of_a_trail(client) < 0.7  # the cue ball was some 1.2 m from its spot
    assert positions(client.next_poses()[0]) == start
    stamps = [stamp_ns(message.header.stamp) for message in client.poses]
    assert all(np.diff(stamps) >= 0)
    assert stamps[-1] > stamps[0]

    assert client.shoot(wrench())["accepted"]
    client.spin_until(lambda: [c["kind"] for c in client.collisions].count("shot") == 2)


def test_nothing_is_collected_for_markers_that_nobody_hears(table: TableNode, monkeypatch: pytest.MonkeyPatch) -> None:
    def unwanted(*_: object) -> None:
        raise AssertionError("nobody listens")

    monkeypatch.setattr(BallMarkers, "note", unwanted)
    monkeypatch.setattr(BallMarkers, "update", unwanted)
    table.simulation.strike((125.0, 6.0, 0.0), (0.004, -0.002))
    for _ in range(50):
        table._on_beat()
    assert not table.simulation.at_rest


def test_a_table_without_a_cue_ball_in_a_namespace(site: Site, tmp_path: Path) -> None:
    path = tmp_path / "no_cue.yaml"
    bs.save_scene(bs.Scene([[0.5, 0.5], [1.0, 0.5]], names=("red", "blue")), path)  # type: ignore[arg-type]
    site.table(f"scene:={path}", "update_rate:=50", remap="__ns:=/left")
    client = site.client(namespace="left")
    client.next_poses(5)
    topics = {name for name, _ in client.node.get_topic_names_and_types()}
    assert not topics & {"/cue_shot", "/balls/poses", "/collisions", "/shot_result", "/at_rest", "/markers"}
    shoot = site.process("shoot", "--force", "80", "0", "--ros-args", "-r", "__ns:=/left")
    assert shoot.wait() == 1
    assert "refused: no ball is named 'cue'" in shoot.stdout


IMPATIENT_TABLE = """
import sys
from billiards_sim.engine import simulation
from billiards_sim.ros import table_node

simulation.BATCH, simulation.EVENT_BUDGET = 1, 5
table_node.main(sys.argv[1:])
"""


def test_a_stall_puts_the_table_back_and_names_the_file_that_shows_it(site: Site) -> None:
    # With a budget of five steps the burst of impacts in a rack counts as a stall.
    table = site.process("--ros-args", "-p", "scene:=rack", command=[sys.executable, "-c", IMPATIENT_TABLE])
    table.wait_for("ready: ")
    client = site.client()
    assert client.shoot(wrench())["accepted"]
    table.wait_for("the table goes back to the start of its scene: no progress")
    client.spin_until(lambda: client.at_rest == [True, False, True])
    assert positions(client.next_poses()[0]) == [tuple(row) for row in bs.scenes.rack().positions.tolist()]
    path = re.search(r"(\S+\.yaml) reproduces it", table.stderr)
    assert path is not None
    scene = bs.load_scene(path[1])
    Path(path[1]).unlink()
    assert scene.shot is not None and scene.shot.force == (80.0, 0.0, 0.0)
    assert client.shoot(wrench())["accepted"]
