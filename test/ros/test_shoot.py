# SPDX-License-Identifier: Apache-2.0
"""Shots in people's words: as plain functions, and with `shoot` and a table in processes of their own."""

import math
import re

import pytest
from conftest import Site
from process import Client, positions

import billiards_sim as bs
from billiards_sim.engine.aim import Aim
from billiards_sim.ros.tools.commentary import Commentary
from billiards_sim.ros.tools.shoot import _describe
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
