# SPDX-License-Identifier: Apache-2.0
"""A table with pockets as its users meet it: balls that fall, lie in their pockets, and come back."""

import json
import math
import re
from collections.abc import Callable

import numpy as np
import pytest
from conftest import Site
from process import positions
from test_placement import placed, poses, states

import billiards_sim as bs
from billiards_sim.engine.aim import Aim
from billiards_sim.engine.features import trouble_at
from billiards_sim.engine.scene import Scene, Shot
from billiards_sim.ros.messages import Stamps
from billiards_sim.ros.placement import Places, named_balls
from billiards_sim.ros.preview import predict, preview_json
from billiards_sim.ros.table_node import TableNode
from billiards_sim.ros.tools.commentary import Commentary
from billiards_sim.ros.wrench import wrench_from_shot

TABLE, PHYSICS = bs.Table.pool_9ft(), bs.Physics.pool()
RADIUS = PHYSICS.radius
CENTRE_X, CENTRE_Y = TABLE.centre
CORNER, SIDE = (next(one for one in TABLE.mouths if one.name == name) for name in ("x_max_y_min", "y_min"))


def on_table(place: tuple[float, float]) -> tuple[float, float]:
    """In the frame of the table, of a place from its centre."""
    return place[0] + CENTRE_X, place[1] + CENTRE_Y


CORNER_CENTRE, SIDE_CENTRE = on_table(CORNER.centre), on_table(SIDE.centre)
TO_CORNER = (math.sqrt(0.5), -math.sqrt(0.5))
"""Direction into that corner pocket."""


def before_corner(distance: float) -> tuple[float, float]:
    """On the pocket's axis, m from where its slate is cut by the circle."""
    back = CORNER.pocket.slate_radius + distance
    return CORNER_CENTRE[0] - back * TO_CORNER[0], CORNER_CENTRE[1] - back * TO_CORNER[1]


SCENE = Scene([before_corner(0.5), before_corner(0.2), (0.6, 1.0)], table=TABLE, physics=PHYSICS, name="pot")
POT = Aim(1.0, math.radians(-45.0), up=-0.3).shot(PHYSICS)
"""Stops the cue ball behind the 1, which falls into the corner."""


def test_a_preview_tells_what_falls_and_where_the_others_lie() -> None:
    preview = predict(bs.Simulation(SCENE), POT)
    assert preview.pocketed == {"1": "x_max_y_min"}
    answer = json.loads(preview_json(preview, Stamps(0), (0, 0)))
    assert answer["pocketed"] == {"1": "x_max_y_min"}
    assert sorted(answer["final_positions"]) == ["2", "cue"]
    assert answer["names"] == ["cue", "1", "2"]
    (fall,) = [event for event in answer["events"] if event["kind"] == "pocketed"]
    assert (fall["balls"], fall["pocket"], fall["rail"]) == (["1"], "x_max_y_min", None)
    assert math.dist(fall["point"][:2], CORNER_CENTRE) == pytest.approx(CORNER.pocket.slate_radius, abs=1e-9)


def test_the_commentary_tells_of_a_fall_and_does_not_wait_for_that_ball_to_rest() -> None:
    simulation = bs.Simulation(SCENE)
    simulation.strike(POT.force, POT.offset)
    commentary = Commentary()
    lines = []
    for event in simulation.run():
        record = {"rail": event.rail, "pocket": event.pocket, "balls": list(event.balls), "kind": event.kind}
        record |= {"time": event.time, "approach_speed": event.approach_speed, "impulse": event.impulse}
        lines += commentary.take(record)
    assert commentary.finished
    assert commentary.pocketed == {"1": "x_max_y_min"}
    assert [line for line in lines if re.search(r"s  ball 1 falls into pocket x_max_y_min at [\d.]+ m/s$", line)]


def test_a_pot_is_told_on_every_topic_and_the_ball_comes_back(site: Site, tmp_path) -> None:
    path = tmp_path / "pot.yaml"
    bs.save_scene(SCENE, path)
    table = site.table(f"scene:={path}", "real_time_factor:=3.0")
    client = site.client()
    message = wrench_from_shot(POT.force, POT.offset)
    preview = client.preview(message)
    assert preview["pocketed"] == {"1": "x_max_y_min"}

    client.shoot(message)
    client.spin_until(lambda: len(client.collisions) >= len(preview["events"]) and client.at_rest[-2:] == [False, True])
    assert len(client.collisions) == len(preview["events"])
    (fall,) = [event for event in client.collisions if event["kind"] == "pocketed"]
    assert (fall["balls"], fall["pocket"]) == (["1"], "x_max_y_min")
    state = client.fresh_state()
    assert list(state.joint_names) == ["cue", "2"]
    pose = client.fresh_poses()[0].poses[1].position
    assert (pose.x, pose.y) == pytest.approx(CORNER_CENTRE, abs=1e-9)
    assert pose.z == -RADIUS
    before = len(client.markers)
    client.spin_until(lambda: len(client.markers) > before + 1)
    (ball,) = [one for one in client.markers[-1].markers if (one.ns, one.id) == ("balls", 1)]
    assert (ball.action, ball.pose.position.z) == (ball.ADD, -RADIUS)
    assert (ball.pose.position.x, ball.pose.position.y) == pytest.approx(CORNER_CENTRE, abs=1e-9)

    # What the table says of its balls may be said to it: the 1 is then off the table, nowhere.
    assert client.set_balls(state)["accepted"]
    client.spin_until(lambda: positions(client.poses[-1])[1] == (0.0, 0.0))
    assert client.set_balls(states({"1": before_corner(0.2)}))["accepted"]
    assert list(client.fresh_state().joint_names) == ["1"]
    refused = client.shoot(message)
    assert (refused["accepted"], refused["reason"]) == (False, "ball 'cue' is not in play")
    assert client.preview(message)["reason"] == "ball 'cue' is not in play"

    # A camera's whole view brings the others back, a reset everything.
    assert client.place(poses(SCENE.positions))["accepted"]
    assert list(client.fresh_state().joint_names) == ["cue", "1", "2"]
    assert table.stderr.count("scratch") == 0
    assert client.set_balls(states({"2": (0.6, 1.0), "cue": (SIDE_CENTRE[0], 0.5)}))["accepted"]
    scratch = Aim(1.5, math.radians(-90.0)).shot(PHYSICS)
    assert client.shoot(wrench_from_shot(scratch.force, scratch.offset))["accepted"]
    table.wait_for("scratch: ball cue fell into pocket y_min")
    client.spin_until(lambda: client.at_rest[-1])
    assert client.shoot(message)["reason"] == "ball 'cue' is not in play"
    assert client.reset().success
    assert list(client.fresh_state().joint_names) == ["cue", "1", "2"]
    assert client.preview(message)["paths"].keys() == preview["paths"].keys()


def seen(named: dict[str, tuple[float, float]], tolerance: float = 0.002) -> Places:
    return named_balls(states(named), SCENE, tolerance, "table")


@pytest.mark.parametrize("distance", [1e-6, 0.003, 0.02])
def test_a_ball_that_hangs_on_the_shelf_is_placed_to_the_bit(distance: float) -> None:
    there = before_corner(distance)
    assert tuple(seen({"1": there})["1"]) == there


def test_noise_in_a_mouth_is_taken_off_as_elsewhere() -> None:
    jaw = CORNER.edges[0]
    middle = (0.6 * jaw.start[0] + 0.4 * jaw.end[0], 0.6 * jaw.start[1] + 0.4 * jaw.end[1])
    touching = on_table((middle[0] + RADIUS * jaw.normal[0], middle[1] + RADIUS * jaw.normal[1]))
    deep = (touching[0] - 0.001 * jaw.normal[0], touching[1] - 0.001 * jaw.normal[1])
    assert tuple(seen({"1": deep})["1"]) == pytest.approx(touching, abs=1e-9)  # straight out of the jaw
    fallen = before_corner(-0.001)
    assert tuple(seen({"1": fallen})["1"]) == pytest.approx(before_corner(0.0), abs=1e-9)
    for given in ({"1": deep}, {"1": fallen}):
        with pytest.raises(ValueError, match=r"^ball '1' at \(2\.6\d+, 0\.1\d+\) m .* 0\.0005 m$"):
            seen(given, 0.0005)


def test_noise_anywhere_about_a_point_leaves_a_scene() -> None:
    rng = np.random.default_rng(5)
    point = on_table(SIDE.edges[0].point)
    reach = SIDE.pocket.point_radius + RADIUS
    moved = 0
    for angle in rng.uniform(0.0, math.pi, 200):
        there = (point[0] + reach * math.cos(angle), point[1] + reach * math.sin(angle))
        noisy = (there[0] + rng.uniform(-0.001, 0.001), there[1] + rng.uniform(-0.001, 0.001))
        try:
            place = seen({"1": noisy})["1"]
        except ValueError:
            assert trouble_at(TABLE, RADIUS, noisy[0] - CENTRE_X, noisy[1] - CENTRE_Y, 0.002)
            continue
        Scene([place], names=["1"], table=TABLE, physics=PHYSICS)  # which checks it
        if not trouble_at(TABLE, RADIUS, there[0] - CENTRE_X, there[1] - CENTRE_Y, 1e-9):
            # Each push is a projection, of which none leads away from any place that is free.
            assert math.dist(place, noisy) <= 2.0 * math.dist(there, noisy)
        moved += math.dist(place, noisy) > 1e-6
    assert moved > 50


def test_a_ball_pushes_none_that_hangs() -> None:
    hangs = before_corner(0.003)
    beside = before_corner(0.003 + 2.0 * RADIUS - 0.001)
    places = seen({"1": hangs, "2": beside})
    assert tuple(places["1"]) == hangs
    assert tuple(places["2"]) == pytest.approx(before_corner(0.003 + 2.0 * RADIUS), abs=1e-9)


@pytest.mark.parametrize(
    ("place", "reason"),
    [
        (CORNER_CENTRE, "lies in the pocket x_max_y_min"),
        (SIDE_CENTRE, "lies in the pocket y_min"),
        ((CENTRE_X + 0.5, TABLE.y_min), "ball '1' reaches 0.028575 m into a rail"),
        ((5.0, 0.7), "into a rail"),
    ],
)
def test_a_ball_cannot_be_placed_in_a_pocket_or_a_rail(place: tuple[float, float], reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)):
        seen({"1": place})


def test_a_whole_rack_is_placed_on_the_pool_table() -> None:
    rack = bs.scenes.eight_ball(0.0)
    noise = np.random.default_rng(1).uniform(-0.0007, 0.0007, rack.positions.shape)
    Scene(placed(poses(rack.positions + noise), rack, 0.002), table=TABLE, physics=PHYSICS)


def test_a_scratch_is_told_once_and_only_of_the_cue_ball(make_node: Callable[..., TableNode], tmp_path, capfd) -> None:
    both = Scene([before_corner(0.3), before_corner(0.1)], table=TABLE, physics=PHYSICS)
    path = tmp_path / "both.yaml"
    bs.save_scene(both, path)
    node = make_node(f"scene:={path}")
    node.start()
    follow = Aim(1.5, math.radians(-45.0), up=0.4).shot(PHYSICS)
    node.simulation.strike(*_blow(follow))
    for _ in range(300):
        node.advance(0.01)
    assert node.simulation.in_play.tolist() == [False, False]
    told = [line for line in capfd.readouterr().err.splitlines() if "scratch" in line]
    assert len(told) == 1
    assert told[0].endswith("scratch: ball cue fell into pocket x_max_y_min")


def _blow(shot: Shot) -> tuple:
    return shot.force, shot.offset
