# SPDX-License-Identifier: Apache-2.0
"""Shots in people's words: as plain functions, and with `shoot` and a table in processes of their own."""

import math
import re
from collections.abc import Callable, Iterator

import pytest
import rclpy
from conftest import Site
from geometry_msgs.msg import WrenchStamped
from process import Client, positions
from rclpy.node import Node
from std_msgs.msg import String

import billiards_sim as bs
from billiards_sim.engine.aim import Aim
from billiards_sim.ros.tools.commentary import SLIGHT, Commentary
from billiards_sim.ros.tools.shoot import NoAnswer, Shooter, _describe
from billiards_sim.ros.wrench import wrench_from_shot


@pytest.mark.parametrize("azimuth", [0.0, 0.5 * math.pi, math.pi])
def test_no_number_is_written_as_minus_zero(azimuth: float) -> None:
    shot = Aim(3.0, azimuth, -0.0, -0.0).shot(bs.Physics())
    text = _describe(wrench_from_shot(shot.force, shot.offset), shot)
    assert "torque (0, 0, 0) N m: 0 m to the side, 0 m up" in text
    assert "-0 " not in text.replace(",", " ").replace(")", " ")


def event(kind: str, time: float, *balls: str) -> dict:
    return {"kind": kind, "time": time, "balls": balls, "rail": "x_max", "approach_speed": 1.0, "impulse": 0.5}


def test_a_commentary_ends_when_every_ball_that_moved_rests() -> None:
    commentary = Commentary()
    told = [
        *commentary.take(event("ball_rail", 1.9, "7")),  # of an earlier shot
        *commentary.take(event("shot", 2.0, "cue")),
        *commentary.take(event("ball_ball", 2.5, "cue", "1")),
        *commentary.take(event("rolling", 2.6, "cue")),
        *commentary.take(event("rest", 3.0, "cue")),
    ]
    assert commentary.finished is False
    told += [*commentary.take(event("ball_rail", 3.5, "1")), *commentary.take(event("rest", 4.0, "1"))]
    assert commentary.finished is True
    assert [line.strip() for line in told] == [
        "0.0000 s  the cue hits ball cue with 0.5 N s",
        "0.5000 s  ball cue and ball 1 at 1 m/s",
        "1.5000 s  ball 1 and rail x_max at 1 m/s",
    ]
    assert (commentary.first_time, commentary.last_time) == (2.0, 4.0)
    assert commentary.counts == {"shot": 1, "ball_ball": 1, "ball_rail": 1, "rolling": 1, "rest": 2}


def test_a_burst_of_slight_contacts_is_one_line() -> None:
    commentary = Commentary()
    events = [event("shot", 0.0, "cue"), event("ball_ball", 0.1, "cue", "1")]
    slight = [event("ball_ball", 0.1 + 0.001 * number, "1", "2") for number in range(1, 21)]
    end = [
        event("rolling", 0.15, "1"),
        event("ball_rail", 0.2, "2"),
        event("rest", 0.3, "cue"),
        event("rest", 0.4, "1"),
    ]
    last = [event("ball_rail", 0.5, "2"), event("rest", 0.6, "2")]
    for one in (*slight, last[0]):
        one["approach_speed"] = 0.9 * SLIGHT
    told = [line.strip() for one in (*events, *slight, *end, *last) for line in commentary.take(one)]
    assert told == [
        "0.0000 s  the cue hits ball cue with 0.5 N s",
        "0.1000 s  ball cue and ball 1 at 1 m/s",
        "0.1010 s  20 contacts below 0.001 m/s within 0.0190 s",
        "0.2000 s  ball 2 and rail x_max at 1 m/s",
        "0.5000 s  1 contact below 0.001 m/s",
    ]
    assert commentary.counts["ball_ball"] == 21
    assert commentary.held_back() == []


def test_a_slight_contact_moves_a_ball_by_less_than_can_be_seen() -> None:
    """The distance that a ball rolls from there, by the closed form v^2 / (2 mu g)."""
    physics = bs.Physics()
    assert SLIGHT**2 / (2.0 * physics.rolling_friction * physics.gravity) < 1e-5


@pytest.fixture(scope="module")
def client(shared_site: Site) -> Client:
    shared_site.table("scene:=rack", "real_time_factor:=10.0", "physics.mass:=0.2", "physics.cue_contact_time:=0.004")
    return shared_site.client()


WORDS = ("--speed", "3", "--angle", "-12deg", "--side", "0.3", "--up", "-2e-1")


def test_a_preview_in_words_plays_nothing(client: Client, shared_site: Site) -> None:
    shoot = shared_site.process("shoot", *WORDS, "--preview")
    assert shoot.wait() == 0, shoot.stderr
    assert "the cue hits ball cue with 0.6 N s" in shoot.stdout
    assert len(re.findall(r"(?m)^ +\w+  \d\.\d{4} \d\.\d{4} m$", shoot.stdout)) == 16
    assert "would be accepted" in shoot.stdout
    assert "at rest after" in shoot.stdout
    assert (client.results, client.collisions) == ([], [])


def test_a_shot_in_words_takes_the_tables_own_constants(client: Client, shared_site: Site) -> None:
    shoot = shared_site.process("shoot", *WORDS, "--watch")
    assert shoot.wait() == 0, shoot.stderr
    told = [line for line in shoot.stdout.splitlines() if re.match(r" +\d+\.\d{4} s ", line)]

    def heard_as_many() -> bool:
        kinds = [one["kind"] for one in client.collisions]
        return kinds[-1:] == ["rest"] and sum(kind in ("shot", "ball_ball", "ball_rail") for kind in kinds) == len(told)

    client.spin_until(heard_as_many)
    force = 0.2 * 3.0 / 0.004
    radians = math.radians(-12.0)
    sent = re.search(r"force \((\S+), (\S+), 0\) N, torque \((\S+), (\S+), (\S+)\) N m", shoot.stdout)
    assert sent is not None
    radius = bs.Physics().radius
    wanted = [
        force * math.cos(radians),
        force * math.sin(radians),
        -math.sin(radians) * -0.2 * radius * force,
        math.cos(radians) * -0.2 * radius * force,
        -0.3 * radius * force,
    ]
    assert [float(number) for number in sent.groups()] == pytest.approx(wanted, rel=1e-5)
    shot = client.collisions[0]
    assert (shot["kind"], shot["impulse"]) == ("shot", pytest.approx(0.6))
    assert shot["normal"] == pytest.approx([math.cos(radians), math.sin(radians), 0.0])
    seconds = re.search(r"at rest after (\S+) s", shoot.stdout)
    assert seconds is not None
    assert float(seconds[1]) == pytest.approx(client.collisions[-1]["time"] - shot["time"], abs=6e-4)


def test_a_raised_butt_in_words_is_a_force_that_points_down(client: Client, shared_site: Site) -> None:
    client.reset()
    shoot = shared_site.process("shoot", *WORDS, "--elevation", "30deg", "--preview")
    assert shoot.wait() == 0, shoot.stderr
    told = re.search(r"force \((\S+), (\S+), (\S+)\) N, torque \((\S+), (\S+), (\S+)\) N m", shoot.stdout)
    assert told is not None
    fx, fy, fz, *torque = (float(number) for number in told.groups())
    level = 0.2 * 3.0 / 0.004
    assert (math.hypot(fx, fy), fz) == pytest.approx((level, -level * math.tan(math.radians(30.0))), rel=1e-5)
    # Its torque has no part along the cue, and that to the left is up times the whole force.
    ahead = [math.cos(math.radians(-12.0)), math.sin(math.radians(-12.0))]
    radius = bs.Physics().radius
    assert fx * torque[0] + fy * torque[1] + fz * torque[2] == pytest.approx(0.0, abs=1e-4 * level)
    left = ahead[0] * torque[1] - ahead[1] * torque[0]
    assert left == pytest.approx(-0.2 * radius * math.hypot(level, fz), rel=1e-4)
    refused = shared_site.process("shoot", *WORDS, "--elevation", "91deg")
    assert refused.wait() == 2
    assert "elevation must be >= 0 and < pi/2 rad, got 1.58" in refused.stderr


def test_watching_ends_when_somebody_resets_the_table(client: Client, shared_site: Site) -> None:
    shoot = shared_site.process("shoot", "--speed", "5", "--angle", "90deg", "--watch")
    shoot.wait_for("rail y_max")
    client.reset()
    assert shoot.wait() == 0, shoot.stderr
    client.spin_until(lambda: client.at_rest[-1])
    assert positions(client.fresh_poses()[-1])[1] == tuple(bs.scenes.rack().positions[1].tolist())


def test_watching_ends_when_the_table_takes_the_next_shot(site: Site) -> None:
    # The ball rolls for 3 s and spins for 12 s: three quarters and three seconds of the clock.
    site.table("scene:=rack", "real_time_factor:=4.0", "physics.spin_friction:=0.001")
    for option in ("--watch", "--preview"):
        shoot = site.process("shoot", "--speed", "0.3", "--angle", "90deg", "--side", "0.4", option)
        assert shoot.wait() == 0, shoot.stdout
        assert "at rest after" in shoot.stdout


def test_watching_ends_when_the_table_goes(site: Site) -> None:
    table = site.table("scene:=rack", "real_time_factor:=0.1")
    shoot = site.process("shoot", "--speed", "5", "--angle", "90deg", "--watch")
    shoot.wait_for("the cue hits ball")
    table.close()
    assert shoot.wait() == 1
    assert "the table went away before the balls came to rest" in shoot.stderr


@pytest.mark.parametrize(
    ("table", "shoot"),
    [(("-r", "__node:=snooker"), ()), (("-r", "__ns:=/club/left", "-r", "__node:=pool"), ("-r", "__ns:=/club/left"))],
)
def test_shoot_finds_the_table_whatever_its_name(site: Site, table: tuple, shoot: tuple) -> None:
    site.process("table", "--ros-args", "-p", "scene:=rack", "-p", "physics.mass:=0.2", *table).wait_for("ready: ")
    process = site.process("shoot", "--speed", "3", "--angle", "0deg", "--ros-args", *shoot)
    assert process.wait() == 0, process.stderr
    assert "force (60, 0, 0) N" in process.stdout  # of 0.2 kg for 0.01 s


@pytest.fixture
def nodes() -> Iterator[Callable[[str], Node]]:
    """Makes nodes in this process, which know of each other at once."""
    rclpy.init()
    made = []

    def make(name: str) -> Node:
        made.append(rclpy.create_node(name))
        return made[-1]

    yield make
    for node in made:
        node.destroy_node()
    rclpy.shutdown()


def test_shoot_names_the_tables_where_it_cannot_choose(nodes: Callable[[str], Node]) -> None:
    for name in ("left", "right"):
        node = nodes(name)
        node.create_subscription(WrenchStamped, "cue_shot", print, 10)
        node.create_publisher(String, "shot_result", 10)
    nodes("recorder").create_subscription(WrenchStamped, "cue_shot", print, 10)
    nodes("player").create_publisher(String, "shot_result", 10)
    shooter = Shooter(timeout=5.0)
    with pytest.raises(NoAnswer, match="^2 tables listen on /cue_shot, /left, /right: give each a namespace$"):
        shooter.parameters("physics.mass")
    shooter.destroy_node()


def test_shoot_waits_for_rest_and_shoots(client: Client, shared_site: Site) -> None:
    client.reset()
    client.pause(True)
    first = shared_site.process("shoot", "--speed", "5", "--angle", "90deg")
    assert first.wait() == 0, first.stderr
    refused = shared_site.process("shoot", "--speed", "5", "--angle", "90deg", "--wait", "0.01")
    assert refused.wait() == 1
    assert "shoot: balls move; waiting up to 0.01 s for all to rest\n" in refused.stdout
    assert "shoot: balls still moved after 0.01 s\n" in refused.stderr
    second = shared_site.process("shoot", "--speed", "5", "--angle", "90deg", "--wait", "--watch")
    second.wait_for("shoot: balls move; waiting up to 60 s for all to rest\n")
    client.pause(False)
    assert second.wait() == 0, second.stdout + second.stderr
    assert "the cue hits ball cue" in second.stdout
    assert re.search(r"at rest after \d\d?\.\d+ s", second.stdout)
    third = shared_site.process("shoot", "--speed", "5", "--angle", "90deg", "--wait", "--preview")
    assert third.wait() == 0, third.stderr
    assert "waiting" not in third.stdout
