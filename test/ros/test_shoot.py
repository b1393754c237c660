# SPDX-License-Identifier: Apache-2.0
"""Shots in people's words: as plain functions, and with `shoot` and a table in processes of their own."""

import argparse
import math
import re

import numpy as np
import pytest
from conftest import Site
from process import Client, positions

import billiards_sim as bs
from billiards_sim.ros.tools.aim import Aim, angle
from billiards_sim.ros.tools.commentary import Commentary


@pytest.mark.parametrize(
    ("text", "value"), [("12deg", math.pi / 15), ("-90deg", -math.pi / 2), ("0.2rad", 0.2), ("-1e-3rad", -1e-3)]
)
def test_an_angle_has_its_unit(text: str, value: float) -> None:
    assert angle(text) == pytest.approx(value, abs=1e-15)


@pytest.mark.parametrize("text", ["12", "deg", "12grad", "nandeg", "infrad", "12 degrees", ""])
def test_an_angle_without_a_unit_is_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="must be an angle with its unit"):
        angle(text)


def test_an_aim_gives_the_ball_its_speed_direction_and_spin() -> None:
    physics = bs.Physics(mass=0.17, radius=0.03, cue_contact_time=0.002)
    aim = Aim(3.0, math.radians(120.0), 0.3, -0.2)
    shot = aim.shot(physics.mass, physics.radius, physics.cue_contact_time)
    simulation = bs.Simulation(bs.Scene([[1.0, 0.6]], physics=physics))
    simulation.strike(shot.force, shot.offset)
    assert simulation.velocities[0] == pytest.approx([-1.5, 1.5 * math.sqrt(3.0)], abs=1e-12)
    # w = 5 v b / (2 R^2) for a tip b off the centre: to the left it turns the ball clockwise
    assert simulation.angular_velocities[0, 2] == pytest.approx(-2.5 * 3.0 * 0.3 / 0.03)
    assert np.hypot(*simulation.angular_velocities[0, :2]) == pytest.approx(2.5 * 3.0 * 0.2 / 0.03)


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan, math.inf])
def test_a_bad_speed_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match="speed must be a finite number > 0"):
        Aim(speed, 0.0)


@pytest.mark.parametrize("offset", [(1.0, 0.0), (0.8, -0.6), (math.nan, 0.0), (0.0, math.inf)])
def test_a_tip_off_the_ball_is_refused(offset: tuple) -> None:
    with pytest.raises(ValueError, match="together < 1 radius, got"):
        Aim(3.0, 0.0, *offset)


def event(kind: str, time: float, *balls: str) -> dict:
    return {"kind": kind, "time": time, "balls": balls, "rail": "x_max", "approach_speed": 1.0, "impulse": 0.5}


def test_a_commentary_ends_when_every_ball_that_moved_rests() -> None:
    commentary = Commentary()
    told = [
        commentary.take(event("shot", 2.0, "cue")),
        commentary.take(event("ball_ball", 2.5, "cue", "1")),
        commentary.take(event("rolling", 2.6, "cue")),
        commentary.take(event("rest", 3.0, "cue")),
    ]
    assert commentary.finished is False
    told += [commentary.take(event("ball_rail", 3.5, "1")), commentary.take(event("rest", 4.0, "1"))]
    assert commentary.finished is True
    assert [line.strip() for line in told] == [
        "0.0000 s  the cue hits ball cue with 0.5 N s",
        "0.5000 s  ball cue and ball 1 at 1 m/s",
        "",
        "",
        "1.5000 s  ball 1 and rail x_max at 1 m/s",
        "",
    ]
    assert (commentary.first_time, commentary.last_time) == (2.0, 4.0)


@pytest.fixture(scope="module")
def client(shared_site: Site) -> Client:
    shared_site.table("real_time_factor:=10.0", "physics.mass:=0.2", "physics.cue_contact_time:=0.004")
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


def test_watching_ends_when_somebody_resets_the_table(client: Client, shared_site: Site) -> None:
    shoot = shared_site.process("shoot", "--speed", "5", "--angle", "90deg", "--watch")
    shoot.wait_for("rail y_max")
    client.reset()
    assert shoot.wait() == 0, shoot.stderr
    client.spin_until(lambda: client.at_rest[-1])
    assert positions(client.fresh_poses()[-1])[1] == tuple(bs.scenes.eight_ball().positions[1].tolist())


def test_watching_ends_when_the_table_goes(site: Site) -> None:
    table = site.table("real_time_factor:=0.1")
    shoot = site.process("shoot", "--speed", "5", "--angle", "90deg", "--watch")
    shoot.wait_for("the cue hits ball")
    table.close()
    assert shoot.wait() == 1
    assert "the table went away before the balls came to rest" in shoot.stderr
